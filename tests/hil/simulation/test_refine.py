"""Output error: lanes beside the exact simulator, sensitivities, and models that fit a motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from carriage_run import carriage, carriage_run
from possible_models import model_of, possible

import hil
from hil.errors import NotEnoughData
from hil.simulation import refine as module
from hil.simulation.arm import Arm, Drive
from hil.simulation.lanes import Lanes, Piece, simulate
from hil.simulation.refine import refine

ARM = Path("tests/robots/ur10e.yaml")


def swung(seconds: float = 0.6) -> tuple[hil.Model, Piece]:
    """An arm swung about by torques above and below its friction, and its exact motion."""
    robot = hil.Robot.load(ARM)
    p, error = possible(robot)
    model, none = model_of(robot, p, 0.05 * error), np.zeros(6)
    time = np.arange(0.0, seconds, 0.004)
    torque = model.gravity(none) + 12.0 * np.sin(9.0 * time[:, None] + np.arange(6))
    drive = Drive(time, torque, 0.0 * torque, none, none)
    q = Arm(model).run(none, none, time, drive, lambda *_: False)
    return model, Piece(none, none, time, q, drive)


def test_lanes_move_as_the_exact_simulator_and_do_not_disturb_one_another() -> None:
    model, piece = swung()
    short = piece._replace(time=piece.time[:50], recorded=piece.recorded[:50])
    lanes = Lanes.create([piece, short], Arm(model))
    motion = simulate(Arm(model), lanes)
    error = motion.q[1:] - lanes.recorded
    moved = np.ptp(piece.recorded, axis=0)
    assert (np.abs(error[:, 0]).max(axis=0) < 0.01 * moved).all()
    np.testing.assert_array_equal(error[:49, 1], error[:49, 0])
    assert np.isnan(error[49:, 1]).all()


def test_sensitivities_are_those_of_differences_of_the_simulation_through_stops() -> None:
    model, piece = swung()
    unknowns = module._Unknowns.create(model)
    fit = module._Fit(unknowns, [piece], np.ones(6))
    slope = fit.slope(unknowns.start)
    for k in range(0, len(unknowns.start), 5):
        way = np.zeros(len(unknowns.start))
        way[k] = 0.02 * unknowns.errors[k]
        ends = [fit.error(unknowns.start + side * way) for side in (1.0, -1.0)]
        expected = (ends[0] - ends[1]) / (2 * way[k])
        assert np.linalg.norm(slope[..., k] - expected) < 0.02 * np.linalg.norm(expected)


def test_a_wrong_mass_and_friction_move_to_those_that_made_the_recording() -> None:
    start = carriage(5.5)
    found = refine([carriage_run()], start)
    assert found.refined is not None
    assert found.refined.kept
    assert found.refined.after[0] < found.refined.before[0] / 2
    assert found.values[0] == pytest.approx(5.0, rel=0.02)
    coulomb = found.friction_law.axes[0].terms["Coulomb"]
    assert coulomb.value == pytest.approx(4.0, rel=0.03)
    assert 0.0 < coulomb.standard_error < 0.1


def test_parameters_that_simulate_held_out_pieces_worse_are_refused_and_the_start_is_kept(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(module._Fit, "solve", lambda fit, _: 1.2 * fit._unknowns.start)
    start = carriage()
    found = refine([carriage_run()], start)
    np.testing.assert_array_equal(found.values, start.values)
    assert found.refined is not None
    assert not found.refined.kept
    found.save(tmp_path / "model.yaml")
    again = hil.Model.load(tmp_path / "model.yaml")
    assert again.refined == found.refined
    assert "NOT refined by simulation, start kept" in str(again.refined)


def test_a_start_that_leaves_the_recording_at_once_is_refused() -> None:
    with pytest.raises(NotEnoughData, match="the simulation leaves the recordings within"):
        refine([carriage_run()], carriage(0.1))
