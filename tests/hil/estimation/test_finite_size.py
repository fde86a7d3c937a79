"""Readings changed by a cause are those of recordings with this cause."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from free_run import TRUTH, arm, recorded

from hil.estimation.excluded.columns import Column
from hil.estimation.excluded.evidence import measured
from hil.estimation.excluded.finite_size import misread
from hil.estimation.excluded.proof import changed
from hil.estimation.signals import signals
from hil.estimation.simultaneous import SimultaneousFit
from hil.model.robot import parse_robot

if TYPE_CHECKING:
    from free_run import FreeRecorded

    from hil.estimation.excluded.evidence import Evidence

AXIS = 1
"""Axis with the cause, from 0."""


def planted(data: FreeRecorded, cause: str, size: float) -> FreeRecorded:
    """Return recordings with a cause of a size."""
    found = []
    for k, (motion, recording) in enumerate(data):
        q, tau, time = recording.q.copy(), recording.tau.copy(), recording.time
        share = 1.0 + size / 100.0
        if cause == "joint offset":
            q[:, AXIS] -= np.radians(size)
        elif cause == "slip":  # between the first recording and the others
            q[:, AXIS] -= np.radians(size) * (k > 0)
        elif cause == "position scale":
            q[:, AXIS] /= share
        elif cause == "gear ratio":
            q[:, AXIS] *= share
            tau[:, AXIS] /= share
        else:
            late = q if cause == "position delay" else tau
            late[:, AXIS] = np.interp(time - 1e-3 * size, time, late[:, AXIS])
        found.append((motion, replace(recording, q=q, tau=tau)))
    return found


def evidence(data: FreeRecorded) -> Evidence:
    """Return rows of the recordings."""
    robot, prepared = arm(), [(motion, signals(recording)) for motion, recording in data]
    return measured(robot, SimultaneousFit(robot, prepared), prepared)


@pytest.mark.parametrize(
    ("cause", "size"),
    [("joint offset", 20.0), ("slip", 20.0), ("position scale", -15.0), ("gear ratio", 10.0),
     ("position delay", 60.0), ("torque delay", 60.0)],
)  # fmt: skip
def test_changed_readings_are_those_of_recordings_with_the_cause(cause: str, size: float) -> None:
    one_after_the_other = enumerate(recorded(arm(), TRUTH, n=2, duration=10.0, noise=0.01))
    data = [(motion, replace(r, time=r.time + 20.0 * k)) for k, (motion, r) in one_after_the_other]
    stated, wanted = evidence(data), evidence(planted(data, cause, size))
    part = str(stated.time[stated.source == 1].min()) if cause == "slip" else ""
    read = misread(arm(), stated, Column(cause, AXIS, part), size)
    # ends of the recordings are held where a signal is late
    places = [
        np.where((each.sample > 100) & (each.sample < 2400),
                 1e6 * each.axis + 1e5 * each.source + each.sample, -1.0)
        for each in (wanted, stated)
    ]  # fmt: skip
    shared, here, there = np.intersect1d(*places, return_indices=True)
    here, there = here[shared >= 0.0], there[shared >= 0.0]
    assert len(here) > len(stated.axis) / 2
    for name in ("X", "torque", "recorded", "motion"):
        wide = (lambda x: np.moveaxis(x, 2, 0)) if name == "motion" else np.asarray
        values, before = wide(getattr(read, name))[there], wide(getattr(stated, name))[there]
        others = wide(getattr(wanted, name))[here]
        assert np.abs(values - others).max() < 0.05 * np.abs(others - before).max() + 1e-9


@pytest.mark.parametrize(("noise", "stated"), [(10.0, True), (60.0, False)])
def test_a_size_is_stated_only_if_the_readings_that_it_makes_show_it(
    noise: float, *, stated: bool
) -> None:
    robot = parse_robot(arm().text.replace("  - sy\n", ""), "arm.yaml")
    p = TRUTH[[0, 1, 3, 4]]
    before = recorded(robot, p, n=3, duration=12.0, noise=noise, seed=200)
    after = recorded(robot, p, n=2, duration=12.0, noise=noise, seed=250)
    limits = changed(robot, before, after).limits
    (limit,) = (each for each in limits if (each.cause, each.axis) == ("joint offset", AXIS + 1))
    assert (limit.size is not None) == stated
    for size in () if limit.size is None else (limit.size, -limit.size):
        found = changed(robot, before, planted(after, "joint offset", size)).found
        assert any(
            (each.cause, each.axes) == ("joint offset", (AXIS + 1,))
            or any(f"axis {AXIS + 1}: " in other for other in each.others)
            for each in found
        )
