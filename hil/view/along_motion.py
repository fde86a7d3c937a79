"""Motion over time: recordings, predicted torques, distances from boxes.

The clock of the page is not that of the run: pauses, repetitions and time between sessions are left
out, and the unrecorded travels between recordings last as long as in the dry run and are drawn
straight.

Distances use the capsules of the safety check. The check also bounds distances between the instants
(`hil.planning.workspace`); distances here are those at the instants.

Of recordings with measured and predicted torques the most demanding ones are drawn, not those where
the model looks best.
"""

from __future__ import annotations

import warnings
from collections import defaultdict
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.errors import FrictionUnknown, Mismatch, NotEnoughData
from hil.friction.equation import SLOW
from hil.least_squares.solving import inverse
from hil.planning.free_motion import FreeMotion
from hil.planning.timetable import SETTLING, travel_time
from hil.planning.workspace import intrusions
from hil.results.recorded_torque import convert_torques, predict_whole
from hil.runs.set_points import set_points
from hil.view.packed import (
    INSTANT,
    Segment,
    Track,
    describe_motion,
    simplify_columns,
    simplify_with_gaps,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from hil.arrays import Array
    from hil.model.robot import Robot
    from hil.planning.measurement import RecordedMotion
    from hil.planning.workspace import Workspace
    from hil.results.model import Model
    from hil.results.recorded_torque import PredictedTorque
    from hil.runs.recording import Recording


LONGEST = 20.0
"""Maximum time drawn of a recording [s], so that reversals are distinguishable on a screen."""
DEMANDING = 0.5
"""Minimum torque scatter of a recording for an axis, as share of the maximum."""


def stretches(
    model: Model, recorded: Iterable[tuple[RecordedMotion, Recording]]
) -> dict[tuple[str, int], PredictedTorque]:
    """Predict the torques of moved axes in recordings, by recording and axis (from 0).

    Times are since the start of the recording. The prediction is NaN while the axis hardly moves;
    without a friction law for the axis, friction is fitted. Recordings too short for a low-pass, or
    with unknown gains, are skipped.
    """
    found = {}
    for motion, recording in recorded:
        with suppress(NotEnoughData, Mismatch):
            whole = predict_whole(
                model, convert_torques(model, motion, recording), motion.id, motion.moved
            )
            whole = replace(whole, time=whole.time - recording.time[0])
            for axis in motion.moved:
                found[motion.id, axis] = _select_moving(model, whole.select_axis(axis))
    return found


def _select_moving(model: Model, found: PredictedTorque) -> PredictedTorque:
    """Return one axis's prediction during motion, with fitted friction if the model has none."""
    axis, speed, predicted = found.axis, found.qd, found.predicted
    moves = np.abs(speed) > SLOW * max(float(np.abs(speed).max(initial=0.0)), 1e-300)
    own = axis + 1 not in model.axes_without_friction
    if not own:
        columns = np.column_stack([np.ones(len(speed)), np.sign(speed), speed])[moves]
        left = (found.measured - predicted)[moves]
        predicted = predicted.copy()
        predicted[moves] += columns @ np.linalg.lstsq(columns, left, rcond=None)[0]
    error = found.standard_error
    if np.isnan(model.residual[axis]) and moves.any():  # the model states no scatter of its own
        error = np.hypot(error, np.sqrt(np.mean((found.measured - predicted)[moves] ** 2)))
    predicted = np.where(moves, predicted, np.nan)
    return replace(found, predicted=predicted, standard_error=error, own_friction=own)


def carriers(
    found: Mapping[tuple[str, int], PredictedTorque], names: Sequence[str], most: int = 10
) -> dict[str, list[tuple[str, float]]]:
    """Find the recordings with the largest contributions to every base parameter.

    With the covariance C = N^-1 of the information N = sum N_r the shares (C N_r C)_kk / C_kk of
    recordings r in the certainty of parameter k add up to one.
    """
    shares: dict[str, Array] = defaultdict(lambda: np.zeros((len(names), len(names))))
    for (recording, _), each in found.items():
        if each.information is not None:
            shares[recording] += each.information
    if not shares:
        return {}
    covariance = inverse(np.sum(list(shares.values()), axis=0))
    whole = np.maximum(np.diag(covariance), np.finfo(float).tiny)
    parts = np.array([np.diag(covariance @ N @ covariance) / whole for N in shares.values()])
    recordings = list(shares)
    return {
        name: [(recordings[r], float(parts[r, k])) for r in np.argsort(-parts[:, k])[:most]]
        for k, name in enumerate(names)
    }


def most_demanding(found: Mapping[tuple[str, int], PredictedTorque]) -> list[PredictedTorque]:
    """Select a stretch per axis with large torque scatter, from as few recordings as possible.

    A stretch lasts at most `LONGEST`.
    """
    scatter = {key: float(np.std(each.measured)) for key, each in found.items()}
    left = {axis: max(s for (_, a), s in scatter.items() if a == axis) for _, axis in found}
    chosen: dict[int, PredictedTorque] = {}
    while left:
        shown: dict[str, dict[int, float]] = defaultdict(dict)
        for (name, axis), size in scatter.items():
            if axis in left and size >= DEMANDING * left[axis]:
                shown[name][axis] = size / left[axis] if left[axis] > 0 else 1.0
        name = max(shown, key=lambda each: (len(shown[each]), sum(shown[each].values())))
        own = [found[name, axis] for axis in shown[name]]
        # the interval with the largest scatter of the torques in total
        first, last = min(each.time[0] for each in own), max(each.time[-1] for each in own)
        begins = np.arange(first, max(last - LONGEST, first) + 1e-9, LONGEST / 4)
        totals = [
            sum(
                float(np.std(each.measured[within]) / max(np.std(each.measured), 1e-300))
                for each in own
                if (within := (begin <= each.time) & (each.time <= begin + LONGEST)).any()
            )
            for begin in begins
        ]
        begin = float(begins[int(np.argmax(totals))])
        chosen |= {each.axis: each.part(begin, begin + LONGEST, 700) for each in own}
        left = {axis: size for axis, size in left.items() if axis not in chosen}
    return [chosen[axis] for axis in sorted(chosen)]


class Predicted(NamedTuple):
    """Predicted joint torques, description, and half-widths of 95 % intervals."""

    tracks: tuple[Track, ...]
    words: str
    band: tuple[Track, ...] | None = None


class MeasuredTracks(NamedTuple):
    """Tracks of recordings, by joint."""

    segments: tuple[Segment, ...]
    position: tuple[Track, ...]
    velocity: tuple[Track, ...]
    torque: tuple[Track, ...]
    set_point: tuple[Track, ...] | None
    predicted: Predicted | None


class Shown(NamedTuple):
    """Displayed recording with predicted torques by axis from 0."""

    motion: RecordedMotion
    recording: Recording
    predicted: Mapping[int, PredictedTorque]


def join_predictions(
    recorded: Iterable[tuple[RecordedMotion, Recording]],
    found: Mapping[tuple[str, int], PredictedTorque],
) -> Iterator[Shown]:
    """Combine recordings with predicted torques."""
    of: defaultdict[str, dict[int, PredictedTorque]] = defaultdict(dict)
    for (name, axis), each in found.items():
        of[name][axis] = each
    for motion, recording in recorded:
        yield Shown(motion, recording, of[motion.id])


def concatenate_recordings(robot: Robot, shown: Sequence[Shown], most: int) -> MeasuredTracks:
    """Concatenate recordings, with about `most` instants in total."""
    segments: list[Segment] = []
    pieces: list[tuple[Array, ...]] = []
    samples = sum(each.recording.n_samples for each in shown)
    every = max(1, -(-samples // most))  # interval between displayed samples
    for each in shown:
        begin, motion = segments[-1].end if segments else 0.0, each.motion
        if pieces:
            took = 1.0  # the start of a motion recorded elsewhere is unknown
            if not isinstance(motion, FreeMotion):
                place = pieces[-1][1][-1]
                start = np.where(np.isfinite(place), place, motion.start).tolist()
                took = travel_time(robot, start, motion.start, 1.0) + SETTLING
            end = begin + took
            segments.append(Segment("travel", f"travel to {motion.id}, not recorded", begin, end))
            begin = end
        pieces.append(_piece(each, begin, every))
        end = float(pieces[-1][0][-1])
        axes = motion.read or motion.moved
        about = describe_motion(motion)
        segments.append(Segment(motion.kind, about, begin, end, axes, recorded=True, id=motion.id))
    time, q, qd, tau, planned, torque, half = map(np.concatenate, zip(*pieces, strict=True))
    angle = 2e-5  # tolerance of a drawn position [rad or m]
    known = bool(np.isfinite(planned).all())
    holed = partial(simplify_columns, time, by=simplify_with_gaps)
    fitted = {
        axis + 1
        for each in shown
        for axis, stretch in each.predicted.items()
        if not stretch.own_friction
    }
    axes_fitted = ", ".join(map(str, sorted(fitted)))
    words = f"predicted, with friction of axis {axes_fitted} fitted" if fitted else "predicted"
    return MeasuredTracks(
        tuple(segments),
        simplify_columns(time, q, angle),
        simplify_columns(time, qd),
        simplify_columns(time, tau),
        simplify_columns(time, planned, angle) if known else None,
        Predicted(holed(torque), words, holed(half)) if np.isfinite(torque).any() else None,
    )


def _piece(shown: Shown, begin: float, every: int) -> tuple[Array, ...]:
    """Return the thinned samples of a recording: time on the page's clock, arrays (n, n_joints).

    The arrays are positions, velocities, torques, set-points, predicted torques and half-widths of
    their intervals, NaN without set-points or prediction.
    """
    motion, recording, predicted = shown
    time, kept = recording.time - recording.time[0], slice(None, None, every)
    planned = set_points(motion, recording)
    planned = np.full_like(recording.q, np.nan) if planned is None else planned
    # compute means of every successive rows, ignoring missing values
    there = np.isfinite(recording.tau)
    starts = np.arange(0, len(recording.tau), every)
    sums = np.add.reduceat(np.where(there, recording.tau, 0.0), starts)
    counts = np.add.reduceat(there.astype(float), starts)
    torque = np.divide(sums, counts, out=np.full_like(sums, np.nan), where=counts > 0)
    if recording.qd is not None:
        velocity = recording.qd[kept]
    else:  # a central difference of positions over some samples
        n = len(time)
        reach, at = min(4, max((n - 1) // 2, 0)), np.arange(0, n, every)
        velocity = np.zeros_like(recording.q[at])
        if reach:
            low, high = np.maximum(at - reach, 0), np.minimum(at + reach, n - 1)
            velocity = (recording.q[high] - recording.q[low]) / (time[high] - time[low])[:, None]
    time = time[kept]
    prediction, half = np.full_like(torque, np.nan), np.full_like(torque, np.nan)
    for axis, each in predicted.items():
        low_passed, prediction[:, axis], half[:, axis] = (
            np.interp(time, each.time, values, np.nan, np.nan)
            for values in (each.measured, each.predicted, each.half)
        )
        torque[:, axis] = np.where(np.isfinite(low_passed), low_passed, torque[:, axis])
    return begin + time, recording.q[kept], velocity, torque, planned[kept], prediction, half


def predicted(model: Model, time: Array, q: Array, qd: Array, qdd: Array) -> Predicted:
    """Predict the torques at instants (n,) of a motion (n, n_joints)."""
    parts = _parts(len(time))
    lack, n = model.axes_without_friction, model.robot.n_joints
    if len(lack) == n:
        torque = [model.predict(q[p], qd[p], qdd[p], ("rigid bodies", "motors")) for p in parts]
    else:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FrictionUnknown)  # stated in the returned words
            torque = [model.drive_torque(q[p], qd[p], qdd[p]) for p in parts]
    of = "" if len(lack) == n else f" of axis {', '.join(map(str, lack))}"
    words = f"predicted, without friction{of}" if lack else "predicted"
    return Predicted(simplify_columns(time, np.concatenate(torque)), words)


@dataclass(frozen=True, slots=True, eq=False)
class Distances:
    """Smallest distance between capsules and boxes.

    Attributes
    ----------
    track : Track
        Distance [m], negative for a capsule that reaches into a box.
    link, box : array (n,)
        Nearest link and box, from 0.
    """

    track: Track
    link: NDArray[np.intp]
    box: NDArray[np.intp]

    def data(self) -> dict[str, object]:
        """Convert to the page's data, rounded to a tenth of a millimetre."""
        numbers = {"link": self.link.tolist(), "box": self.box.tolist()}
        return self.track.data(1e-4) | numbers

    @property
    def least(self) -> int:
        """Index of the instant of smallest distance."""
        return int(self.track.value.argmin())


def distances(robot: Robot, workspace: Workspace | None, time: Array, q: Array) -> Distances | None:
    """Compute distances at configurations q (n, n_joints); None without boxes or checked links.

    Parameters
    ----------
    time : array (n,)
        Instants [s].
    """
    if workspace is None or not workspace.boxes:
        return None
    parts = []
    for part in _parts(len(q)):
        free = workspace.margin - intrusions(robot, workspace, q[part])
        free = free.reshape(len(free), -1)
        own = free.argmin(axis=1)
        parts.append((free[np.arange(len(free)), own], own))
    distance, nearest = (np.concatenate(each) for each in zip(*parts, strict=True))
    if not np.isfinite(distance).all():
        return None
    link, box = np.divmod(nearest, len(workspace.boxes))
    return Distances(Track(time, distance), link, box)


def smallest(found: Distances, workspace: Workspace) -> str:
    """Describe the smallest distance: link, box and time."""
    at, depth = found.least, found.track.value[found.least]
    name = workspace.boxes[int(found.box[at])].name
    where = f"link {found.link[at] + 1}, {round(found.track.time[at] / INSTANT) * INSTANT:.1f} s"
    if depth < 0:
        return f"a link reaches {-depth:.3f} m into {name} ({where} after the start)"
    return f"smallest distance to a box: {depth:.3f} m to {name} ({where} after the start)"


def _parts(n: int, most: int = 4096) -> list[slice]:
    return [slice(begin, begin + most) for begin in range(0, n, most)]
