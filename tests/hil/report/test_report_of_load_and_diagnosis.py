"""Loads and diagnoses kept in a run's folder, and their sections of reports."""

import io
import re
import shutil
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console
from small_run import empty_plots, write_run
from synthetic import TABLE_3_A

from checked_files.yaml_file import load_yaml
from hil import cli
from hil.commands.diagnose import NAME, DiagnosisFile, diagnose, write_diagnosis
from hil.commands.payload import changes, torque_constants
from hil.estimation.absent_parameters import Sinusoid
from hil.model.base_parameters import base_parameters
from hil.report.page import report
from hil.report.sections.kept import current
from hil.results.load import quantities
from hil.results.load_file import LoadFile
from hil.runs.run import Run
from hil.show.terminal import show

LOAD = {"m6": 10.86, "sz6": 1.5204, "Ixx6": 0.2387, "Iyy6": 0.2387, "Izz6": 0.047}
OFFSET = 0.06
"""First moment of link 4 off its axis [kg m]; a small and noisy run needs a large one."""


def text_of(markup):
    markup = re.sub(r"(?s)<(style|script|svg)\b.*?</\1>", "", markup)
    markup = re.sub(r"</?(i|b|sub|sup)>", "", markup)
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", markup))


def hil(*arguments):
    with pytest.raises(SystemExit) as ended:
        cli.main([str(argument) for argument in arguments])
    assert not ended.value.code


@pytest.fixture(scope="module")
def runs(manutec, tmp_path_factory):
    """Runs without load, with load, and of a robot whose file lacks parameters."""
    place = tmp_path_factory.mktemp("findings")
    base, whole = base_parameters(manutec), manutec.free_links()
    phi = np.array([LOAD.get(name, 0.0) for name in manutec.standard_parameters])
    write_run(place / "bare", manutec)
    write_run(place / "loaded", manutec, (manutec, TABLE_3_A + base.matrix @ phi), seed=2)
    K = base_parameters(whole).matrix
    off = OFFSET * K[:, whole.standard_parameters.index("sy4")]
    truth = whole, K @ base.placement @ TABLE_3_A + off
    write_run(place / "offset", manutec, truth, seed=3)
    return place


@pytest.fixture(scope="module")
def diagnosis(runs):
    return diagnose(Run.open(runs / "offset"))


def page_of(path):
    """Return the report of a run with empty plots."""
    with pytest.MonkeyPatch.context() as patched:
        empty_plots(patched)
        return report(Run.open(path)).read_text()


@pytest.fixture
def copies(runs, tmp_path):
    for name in ("bare", "loaded", "offset"):
        shutil.copytree(runs / name, tmp_path / name)
    return tmp_path


@pytest.fixture(scope="module")
def kept(runs):
    """Return the command's record of the load."""
    hil("payload", runs / "bare", runs / "loaded", "--mass", 10.86)
    return load_yaml(runs / "loaded" / "load.yaml", LoadFile)


@pytest.fixture(scope="module")
def page(runs, kept):
    return page_of(runs / "loaded")


@pytest.fixture(scope="module")
def bare_page(runs, kept):
    return page_of(runs / "bare")


class TestLoad:
    def test_it_is_kept_in_the_loaded_runs_folder_with_what_it_was_made_of(self, kept):
        assert kept.without.folder == "../bare"
        assert [each.folder for each in kept.loaded] == ["."]
        assert kept.without.recordings != kept.loaded[0].recordings
        assert {q.name for q in kept.load} >= {"mass", "sz", "centre z", "Ixx", "Izz"}
        assert len(kept.elements_without) == len(kept.elements_loaded) == 36

    def test_the_stated_mass_is_held(self, kept):
        (mass,) = (q for q in kept.load if q.name == "mass")
        assert (mass.value, mass.standard_error) == (kept.mass, 0.0) == (10.86, 0.0)

    def test_the_report_has_table_3_of_the_robot(self, page):
        text = text_of(page)
        table = text[text.index("s Table 3") : text.index("The load, in the last")]
        heads = ["without", "with load", "change", "std. error", "expected"]
        assert f" {' '.join(heads)} z " in table
        assert re.search(r"p13 gravity of axis 5( −?\d+\.\d+){6} -sz6", table)

    def test_its_own_page_shows_it_with_its_torques(self, kept, runs):
        page = (runs / "loaded" / "payload.html").read_text()
        assert re.search(r"<strong>\w+</strong> mass 10.86 kg as stated", page)
        _, torque = page.split('id="plot-torque"')
        torque, _ = torque.split("<figcaption>", 1)
        assert torque.count(">measured<") or torque.count("measured</span>")
        assert [f"axis {k}, " in torque for k in range(1, 7)] == [True] * 6
        assert "gravity of axis 5" in page
        assert "Fit of a rigid load to" in page
        assert 'id="carried"' in page

    def test_its_tables_fit_a_terminal_of_80_columns(self, kept):
        for table in (changes(kept), quantities(kept.load), torque_constants(kept)):
            console = Console(file=io.StringIO(), width=80)
            show(table, console)
            lines = console.file.getvalue().splitlines()
            for row in table.rows:
                pairs = zip(row, table.columns, strict=True)
                cells = [cell for cell, column in pairs if not column.folds]
                assert any(all(cell in line for cell in cells) for line in lines), row

    def test_the_report_shows_load_gains_and_both_runs_in_figs_5_and_6(self, page):
        assert "χ²" in page
        assert "stated as 10.86 kg" in page
        assert 'id="plot-load-gravity"' in page
        assert 'id="plot-load-inertia"' in page

    def test_a_report_of_another_run_has_no_load(self, bare_page):
        assert "The load" not in bare_page

    def noted(self, place, kept):
        """Return table and notes of the loaded run's report, given an estimate."""
        then = SimpleNamespace(values=np.array([each.loaded for each in kept.changes]))
        run = SimpleNamespace(source=Run.open(place / "loaded"), model=then)
        return current(LoadFile, run, "hil payload")

    @pytest.mark.parametrize("changed", ["bare", "loaded"])
    def test_recordings_that_changed_since_make_it_stale(self, kept, copies, changed):
        (copies / changed / "recordings" / "i05.h5").unlink()
        load, note = self.noted(copies, kept)
        assert load is None
        assert "load.yaml is stale and not shown: the recordings of" in note
        assert "Write it anew with: hil payload" in note

    def test_without_the_other_run_it_is_still_shown(self, kept, copies):
        shutil.rmtree(copies / "bare")
        assert self.noted(copies, kept) == (kept, "")

    def test_a_damaged_file_is_told(self, kept, copies):
        (copies / "loaded" / "load.yaml").write_text("format: 9\n")
        assert "load.yaml cannot be used" in self.noted(copies, kept)[1]


