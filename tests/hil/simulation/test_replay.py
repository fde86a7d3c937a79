"""`hil replay`: simulated response to recorded commands, errors, page and exit status."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from carriage_run import carriage, carriage_run
from real_recordings import DATA, at_hand

import hil
from checked_files.yaml_file import FileError
from hil.commands import replay as command
from hil.errors import InvalidValue
from hil.simulation.replay import INITIAL, Controller, limits, replay

if TYPE_CHECKING:
    from hil.runs.run import Run


@pytest.fixture(scope="module")
def run() -> Run:
    """Recording of the carriage, from its own simulation."""
    return carriage_run()


def test_the_model_that_made_a_recording_simulates_it_and_another_mass_does_not(run: Run) -> None:
    right, wrong = replay(run, carriage()), replay(run, carriage(6.0))
    covered = np.ptp(run[run.ids[0]].recording.q)
    assert right.largest[0] < 0.01 * covered
    assert wrong.largest[0] > 10 * right.largest[0]
    assert len(right.recordings[0].time) == run[run.ids[0]].recording.n_samples - INITIAL


def test_restarts_bound_what_errors_add_up_to(run: Run) -> None:
    free, restarted = (replay(run, carriage(6.0), restart=each) for each in (None, 0.25))
    assert restarted.rms[0] < free.rms[0] / 3


def test_a_controller_follows_the_recorded_positions_whatever_the_torques_were(run: Run) -> None:
    gains = Controller(np.array([2e4]), np.array([400.0]))
    held = replay(run.mapped(lambda each: replace(each.recording, tau=0 * each.recording.tau)),
                  carriage(6.0), controller=gains)  # fmt: skip
    assert held.largest[0] < 2e-3


def test_a_motion_that_leaves_the_recording_ends_and_fails_every_limit(run: Run) -> None:
    pushed = run.mapped(lambda each: replace(each.recording, tau=each.recording.tau + 40.0))
    found = replay(pushed, carriage())
    assert "the simulation diverged from the recording" in found.lost
    assert [found.verdict(each)[:2] for each in ({False: 1e9}, {})] == [
        ("failed", "failed"),
        ("doubtful", "diverged"),
    ]
    assert np.isfinite(found.rms).all()


def test_a_motion_that_is_lost_at_once_has_no_finite_error_and_a_page(run: Run) -> None:
    pushed = run.mapped(lambda each: replace(each.recording, tau=each.recording.tau + 1e9))
    found = replay(pushed, carriage(), restart=0.5)
    assert np.isinf(found.rms).all()
    assert found.verdict({})[:2] == ("doubtful", "diverged")
    assert found.verdict({False: 1e9})[0] == "failed"
    assert "inf mm" in str(found.table())
    assert len(list(command.positions(found))) == 1


def test_a_mujoco_that_reads_no_polynomial_of_damping_is_refused(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pytest.importorskip("mujoco"), "__version__", "3.6.0")
    with pytest.raises(FileError, match=r"version 3\.6\.0 must be at least 3\.7: pip install -U"):
        replay(run, carriage(), simulator="mujoco")


def test_a_model_that_no_bodies_have_is_simulated_by_the_nearest_possible_ones(run: Run) -> None:
    model = carriage(-1.0)
    found = replay(run, model, restart=0.2)
    by_mujoco = replay(run, model, simulator="mujoco", restart=0.2)
    assert "nearest possible bodies" in found.how
    assert "nearest possible bodies" not in by_mujoco.how
    np.testing.assert_allclose(found.rms, by_mujoco.rms, rtol=0.05)


def test_without_a_limit_the_largest_error_is_stated(run: Run) -> None:
    found = replay(run, carriage(6.0))
    kind, _, text = found.verdict({})
    assert (kind, text.startswith("largest error ")) == ("note", True)
    assert text.endswith(f"axis 1, over a range of {1e3 * found.covered[0]:.3g} mm")


def test_limits_have_units_of_revolute_or_of_prismatic_joints() -> None:
    assert limits(["2deg", "5mm"]) == {True: pytest.approx(np.pi / 90), False: 0.005}
    for wrong in ("2", "deg", "-1deg", "0mm", "1e999rad", "1..2m"):
        with pytest.raises(InvalidValue, match="must be a number above 0"):
            limits([wrong])


@at_hand
@pytest.mark.long
@pytest.mark.usefixtures("skip_causes")
def test_emps_is_simulated_from_the_command_and_its_first_samples(tmp_path: Path) -> None:
    from hil.imports.importing import import_recordings

    for name in ("estimation", "pulses"):
        text = Path(f"examples/emps/{name}.yaml").read_text()
        (tmp_path / f"{name}.yaml").write_text(text)
        (tmp_path / f"{name}.csv.gz").write_bytes((DATA / f"emps/{name}.csv.gz").read_bytes())
        import_recordings([tmp_path / f"{name}.yaml"], tmp_path / name)
    model = hil.identify(hil.Run.open(tmp_path / "estimation"))
    found = {each: replay(tmp_path / "pulses", model, friction=each) for each in ("law", "plain")}
    assert 1e3 * found["plain"].rms[0] < 8.8  # mm: published least squares
    assert 1e3 * found["law"].rms[0] < 14.5
