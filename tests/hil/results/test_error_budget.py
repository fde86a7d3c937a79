"""The largest error source is named first, and none is named for pure noise."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from synthetic import TABLE_3_A, Friction, record

from hil.estimation.identify import estimate
from hil.estimation.signals import signals
from hil.model.dynamics import inverse_dynamics
from hil.planning.design.by_counts import design
from hil.results.advice import error_budget

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from hil.estimation.excluded.result import ErrorTerm
    from hil.model.robot import Robot
    from hil.planning.measurement import Measurement
    from hil.runs.recording import Recording

    Recorded = Sequence[tuple[Measurement, Recording]]
    Flaw = Callable[[Robot, Recording], Recording]


@pytest.fixture(scope="module")
def recorded(manutec: Robot) -> Recorded:
    plan = design(manutec, {"gravity": 16, "inertia": 36, "coupling": 3})
    rng = np.random.default_rng(3)
    return [
        (m, record(manutec, m, TABLE_3_A, Friction(), noise=0.001, rng=rng))
        for m in plan.measurements
    ]


def budget(robot: Robot, recorded: Recorded, flaw: Flaw | None = None) -> tuple[ErrorTerm, ...]:
    flawed = recorded if flaw is None else [(m, flaw(robot, r)) for m, r in recorded]
    return error_budget(estimate(robot, flawed))


def loaded(robot: Robot, r: Recording) -> Recording:
    s = signals(r)
    load = np.abs(inverse_dynamics(robot, TABLE_3_A, s.q, s.qd, s.qdd))
    return replace(r, tau=r.tau + 0.1 * load * np.sign(np.round(s.qd, 6)))


def one_sided(robot: Robot, r: Recording) -> Recording:
    """Return a recording with friction whose forward level is 5 % above the backward level."""
    level = np.abs(Friction().torque(np.full(robot.n_joints, 0.1), np.zeros(1)))
    return replace(r, tau=r.tau + 0.05 * level)


def coarse(_robot: Robot, r: Recording) -> Recording:
    step = 2e-4
    return replace(r, q=step * np.floor(r.q / step))


def slow(_robot: Robot, r: Recording) -> Recording:
    each = slice(None, None, 3)
    return replace(
        r, time=r.time[each], q=r.q[each], tau=r.tau[each], flags=r.flags[each],
        stroke=r.stroke[each], partner_stroke=r.partner_stroke[each],
    )  # fmt: skip


@pytest.mark.parametrize(
    ("flaw", "cause", "accounted"),
    [
        (loaded, "friction of the load", True),
        (one_sided, "friction that differs by direction", True),
        (coarse, "coarse encoders", False),
        (slow, "slow SYNC", False),
    ],
)
def test_the_largest_cause_is_named_first(
    manutec: Robot, recorded: Recorded, flaw: Flaw, cause: str, accounted: bool
) -> None:
    first = budget(manutec, recorded, flaw)[0]
    assert (first.cause, first.accounted) == (cause, accounted)
    assert first.share > 0.3
    assert first.remedy


def test_a_motion_that_excites_little_is_the_cause_where_nothing_else_is(
    manutec: Robot, recorded: Recorded
) -> None:
    rng = np.random.default_rng(5)
    short = [
        m if m.kind == "gravity" else m.model_copy(update={"acceleration": m.acceleration / 8})
        for m, _ in recorded
    ]
    some = [(m, record(manutec, m, TABLE_3_A, Friction(), noise=0.02, rng=rng)) for m in short]
    assert [term.cause for term in budget(manutec, some)] == ["weak excitation"]


def test_nothing_is_named_where_all_is_noise(manutec: Robot, recorded: Recorded) -> None:
    assert budget(manutec, recorded) == ()
