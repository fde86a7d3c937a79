"""Report: self-contained, complete, correct, with all weaknesses stated."""

import base64
import csv
import hashlib
import json
import re
import shutil
from dataclasses import replace
from html import unescape

import numpy as np
import pytest
from inflating import inflated
from small_run import empty_plots, identified_run, state_hardware

from drivers.drive_bus import SampleFlag
from hil import cli
from hil.errors import NotIdentifiable
from hil.estimation.estimate import LeftOut
from hil.estimation.excluded.result import ErrorTerm
from hil.estimation.identify import estimate
from hil.estimation.local_fits import believed_fit
from hil.friction.equation import place
from hil.model.base_parameters import base_parameters
from hil.planning.measurement import ELEMENT_KINDS
from hil.report.page import report
from hil.results.advice import CampaignResult, advice
from hil.results.findings import kept
from hil.results.identification import identify
from hil.results.model import Model
from hil.results.prediction import FreeTorques, effect_of_errors
from hil.runs.pooling import recorded
from hil.runs.recording import Finding
from hil.runs.run import Run
from hil.runs.run_folder import RunFolder
from hil.show.html import symbols
from hil.show.rounding import decimals, percent, rounded, significant

TITLE_OF_P11 = "inertia xx - yy of link 5 (p11)"
PLOTS = {
    *ELEMENT_KINDS,
    *(f"{name}-angles" for name, kind in ELEMENT_KINDS.items() if not kind.pair),
    "friction",
    "residuals",
    "intervals",
    "excluded",
    "torque",
    "friction-law",
}
"""Plots of a campaign without friction measurements, load or diagnosis."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = identified_run(tmp_path_factory.mktemp("report") / "run")
    (path / "model.yaml").unlink()
    return RunFolder.open(path)


@pytest.fixture(scope="module")
def figures(folder):
    return folder.path / "figures"


@pytest.fixture(scope="module")
def page(folder, figures):
    return report(Run.open(folder.path), figures).read_text()


@pytest.fixture(scope="module")
def found(folder):
    measured = list(recorded(folder))
    return {each: estimate(folder.robot, measured, each) for each in ("improved", "published")}


@pytest.fixture
def copy(folder, tmp_path, monkeypatch):
    """Copy of the run to be changed, whose report has empty plots."""
    empty_plots(monkeypatch)
    written = shutil.ignore_patterns("model.yaml", "report.html", "figures")
    shutil.copytree(folder.path, tmp_path / "run", ignore=written)
    return tmp_path / "run"


@pytest.fixture
def unchanged(copy, folder, page, monkeypatch):
    """Copy with unchanged recordings, and therefore unchanged findings."""
    del page  # the page needs the run itself
    found = kept(folder)
    monkeypatch.setattr("hil.results.findings.kept", lambda *_: found)
    return copy


def text_of(markup):
    """Return the text seen by a reader: inline markup removed, other tags as spaces."""
    markup = re.sub(r"(?s)<(style|script|svg)\b.*?</\1>", "", str(markup))
    markup = re.sub(r"</?(i|b|sub|sup)>", "", markup)
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", markup))


class TestPage:
    def test_it_is_one_file_that_needs_no_network(self, page):
        assert not re.search(r'(src|href)\s*=\s*"(?!data:|#)', page)
        assert not re.search(r"url\(|@import|<link|<iframe|<img", page)

    def test_its_policy_allows_no_other_script_than_its_own(self, page):
        (policy,) = re.findall(r'Content-Security-Policy" content="([^"]+)"', page)
        (script,) = re.findall(r"(?s)<script>(.*?)</script>", page)
        digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
        assert unescape(policy).startswith(f"default-src 'none'; script-src 'sha256-{digest}'")
        assert " onclick" not in page

    def test_every_plot_is_drawn_and_described(self, page):
        plots = re.findall(r'(?s)<figure id="plot-([\w-]+)">(.*?)</figure>', page)
        assert {name for name, _ in plots} == PLOTS
        for _, content in plots:
            (description,) = re.findall(r'role="img" aria-label="([^"]+)"', content)
            assert len(description) > 40
            assert "<svg viewBox" in content

    def test_the_plot_that_shows_the_result_stands_above_the_contents(self, page):
        first = re.search(r'<figure id="plot-([\w-]+)">', page)
        assert first[1] == "torque"
        assert first.start() < page.index("<nav")

    def test_points_lead_to_the_recordings_behind_them(self, page, folder):
        (packed,) = re.findall(r'id="carried">([^<]+)<', page)
        carried = inflated(packed)
        segments = {each["id"]: each for each in carried["segments"] if each["recorded"]}
        assert set(re.findall(r'data-m="([^"]+)"', page)) == set(segments)
        assert set(segments) == {each.measurement.id for each in folder}
        motion = folder["i01"].measurement
        assert segments["i01"]["words"] == f"i01: inertia, {motion.axes_in_words}"
        torques = carried["measured"]["torque"], carried["predicted"], carried["band"]
        for axis in motion.read:
            for track in (each[axis] for each in torques):
                assert len(track["time"]["differences"]) == len(track["value"]["differences"]) > 100

    def test_parameters_lead_to_the_recordings_that_carry_them(self, page, folder):
        (packed,) = re.findall(r'id="carried">([^<]+)<', page)
        carried = inflated(packed)["parameters"]
        assert carried["p3"]["title"] == "product of inertia xz of link 2 (p3)"
        by = dict(carried["p3"]["by"])
        assert sum(share for name, share in by.items() if name.startswith("c")) > 90.0
        assert {folder[name].measurement.kind for name, _ in carried["p14"]["by"][:2]} == {
            "inertia"
        }

    def test_every_parameter_is_there_with_value_error_and_interval(self, page, found, manutec):
        text, best = text_of(page), found["improved"]
        base = base_parameters(manutec)
        for k, name in enumerate(base.names):
            error, half = best.standard_errors[k], best.half_width()[k]
            row = text[: text.index(f" {text_of(symbols(base.expressions[k]))} ")]
            row = row[row.rindex(f" {name} ") :]
            for value in (best.values[k], error, best.values[k] - half, best.values[k] + half):
                assert rounded(value, error) in row

    def test_the_contents_lead_to_every_section(self, page):
        (contents,) = re.findall(r"(?s)<nav.*?</nav>", page)
        linked = re.findall(r'href="#([\w-]+)"', contents)
        assert linked == re.findall(r'<section id="([\w-]+)"', page)
        assert len(set(linked)) == len(linked) > 5

    def test_the_parameters_can_be_taken_along_as_csv_and_json(self, page, found):
        links = r'download="manutec-r15-parameters\.(\w+)" href="data:[^,]+;base64,([^"]+)"'
        files = {
            kind: base64.b64decode(content).decode() for kind, content in re.findall(links, page)
        }
        table = list(csv.DictReader(files["csv"].splitlines()))
        assert [float(row["value"]) for row in table] == list(found["improved"].values)
        for row in table:
            assert float(row["low_95"]) < float(row["value"]) < float(row["high_95"])
        kept = json.loads(files["json"])
        assert kept["parameters"][0]["expression"] == table[0]["expression"]
        assert np.shape(kept["covariance"]) == (14, 14)

    def test_both_methods_stand_side_by_side(self, page, found):
        text = text_of(page)
        sections = text[text.index("Findings and remedies") :]
        begin, end = map(sections.rindex, ("Improved and published", "Sessions and drives"))
        compared = sections[begin:end]
        for k in range(14):
            for each in found.values():
                assert rounded(each.values[k], each.standard_errors[k]) in compared

    def test_it_says_what_was_measured_on_what(self, page, folder):
        text = text_of(page)
        assert "SIMULATED" in text
        assert "39 (12 gravity, 24 inertia, 3 coupling)" in text
        assert "drive no. 6" in text
        assert "on these recordings: residual up to 8 Hz" in text
        assert folder.plan.digest in text
        assert folder.robot.digest in text

    def test_the_plots_are_files_on_request(self, page, figures):
        assert {path.stem for path in figures.iterdir()} == PLOTS
        assert all(path.read_bytes().startswith(b"<svg") for path in figures.iterdir())


class TestModelNote:
    def test_no_model_is_needed(self, page):
        assert "No model.yaml yet; hil identify writes these parameters there." in page

    @pytest.mark.long
    def test_the_report_is_by_the_method_that_the_model_was_made_by(self, unchanged):
        identify(Run.open(unchanged), "published").save(unchanged / "model.yaml")
        text = report(Run.open(unchanged)).read_text()
        assert "39 measurements, published method" in text
        assert "holds the parameters of the same method" in text
        assert "Improved and published method" not in text

    def test_a_damaged_model_does_not_matter(self, unchanged):
        (unchanged / "model.yaml").write_text("format: 9\n")
        assert "model.yaml cannot be used" in report(Run.open(unchanged)).read_text()


class TestOtherRuns:
    def test_what_a_session_noted_is_told(self, unchanged):
        journal = unchanged / "run.json"
        note = "joint 2 <node 2>: warning 4210"
        journal.write_text(journal.read_text().replace('"notes": []', f'"notes": ["{note}"]'))
        assert "joint 2 &lt;node 2&gt;: warning 4210" in report(Run.open(unchanged)).read_text()

    def test_a_run_on_hardware_is_not_called_simulated(self, unchanged):
        journal = unchanged / "run.json"
        state_hardware(journal, "socketcan <can0>")
        page = report(Run.open(unchanged)).read_text()
        assert "SIMULATED" not in page
        assert "socketcan &lt;can0&gt;" in page

    @pytest.mark.long
    def test_an_incomplete_run_says_what_is_missing(self, copy):
        (copy / "recordings" / "i05.h5").unlink()
        text = text_of(report(Run.open(copy)).read_text())
        assert "Remedy: finish the run with hil run … --resume i05 1 of 39 planned" in text

    @pytest.mark.long
    def test_a_run_that_holds_too_little_is_refused(self, copy):
        for path in (copy / "recordings").glob("i*.h5"):
            path.unlink()
        with pytest.raises(NotIdentifiable, match="0 usable inertia measurements"):
            report(Run.open(copy))
        assert not (copy / "report.html").exists()

    def test_the_command_states_where_the_report_is(self, copy, capsys):
        with pytest.raises(SystemExit) as ended:
            cli.main(["report", str(copy)])
        assert not ended.value.code
        assert "report.html" in capsys.readouterr().out.replace("\n", "")


class TestAdvice:
    def advised(self, folder, estimate, campaign=None, budget=()):
        effect = effect_of_errors(estimate)
        campaign = list(folder) if campaign is None else campaign
        model = Model(**vars(estimate), provenance=None, error_budget=budget)
        found = advice(CampaignResult(model, effect, folder.plan, campaign))
        return {item.subject: item for item in found}

    def test_a_parameter_that_spoils_the_torques_is_weak(self, folder, found):
        best = found["improved"]
        covariance = best.scatter_covariance.copy()
        covariance[10] = covariance[:, 10] = 0.0
        covariance[10, 10] = 0.1**2
        item = self.advised(folder, replace(best, scatter_covariance=covariance))[TITLE_OF_P11]
        assert "% of the torque of joint" in item.reason
        assert re.search(r"add inertia measurements of axis [45], such as i\d\d", item.remedy)
        assert item.word == "doubtful"

    @pytest.mark.parametrize(("share", "word"), [(0.005, None), (0.05, "good"), (0.15, "doubtful")])
    def test_uncertain_instants_name_the_timing(self, folder, found, share, word):
        campaign = []
        for each in folder:
            flags = each.recording.flags.copy()
            flags[: round(share * len(flags)), 0] |= np.uint8(SampleFlag.UNTIMED)
            recording = replace(each.recording, flags=flags)
            campaign.append(replace(each, recording=recording))
        item = self.advised(folder, found["improved"], campaign).get("timing")
        assert (item and item.word) == word
        if item:
            assert f"{100 * share:.1f}% of all samples have uncertain time stamps" in item.reason

    def test_few_degrees_of_freedom_alone_ask_for_nothing(self, folder, found):
        """With few degrees of freedom an interval is wide; the torques
        show whether it is too wide.
        """
        few = replace(found["improved"], degrees_of_freedom=np.full(14, 2.0))
        as_many = self.advised(folder, found["improved"])
        assert set(self.advised(folder, few)) == set(as_many)

    def test_causes_of_error_come_first_those_accounted_for_as_notes(self, folder, found):
        def term(cause, *axes, accounted):
            return ErrorTerm(
                cause=cause, axes=axes, found="a figure", torque=0.01, share=0.5,
                accounted=accounted,
            )  # fmt: skip

        gears = term("soft gears", 1, 3, accounted=True)
        encoders = term("coarse encoders", 3, accounted=False)
        items = self.advised(folder, found["improved"], budget=(gears, encoders))
        assert list(items)[:2] == ["axis 1, axis 3", "axis 3"]
        assert (
            items["axis 1, axis 3"].reason == "soft gears: a figure; if ignored, 50 % of the error"
        )
        assert items["axis 1, axis 3"].word == "good"
        assert items["axis 3"].reason == "coarse encoders: a figure; 50 % of the error"
        assert items["axis 3"].remedy.startswith("use encoders of higher resolution")
        assert items["axis 3"].word == "doubtful"

    def test_a_measurement_that_scatters_stands_out(self, folder, found):
        local = found["improved"].local
        odd = next(value for value in local if value.kind == "inertia")
        worse = [
            v.model_copy(update={"residual": 90 * v.residual}) if v is odd else v for v in local
        ]
        items = self.advised(folder, replace(found["improved"], local=tuple(worse)))
        assert re.search(r"residual .* N m, \d+ times the usual residual", items[odd.id].reason)
        assert not {v.id for v in local if v is not odd} & set(items)

    def test_axes_on_which_the_local_models_do_not_fit_are_stated(self, folder, found):
        best = found["improved"]
        residual = folder.robot.torque_limit * [0.003, 0.02, 0.003, 0.015, np.nan, 0.003]
        item = self.advised(folder, replace(best, residual=residual))["axis 2, axis 4"]
        assert "residual 2.0 %, 1.5 % of the torque limit" in item.reason
        assert item.word == "doubtful"

    def test_findings_and_measurements_left_out_are_stated(self, folder, found):
        campaign = list(folder)
        finding = Finding("stuck", "axis 2 stood still for 0.3 s", 0.3, 0.1)
        campaign[3] = replace(campaign[3], findings=(finding,), attempts=3)
        best = replace(
            found["improved"], left_out=(LeftOut("g02", "no usable sample: none at all"),)
        )
        items = self.advised(folder, best, campaign)
        assert "3 attempts: axis 2 stood still" in items[campaign[3].measurement.id].reason
        assert items["g02"].reason == "left out: no usable sample: none at all"

    def test_correlated_parameters_are_named_together(self, folder, found):
        best = found["improved"]
        covariance = np.diag(np.diag(best.scatter_covariance))
        covariance[0, 1] = covariance[1, 0] = -0.97 * np.sqrt(covariance[0, 0] * covariance[1, 1])
        alike = replace(best, scatter_covariance=covariance)
        assert alike.correlation[0, 1] == pytest.approx(-0.97)
        items = self.advised(folder, alike)
        assert "−0.97" in items["inertia of axis 1 (p1), inertia xx - yy of link 2 (p2)"].reason

    def test_friction_that_differs_by_direction_is_of_note(self, folder, found):
        items = self.advised(folder, found["improved"])
        (subject,) = [s for s in items if s.startswith("axis 2")]
        assert "half-sums of both directions deviate by" in items[subject].reason
        assert items[subject].word == "good"

    def test_drives_taken_as_exact_are_of_note(self, folder, found):
        item = self.advised(folder, found["improved"])["torque constants and rotor inertias"]
        assert "state their uncertainty in the robot file" in item.remedy


class TestPointsOfStep1:
    def test_they_lie_on_the_model_where_it_is_right(self, found):
        """Friction has offsets here, which the published step 1 takes for gravity."""
        local = [each for each in found["improved"].local if each.kind == "gravity"]
        raw = {each.axis: each.value - each.model for each in local}
        seen = [(each.shown[0] - each.model) / each.shown[1] for each in local]
        assert abs(raw[1]) > 0.5
        assert np.mean(np.abs(seen)) < 2.0
        assert all(each.believed is None for each in found["published"].local)

    def test_an_inertia_that_is_wrong_by_a_percent_shows(self, folder, found):
        """Friction has more terms here than in step 1; they must not hide the model's error."""
        best = found["improved"]
        m, s = next((m, s) for m, s in best.joint.prepared if m.kind == "inertia" and m.index == 1)
        place_of_axis = place(folder.robot, 1)[best.joint.solver.n_base :]
        common = best.joint.solver.solution[place_of_axis]
        right, wrong = best.values, 1.01 * best.values
        values = [believed_fit(folder.robot, m, s, p, common).evaluate(p) for p in (right, wrong)]
        lower = [each.value - each.model for each in values]
        assert lower[0] - lower[1] == pytest.approx(0.01 * values[0].model, rel=0.2)


