"""Predicted torques on a page include all torques of the drives, with friction."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from small_run import identified_model, write_run
from stated_model import stated_model

from hil.friction.law import FrictionLaw
from hil.runs.run import Run
from hil.view.along_motion import predicted
from hil.view.scene import run_scene

if TYPE_CHECKING:
    from pathlib import Path

    from hil.model.robot import Robot
    from hil.results.model import Model
    from hil.view.along_motion import Predicted

MOST = 100_000
"""Number of instants; with fewer, accelerations are too coarse to judge torques."""


@pytest.mark.long
def test_a_model_of_strokes_is_drawn_with_its_friction(manutec: Robot, tmp_path: Path) -> None:
    write_run(tmp_path / "run", manutec)
    run = Run.open(tmp_path / "run")
    scene = run_scene(run, MOST, identified_model())
    assert scene.measured is not None
    assert scene.predicted is not None
    assert scene.predicted.words == "predicted"
    time = np.linspace(0.0, scene.segments[-1].end, MOST)
    for axis in range(6):
        drawn, torque, qd = (
            np.interp(time, tracks[axis].time, tracks[axis].value)
            for tracks in (scene.predicted.tracks, scene.measured.torque, scene.measured.velocity)
        )
        moves = np.abs(qd) > 0.2 * np.abs(qd).max()
        # predictions are 24 ms apart, and begin and end with the motion
        assert np.isfinite(drawn[moves]).mean() > 0.95
        left = np.nanmedian(np.abs(drawn - torque)[moves])
        assert left < 0.06 * np.median(np.abs(torque)[moves])


def turning(model: Model) -> Predicted:
    rows, n = 10, model.robot.n_joints
    q, qd = np.full((rows, n), 0.3), np.full((rows, n), 0.5)
    return predicted(model, np.arange(rows) / 10, q, qd, 0 * qd)


@pytest.mark.parametrize(
    ("known", "words"),
    [
        (0, "predicted, without friction"),
        (5, "predicted, without friction of axis 6"),
        (6, "predicted"),
    ],
)
def test_it_says_whose_friction_it_lacks(manutec: Robot, known: int, words: str) -> None:
    model = stated_model(manutec)
    axes = (*model.friction_law.axes[:known], *[None] * (6 - known))
    assert turning(replace(model, friction_law=FrictionLaw(axes=axes))).words == words
    bare = replace(model, friction_law=FrictionLaw.absent(6))
    assert turning(bare).words == "predicted, without friction"
