"""Presliding friction along a motion never exceeds the law at constant direction."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from hil.friction.direction import Direction
from hil.friction.law import SLOWEST, AxisLaw, FrictionLaw, TermValue, friction_torque
from hil.friction.terms import DIRECTED, OF_SPEED
from hil.model.robot import Robot

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

PERIOD = 0.002
ONE = Robot.load("emps")
"""Single axis."""


def law_of(
    terms: dict[str, float],
    presliding: float,
    speeds: tuple[float, float] | None,
    bend: float = 0.0,
) -> AxisLaw:
    values = {name: TermValue(value=value, standard_error=0.1) for name, value in terms.items()}
    plain = {"viscous": TermValue(value=0.3, standard_error=0.1)}
    return AxisLaw(
        law="stated",
        speed=0.8,
        terms=values,
        plain=plain,
        held_out={},
        presliding=presliding,
        bend=TermValue(value=bend, standard_error=0.1),
        speeds=speeds,
    )


def motion_of(sizes: list[float], turns: list[float]) -> tuple[Array, Array]:
    """Return positions and velocities of a sum of sines, sample by sample."""
    t = PERIOD * np.arange(400)
    both = list(zip(sizes, turns, strict=False))
    q = sum(size * np.sin(2 * np.pi * turn * t) for size, turn in both)
    qd = sum(2 * np.pi * turn * size * np.cos(2 * np.pi * turn * t) for size, turn in both)
    return np.reshape(q, (-1, 1)), np.reshape(qd, (-1, 1))


coefficients = st.floats(-5.0, 5.0)
# |u| follows the speed at once in either direction, so the bounds of the level do not move
laws = st.dictionaries(st.sampled_from(["offset", *DIRECTED]), coefficients, min_size=1).filter(
    lambda terms: any(term in DIRECTED for term in terms)
)


@given(
    terms=laws,
    presliding=st.floats(1e-6, 0.5),
    bend=st.floats(-5.0, 5.0),
    speeds=st.none() | st.just((0.05, 0.6)),
    sizes=st.lists(st.floats(0.01, 0.1), min_size=1, max_size=3),
    turns=st.lists(st.floats(0.3, 5.0), min_size=3, max_size=3),
    load=st.floats(-20.0, 20.0),
)
def test_friction_after_a_reversal_stays_within_the_law_of_either_direction(
    terms: dict[str, float],
    presliding: float,
    bend: float,
    speeds: tuple[float, float] | None,
    sizes: list[float],
    turns: list[float],
    load: float,
) -> None:
    law = FrictionLaw(axes=(law_of(terms, presliding, speeds, bend),))
    q, qd = motion_of(sizes, turns)
    loads = np.full_like(q, load)
    along, t = friction_torque(ONE, law, q, qd, loads), q[:, 0]
    # every sample sliding forward, and sliding backward, at speeds of the law at least
    slowest = speeds[0] if speeds else SLOWEST * law.axes[0].speed
    either = [
        friction_torque(ONE, law, q, side * sliding, loads, [Direction(side + 0.0 * t, 0.0 * t)])
        for side in (-1.0, 1.0)
        for sliding in (np.abs(qd), np.maximum(np.abs(qd), slowest))
    ]
    rounding = 1e-9 * (1.0 + np.abs(either).max())
    # friction has no direction before the motion
    assert (along >= np.min(either, axis=0) - rounding)[1:].all()
    assert (along <= np.max(either, axis=0) + rounding)[1:].all()


def test_sliding_in_one_direction_is_the_law_of_one_state() -> None:
    law = FrictionLaw(axes=(law_of(dict.fromkeys(OF_SPEED, 1.0), 1e-3, None),))
    q, qd = motion_of([0.1], [1.0])
    loads = np.full_like(q, 3.0)
    along = friction_torque(ONE, law, q, qd, loads)
    alone = np.array([friction_torque(ONE, law, *row, loads[0]) for row in zip(q, qd, strict=True)])
    np.testing.assert_allclose(along[60:120], alone[60:120], rtol=1e-9)
