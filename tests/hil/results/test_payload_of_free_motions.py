"""`hil payload` on imported runs: load, unknown gains found by its known mass, and refusals."""

from __future__ import annotations

import re
import shutil
from typing import TYPE_CHECKING

import numpy as np
import pytest
from free_run import write_free_run
from twin_recordings import TwinRecorder, brick, scale_gains

from checked_files.yaml_file import load_yaml
from hil import cli
from hil.commands.diagnose import diagnose
from hil.errors import Mismatch, NoLoad
from hil.model.drive_train_file import USUAL_BOUND
from hil.report.page import report
from hil.results.load_file import LoadFile
from hil.results.problem import regression
from hil.runs.run import Run

if TYPE_CHECKING:
    from pathlib import Path

MASS = 2.805
LOAD = brick(MASS, (0.03, -0.02, 0.05), 0.05)
GAINS = np.array([1.08, 0.93, 1.0, 1.05])
"""True torque of each axis relative to the map."""
NEVER = ("Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "sz")
"""Load parameters never visible in a SCARA, whose last link turns about the vertical alone."""

pytestmark = pytest.mark.usefixtures("skip_causes")


@pytest.fixture(scope="module")
def twin() -> TwinRecorder:
    return TwinRecorder("scara")


@pytest.fixture(scope="module")
def runs(twin: TwinRecorder, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Runs without and with a load, with correct, wrong and unknown gains."""
    place = tmp_path_factory.mktemp("loads")
    bare, loaded = twin.recorded(1, n=2), twin.recorded(2, LOAD, n=2)
    write_free_run(place / "again", twin.robot, twin.recorded(3, n=1))
    units = {axis + 1: float(each) for axis, each in enumerate(GAINS)}
    for name, data in (("bare", bare), ("loaded", loaded)):
        write_free_run(place / name, twin.robot, data)
        wrong = [(motion.model_copy(update={"unknown_gains": None}), recording)
                 for motion, recording in scale_gains(data, units)]  # fmt: skip
        write_free_run(place / f"wrong-{name}", twin.robot, wrong)
        write_free_run(place / f"unknown-{name}", twin.robot, scale_gains(data, {1: 0.1, 2: 0.2}))
    return place


def hil(*arguments: object) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main([str(argument) for argument in arguments])
    assert not ended.value.code


def found_in(runs: Path, kind: str, mass: float | None = None, *, gains: bool = False):
    bare, loaded = (Run.open(runs / f"{kind}{name}") for name in ("bare", "loaded"))
    return regression(bare, loaded=[loaded], mass=mass, gains=gains).fit()


@pytest.fixture(scope="module")
def kept(runs: Path) -> LoadFile:
    """Return the file written by the command."""
    hil("payload", runs / "bare", runs / "loaded")
    return load_yaml(runs / "loaded" / "load.yaml", LoadFile)


def test_load_and_its_intervals_are_found_and_kept(kept: LoadFile) -> None:
    found = {q.name: q for q in kept.load}
    assert list(found) == [
        "mass", "sx", "sy", "centre x", "centre y", "Izz", "Izz about the centre",
    ]  # fmt: skip
    truth = {"mass": MASS, "centre x": 0.03, "centre y": -0.02, "Izz": LOAD.parameters["Izz"]}
    for name, value in truth.items():
        half = found[name].half_width
        assert half is not None
        assert 1.9 * found[name].standard_error < half < 3.5 * found[name].standard_error
        assert abs(found[name].value - value) < 2 * half
    assert found["mass"].standard_error < 0.02 * MASS
    assert kept.p_value > 0.01
    assert kept.imported


def test_what_no_motion_of_this_robot_shows_is_named(kept: LoadFile) -> None:
    assert set(kept.unidentifiable) == set(NEVER)
    assert kept.unseen == ()


def test_the_report_of_the_loaded_run_shows_the_load(runs: Path, kept: LoadFile) -> None:
    text = re.sub(
        r"\s+", " ", re.sub(r"<[^>]+>", " ", report(Run.open(runs / "loaded")).read_text())
    )
    section = text[text.index("The load From two runs") :][:4000]
    assert "from both runs at once" in section
    assert all(name in section for name in kept.unidentifiable)
    assert "in kg m² and kg" in section or "kg m², kg" in section


def test_wrong_gains_are_found_by_the_mass_and_the_load_with_them(runs: Path) -> None:
    found = found_in(runs, "wrong-", MASS, gains=True)
    assert found.by_mass is not None
    gains, error = found.by_mass.gains, found.by_mass.gain_errors
    known = error < USUAL_BOUND
    assert known[[0, 1, 3]].all()
    z = (gains / GAINS - 1.0) / error
    assert np.abs(z[known]).max() < 4
    assert error[[0, 1, 3]].max() < 0.03
    by_name = {q.name: q for q in found.load.quantities()}
    assert (by_name["mass"].value, by_name["mass"].standard_error) == (MASS, 0.0)
    assert by_name["centre x"].value == pytest.approx(0.03, abs=2 * by_name["centre x"].half_width)


def test_a_mass_that_contradicts_the_runs_is_refused_with_the_gains_that_would_explain_it(
    runs: Path,
) -> None:
    with pytest.raises(Mismatch) as refused:
        found_in(runs, "", 1.5 * MASS)
    message = str(refused.value)
    assert re.search(r"a mass of 4\.2075 kg contradicts 2\.\d+ ± 0\.0\d+ kg by these runs", message)
    assert re.search(r"gains .*1\.\d+ times as large on axis 2", message)
    assert "--gains" in message


def test_unknown_gains_of_both_runs_are_found_with_the_load(runs: Path) -> None:
    found = found_in(runs, "unknown-").load
    (mass,) = (q for q in found.quantities() if q.name == "mass")
    assert mass.value == pytest.approx(MASS, abs=2 * mass.half_width)
    assert mass.standard_error < 0.05 * MASS
    with_gains = found_in(runs, "unknown-", MASS, gains=True)
    assert with_gains.by_mass is not None
    assert with_gains.by_mass.gains[:2] == pytest.approx([0.1, 0.2], rel=0.05)
    assert np.isnan(with_gains.assumed).tolist() == [True, True, False, False]


@pytest.mark.parametrize(("second", "error", "words"), [
    ("bare", Mismatch, "has the same recordings as"),
    ("again", NoLoad, r"load not significant: its mass would be"),
    ("unknown-loaded", Mismatch, "axes of unknown gain differ"),
])  # fmt: skip
def test_what_is_no_pair_of_runs_is_refused(
    runs: Path, second: str, error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        regression(Run.open(runs / "bare"), loaded=[Run.open(runs / second)]).fit()


def test_a_fit_has_all_by_name_and_further_runs_make_it_surer(runs: Path, kept: LoadFile) -> None:
    bare, again, loaded = (Run.open(runs / name) for name in ("bare", "again", "loaded"))
    alone = regression(bare, loaded=[loaded]).fit()
    as_kept = {each.name: each.value for each in kept.load}
    assert {name: alone.params[name] for name in as_kept} == as_kept
    low, high = alone.conf_int()["mass"]
    assert (high - low) / 2 == pytest.approx(kept.load[0].half_width)
    wider = alone.conf_int(0.01)["mass"]
    assert wider[0] < low < high < wider[1]
    assert set(alone.names) == set(alone.bse) >= {"p1", "sx", "Izz", "centre y"}
    assert "centre x" in str(alone.summary())
    more = regression(bare, again, loaded=[loaded]).fit()
    assert more.bse["p1"] < alone.bse["p1"]
    low, high = more.conf_int(0.001)["mass"]
    assert low < MASS < high
    plain = regression(bare, loaded=[loaded], covariance="white").fit()
    assert plain.params == alone.params
    assert plain.bse != alone.bse


def test_a_copy_of_the_same_run_is_the_same_run(runs: Path, tmp_path: Path) -> None:
    shutil.copytree(runs / "bare", tmp_path / "copy")
    with pytest.raises(Mismatch, match="has the same recordings"):
        regression(Run.open(runs / "bare"), loaded=[Run.open(tmp_path / "copy")]).fit()


def test_a_diagnosis_of_an_imported_run_is_refused_with_the_way_to_test_a_parameter(
    runs: Path,
) -> None:
    with pytest.raises(Mismatch, match="add it to the robot file"):
        diagnose(Run.open(runs / "bare"))


def test_gains_take_a_mass(runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main(["payload", str(runs / "bare"), str(runs / "loaded"), "--gains"])
    assert ended.value.code
    assert "needs --mass" in capsys.readouterr().err