class TestPrediction:
    def test_errors_of_parameters_become_errors_of_torques(self, folder, found):
        best, free = found["improved"], FreeTorques(folder.robot)
        error = free.standard_error(best.covariance)
        assert free.standard_error(4 * best.covariance) == pytest.approx(2 * error)
        assert np.all(free.relative(error, best.values) < 0.05)

    def test_one_parameter_alone_has_its_own_effect(self, folder, found):
        alone = np.zeros((14, 14))
        alone[13, 13] = 0.01**2
        only, free = replace(found["improved"], scatter_covariance=alone), FreeTorques(folder.robot)
        error = free.standard_error(only.covariance)
        effect = effect_of_errors(only)
        assert free.relative(error, only.values) == pytest.approx(effect[:, 13])
        assert effect[:, :13].max() == 0.0


class TestRounding:
    @pytest.mark.parametrize(
        ("uncertainty", "expected"),
        [(0.0052, 4), (0.00075, 5), (0.5, 2), (12.0, 0), (340.0, 0), (0.0, 4), (np.nan, 4)],
    )
    def test_an_uncertainty_has_two_digits(self, uncertainty, expected):
        assert decimals(uncertainty) == expected

    def test_a_value_has_the_digits_it_deserves(self):
        assert rounded(-28.05174, 0.0051) == "−28.0517"
        assert rounded(-0.00001, 0.0051) == "0.0000"

    @pytest.mark.parametrize(
        ("part", "whole", "expected"),
        [(0.0071, 48.5, "0.015"), (0.21, 1.0, "21"), (2.0, 1.0, "> 100"), (1.0, 0.0, "> 100")],
    )
    def test_a_share_has_two_digits(self, part, whole, expected):
        assert percent(part, whole) == expected

    def test_a_round_figure_has_no_lonely_point(self):
        assert significant(471.2, 3) == "471"
        assert significant(2.3, 3) == "2.30"
