"""Motion over time: recordings, predicted torques, distances from boxes.

The clock of the page is not that of the run: pauses, repetitions and time between sessions are left
out, and the unrecorded travels between recordings last as long as in the dry run and are drawn
straight.

Distances use the capsules of the safety check. The check also bounds distances between the instants
(`hil.planning.clearance`); distances here are those at the instants.
"""

from __future__ import annotations

import warnings
from collections import defaultdict
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.errors import FrictionUnknown
from hil.planning.clearance import intrusions
from hil.planning.free_motion import FreeMotion
from hil.planning.timetable import SETTLING, travel_time
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
            end = begin + _way(robot, motion, pieces[-1][1][-1])
            segments.append(Segment("travel", f"travel to {motion.id}, not recorded", begin, end))
            begin = end
        pieces.append(_piece(each, begin, every))
        words, end = describe_motion(motion), float(pieces[-1][0][-1])
        axes = motion.read or motion.moved
        segments.append(Segment(motion.kind, words, begin, end, axes, recorded=True, id=motion.id))
    time, q, qd, tau, planned, torque, half = map(np.concatenate, zip(*pieces, strict=True))
    angle = 2e-5  # tolerance of a drawn position [rad or m]
    known = bool(np.isfinite(planned).all())
    holed = partial(simplify_columns, time, by=simplify_with_gaps)
    return MeasuredTracks(
        tuple(segments),
        simplify_columns(time, q, angle),
        simplify_columns(time, qd),
        simplify_columns(time, tau),
        simplify_columns(time, planned, angle) if known else None,
        Predicted(holed(torque), _words(shown), holed(half)) if np.isfinite(torque).any() else None,
    )


def _words(shown: Sequence[Shown]) -> str:
    fitted = {
        axis + 1
        for each in shown
        for axis, stretch in each.predicted.items()
        if not stretch.own_friction
    }
    axes = ", ".join(map(str, sorted(fitted)))
    return f"predicted, with friction of axis {axes} fitted" if axes else "predicted"


def _way(robot: Robot, motion: RecordedMotion, place: Array) -> float:
    """Compute the travel time from `place` to the start of a motion [s]; 1 s if unknown."""
    if isinstance(motion, FreeMotion):
        return 1.0
    start = np.where(np.isfinite(place), place, motion.start).tolist()
    return travel_time(robot, start, motion.start, 1.0) + SETTLING


def _piece(shown: Shown, begin: float, every: int) -> tuple[Array, ...]:
    """Return the thinned samples of a recording: time on the page's clock, arrays (n, n_joints).

    The arrays are positions, velocities, torques, set-points, predicted torques and half-widths of
    their intervals, NaN without set-points or prediction.
    """
    motion, recording, predicted = shown
    time, kept = recording.time - recording.time[0], slice(None, None, every)
    planned = set_points(motion, recording)
    planned = np.full_like(recording.q, np.nan) if planned is None else planned
    velocity, torque = _velocity(recording, time)[kept], _means(recording.tau, every)
    time = time[kept]
    join_predictions, half = np.full_like(torque, np.nan), np.full_like(torque, np.nan)
    for axis, each in predicted.items():
        low_passed, join_predictions[:, axis], half[:, axis] = (
            np.interp(time, each.time, values, np.nan, np.nan)
            for values in (each.measured, each.predicted, each.half)
        )
        torque[:, axis] = np.where(np.isfinite(low_passed), low_passed, torque[:, axis])
    return begin + time, recording.q[kept], velocity, torque, planned[kept], join_predictions, half


def _velocity(recording: Recording, time: Array) -> Array:
    """Return the recorded velocity, or a central difference of positions over some samples."""
    if recording.qd is not None:
        return recording.qd
    n = len(time)
    reach = min(4, max((n - 1) // 2, 0))
    if not reach:
        return np.zeros_like(recording.q)
    low, high = np.maximum(np.arange(n) - reach, 0), np.minimum(np.arange(n) + reach, n - 1)
    found: Array = (recording.q[high] - recording.q[low]) / (time[high] - time[low])[:, None]
    return found


def _means(values: Array, every: int) -> Array:
    """Compute means of `every` successive rows, ignoring missing values."""
    there = np.isfinite(values)
    starts = np.arange(0, len(values), every)
    sums = np.add.reduceat(np.where(there, values, 0.0), starts)
    counts = np.add.reduceat(there.astype(float), starts)
    return np.divide(sums, counts, out=np.full_like(sums, np.nan), where=counts > 0)


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
    parts = [_nearest(robot, workspace, q[part]) for part in _parts(len(q))]
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


def _nearest(robot: Robot, workspace: Workspace, q: Array) -> tuple[Array, NDArray[np.intp]]:
    """Compute the smallest distance per configuration, and the number of link and box."""
    free = workspace.margin - intrusions(robot, workspace, q).reshape(len(q), -1)
    nearest = free.argmin(axis=1)
    return free[np.arange(len(q)), nearest], nearest


def _parts(n: int, most: int = 4096) -> list[slice]:
    """Divide n instants into parts computed at a time."""
    return [slice(begin, begin + most) for begin in range(0, n, most)]
