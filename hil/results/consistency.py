"""From a model to the nearest robot that consists of bodies, and what that costs in torques."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import NotEnoughData
from hil.estimation.consistent.conditions import BodyBounds
from hil.estimation.consistent.nearest import nearest_robot
from hil.estimation.free_motion.motion import filtered_motion
from hil.estimation.signals import signals
from hil.model.dynamics import regressor
from hil.planning.free_motion import FreeMotion
from hil.results.consistent_robot import BindingCondition, ConsistentRobot, LinkBody, TorqueCost
from hil.results.recorded_torque import processing_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from numpy.typing import NDArray

    from hil.estimation.consistent.nearest import NearestRobot
    from hil.planning.measurement import RecordedMotion
    from hil.results.model import Model
    from hil.runs.recording import Recording

    Array = NDArray[np.float64]
    Recorded = Iterable[tuple[RecordedMotion, Recording]]

SHAPES = "the links' shapes"
MOST_RECORDINGS = 100
SAMPLES = 200
"""Of a recording, at most: torques' root mean squares need no more."""


def with_consistent_robot(
    model: Model,
    recorded: Recorded = (),
    bounds: BodyBounds | None = None,
    likely: Array | None = None,
    likely_from: str = SHAPES,
) -> Model:
    """The model with the nearest robot that consists of bodies.

    Parameters
    ----------
    model : Model
    recorded : iterable of (RecordedMotion, Recording)
        Motions over which torques are compared.
    bounds : BodyBounds, optional
    likely : ndarray, shape (n_joints, 10), optional
        Likely bodies; `likely_from` says where they come from.

    Raises
    ------
    NotRealisable, InvalidValue
        Bounds that no bodies meet.
    """
    bounds = bounds or BodyBounds()
    found = nearest_robot(model.robot, model.values, model.covariance, bounds, likely)
    kept = ConsistentRobot(
        values=tuple(found.p.tolist()),
        change=tuple(found.change.tolist()),
        distance=found.distance,
        degrees_of_freedom=found.degrees_of_freedom,
        p_value=found.p_value,
        distance_complete=found.distance_complete,
        thickness=bounds.thickness,
        masses=dict(bounds.masses),
        likely=likely_from,
        open_masses=found.open_masses,
        links=tuple(
            LinkBody(parameters=tuple(body.tolist()), thickness=float(t))
            for body, t in zip(found.bodies, found.thickness, strict=True)
        ),
        added=dict(zip(model.robot.added_parameters, found.added.tolist(), strict=True)),
        binding=tuple(
            BindingCondition(name=each.name, distance_without=each.distance_without)
            for each in found.binding
        ),
        torque=_torque_costs(model, found, recorded),
    )
    return replace(model, consistent=kept)


def _torque_costs(model: Model, found: NearestRobot, recorded: Recorded) -> tuple[TorqueCost, ...]:
    n, products = 0, 0.0
    for q, qd, qdd in islice(_motions(model, recorded), MOST_RECORDINGS):
        A = regressor(model.robot, q, qd, qdd)
        products = products + np.einsum("nji,njk->jik", A, A, optimize=True)
        n += len(A)
    if not n:
        return ()
    change = found.p - model.values
    squares = np.array(products) / n
    return tuple(
        TorqueCost(
            change=_root(change @ G @ change),
            standard_error=_root(np.sum(G * model.covariance)),
            torque=_root(model.values @ G @ model.values),
        )
        for G in squares
    )


def _motions(model: Model, recorded: Recorded) -> Iterator[tuple[Array, Array, Array]]:
    """Positions, velocities and accelerations of some samples of each recording."""
    for motion, recording in recorded:
        try:
            state, used = _state(model, motion, recording)
        except NotEnoughData:
            continue
        some = np.flatnonzero(used)
        some = some[:: max(1, len(some) // SAMPLES)]
        if len(some):
            yield state[0][some], state[1][some], state[2][some]


def _state(
    model: Model, motion: RecordedMotion, recording: Recording
) -> tuple[tuple[Array, Array, Array], NDArray[np.bool_]]:
    if isinstance(motion, FreeMotion):
        filtered = filtered_motion(recording, processing_of(model))
        state = filtered.q, filtered.qd, filtered.qdd
        return state, np.ones(len(filtered.q), dtype=bool)
    s = signals(recording)
    return (s.smoothed(s.q), s.smoothed(s.qd), s.smoothed(s.qdd)), s.valid


def _root(square: float) -> float:
    return float(np.sqrt(max(float(square), 0.0)))
