"""A load or a setting that changes during the recordings is named with its time."""

import numpy as np
import pytest
from free_run import TRUTH, arm, recorded, write_free_run

import hil
from hil.model.dynamics import inverse_dynamics

LOAD = np.array([0.6, 0.8, 0.0, 0.5, 0.9, 0.0])
"""Base parameters of a load at the end of the second link."""


@pytest.mark.parametrize("what", ["load", "gain"])
def test_a_change_is_named_with_its_time(tmp_path, what):
    robot, data = arm(), recorded(arm(), TRUTH, n=2, duration=60.0)
    _, second = data[1]
    later = second.time > 30.0
    qd = np.gradient(second.q, second.time, axis=0)
    motion = second.q, qd, np.gradient(qd, second.time, axis=0)
    if what == "load":
        second.tau[later] += inverse_dynamics(robot, LOAD, *motion)[later]
    else:
        second.tau[later, 0] *= 0.7
    model = hil.identify(write_free_run(tmp_path / "run", robot, data))
    change = model.details.change
    assert change is not None
    assert change.after == pytest.approx(90.0, abs=6.0)
    assert model.verdict.word != "good"
    assert model.verdict.reason.startswith("the recordings change after some ")


def test_motions_that_differ_are_no_change(tmp_path):
    model = hil.identify(write_free_run(tmp_path / "run", arm(), recorded(arm(), TRUTH)))
    assert model.details.change is None
