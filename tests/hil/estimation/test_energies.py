"""Negative kinetic energies of axes that only give way are no evidence."""

import numpy as np
from free_run import TRUTH, arm, recorded

from hil.estimation.excluded.alternatives import ROWS, Reading, explained
from hil.estimation.excluded.evidence import measured
from hil.estimation.signals import signals
from hil.estimation.simultaneous import SimultaneousFit


def negative(amplitude: float, inertia: float) -> float:
    """Return the chi square of energies, with axis 2 held like a body of another inertia."""
    robot, data = arm(), recorded(arm(), TRUTH, n=1, noise=0.02)
    prepared = []
    for motion, recording in data:
        t, rates = recording.time, 2 * np.pi * np.array([1.3, 2.9])
        waves = amplitude / 2 * np.sin(np.outer(t, rates))
        recording.q[:, 1] = 0.3 + waves.sum(axis=1)
        recording.tau[:, 1] = -inertia * waves @ rates**2
        prepared.append((motion, signals(recording)))
    evidence = measured(robot, SimultaneousFit(robot, prepared), prepared).thinned(ROWS)[0]
    return explained(robot, evidence.project_out_own(), Reading.stated(robot)).negative


def test_friction_that_holds_an_axis_like_a_spring_is_no_negative_energy() -> None:
    """Before sliding, the torque of an axis falls while the axis gives way."""
    assert negative(amplitude=5e-3, inertia=-80.0) == 0.0