class TestDiagnosis:
    def test_what_the_file_leaves_out_is_ranked_first_and_significant(self, diagnosis):
        first = diagnosis.errors.alone[0]
        assert "sy4" in first.names
        assert any("sy4" in each.names for each in diagnosis.errors.found)
        assert first.value == pytest.approx(OFFSET, abs=4 * first.standard_error)

    def test_what_is_not_left_out_is_tested_and_not_found(self, diagnosis):
        tested, found = (
            {name for each in ranked for name in each.names}
            for ranked in (diagnosis.errors.alone, diagnosis.errors.found)
        )
        assert "sy2" in tested - found
        assert "m1" not in tested

    def test_the_phase_is_that_of_the_forearms_first_moments(self, diagnosis):
        """tan(phase) = sy4 / (p13 sin q5): see docs/explanation/absent-parameters.md."""
        phase = diagnosis.phase
        assert (phase.axis, phase.over) == (3, 4)
        found, p13 = diagnosis.errors.found[0].value, diagnosis.errors.p[12]
        expected = np.arctan(found / (-p13 * np.sin(phase.q[4])))
        assert phase.shift == pytest.approx(expected, rel=1e-3)

    def test_measurements_lie_on_the_shifted_sinusoid(self, diagnosis):
        phase = diagnosis.phase
        off = [phase.torque - s.evaluate(phase.angle) for s in (phase.extended, phase.stated)]
        extended, stated = (np.sqrt(np.mean(each**2)) for each in off)
        assert extended < 0.6 * stated

    def test_the_command_keeps_it_and_the_report_shows_it(self, copies, capsys):
        hil("diagnose", copies / "offset")
        assert "shows it" in capsys.readouterr().out
        kept = load_yaml(copies / "offset" / "diagnosis.yaml", DiagnosisFile)
        assert "sy4" in kept.candidates[0].names
        assert abs(kept.phase.shift) == pytest.approx(np.radians(17), abs=np.radians(6))
        names = {path.name for path in (copies / "offset" / "diagnosis").iterdir()}
        assert names == {"gravity.svg", "inertia.svg", "phase.svg"}
        text = text_of(page_of(copies / "offset"))
        _, _, section = text.split("Parameters absent from the robot file", 2)  # after the contents
        assert f"to be added to the robot file: {kept.found[0]}" in section
        assert "ranked by evidence" in section

    def test_one_of_another_estimate_is_stale(self, copies, diagnosis):
        kept = write_diagnosis(Run.open(copies / "offset"), diagnosis)
        path = copies / "offset" / NAME
        path.write_text(path.read_text().replace(repr(kept.p[0]), repr(kept.p[0] + 0.01)))
        text = text_of(page_of(copies / "offset"))
        assert "diagnosis.yaml is stale and not shown: the present estimate" in text

    def test_a_run_that_was_not_diagnosed_has_no_such_section(self, bare_page):
        assert "Parameters absent from" not in bare_page


def test_the_report_states_each_axiss_drive_train(bare_page):
    text = text_of(bare_page)
    section = text[text.index("Drive trains Drives delay") :][:1600]
    figure = r"(?: (−?\d+\.?\d*) (\d+\.?\d*)| not identifiable)"
    rows = re.findall(rf" ([1-6]){figure}{figure}{figure}(?= )", section)
    assert len(rows) == 6
    assert all(abs(float(row[1].replace("−", "-"))) < 1.0 for row in rows)


def test_a_sinusoid_that_leads_has_a_positive_phase():
    late, early = Sinusoid(1.0, 1.0, 0.0), Sinusoid(5.0, np.cos(0.1), -np.sin(0.1))
    assert early.phase_against(late) == pytest.approx(0.1)
    assert early.evaluate(np.array([-0.1]))[0] == pytest.approx(6.0)
