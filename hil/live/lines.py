"""Lines for reporting a run to listening processes: a JSON object per line.

Every line has ``kind`` and ``at``, the clock's time [s since 1970]. All other values are SI on the
joint side; unknown values are null.

start
    First line. ``robot``: as from `hil.view.visuals.robot_data` (name, joints with limits and
    units); ``workspace``: likewise, or null; ``measurements``: number of measurements in the plan;
    ``rehearsal``: share of the speed limits, or null; ``simulated``: true for the virtual plant;
    ``hand``: true if the arm can be pushed from the page; ``watched``: true if torques are compared
    with a model.
headline
    ``text``: present activity in a sentence; ``more``: its purpose. The latest line is valid.
report
    ``folder`` of the run; ``next``: suggested command; ``there``: true if this server has the
    report.
hand
    ``closed``: reason why the arm cannot be pushed at present, or "". The latest line is valid.
armed
    The axes are under power. ``axes``: a list with ``name``, ``identity``, position limits
    ``lower`` and ``upper``, and ``velocity`` limit in force on the drive.
off
    The axes are stopped and without power.
sample
    ``t``: time of the bus [s]; ``q``, ``tau`` and ``flags`` (`drivers.drive_bus.SampleFlag`): a
    number for each axis. At most 25 lines per second (`hil.live.feed`), none for a slow reader.
event
    Event of the sequencer. ``name``: its class in `hil.measuring.sequencer`; ``doing``: activity in
    words; ``notice``: message for the operator, or ""; ``t`` and ``total``: present and final time
    of the bus [s]; ``left``: remaining wall-clock time [s]. Events about a measurement also have
    ``measurement``, its ``number`` in the plan from 1, the moving ``axes`` from 0, ``seen``: the
    visible motion, and ``shows``: the content of the torque.
level
    Friction of one ``axis`` in a recording (`level_of`): ``level``, ``speed`` and ``measurement``;
    over all recordings so far ``count``, ``least`` and ``most``.
torque
    Measured and predicted torque. ``axes``: from 0; ``torque``, ``predicted`` and ``band``: for
    each axis a track that continues the previous one (`hil.view.page`), in time of the bus. The
    band around the predicted torque contains 95 % of normal torques. ``measurement``: id of the
    recording, or "" for a watched run.
estimate
    Base parameters from the recordings so far. ``recordings``: number of recordings;
    ``parameters``: a list with ``name``, ``meaning``, ``unit``, ``expression``, ``value``, ``half``
    (half-width of the 95 % interval, null if undetermined), and ``share`` (torque of ``half`` on a
    free motion, as a share of the limit of the most affected axis).
alarm
    Start of an alarm of one ``axis``, from 0: external ``torque`` and its ``threshold`` with their
    ``unit``, at ``t``; ``push``: number of the push, common to the alarms of several axes.
note
    ``text``: remark for the operator; the run continues.
fault
    ``text``: reason of a stop, with the remedy, as soon as it is known.
end
    Last line. ``how``: finished, stopped (by the operator) or failed; ``text``: message.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from hil.measuring.sequencer import AboutMeasurement
from hil.planning.measurement import KINDS
from hil.terminal.progress import doing, notice
from hil.view.packed import Track
from hil.view.visuals import robot_data, workspace_data

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from drivers.drive_bus import AxisInfo, Sample
    from hil.arrays import Array
    from hil.measuring.sequencer import Event
    from hil.model.robot import Robot
    from hil.planning.measurement import Measurement
    from hil.planning.plan import Plan
    from hil.results.watch import Alarm
    from hil.runs.recording import Recording

MIDDLE = (0.25, 0.75)
"""Range of a stroke used for torques, as shares of the distance."""


def level(
    measurement: Measurement, recording: Recording, so_far: dict[int, list[float]]
) -> Line | None:
    """Return the values of line ``level``; None without a level in the recording.

    The level is appended to `so_far`, levels by axis.
    """
    found = level_of(measurement, recording)
    if found is None:
        return None
    (axis,), (size, speed) = measurement.read, found
    levels = so_far.setdefault(axis, [])
    levels.append(round(size, 4))
    return {
        "axis": axis,
        "level": levels[-1],
        "speed": round(speed, 4),
        "measurement": measurement.id,
        "count": len(levels),
        "least": min(levels),
        "most": max(levels),
    }


def level_of(measurement: Measurement, recording: Recording) -> tuple[float, float] | None:
    """Compute the friction level of the axis moving back and forth, and the mean speed.

    The level is for display; identification is more accurate. Over the middle half of the stroke
    the axis passes the same positions forth and back, so half the difference of the mean torques is
    without gravity; inertia cancels too, since a stroke brakes as it has accelerated. The rest is
    the friction at the speed of the stroke.

    Return None if no axis moves back and forth, or with fewer than five samples per direction in
    the middle of the strokes.

    Returns
    -------
    level : float
        Half the difference of the mean torques forth and back [N m or N].
    speed : float
        Mean speed [rad/s or m/s].
    """
    if len(measurement.read) != 1:
        return None
    axis = measurement.read[0]
    q, tau = recording.q[:, axis], recording.tau[:, axis]
    under_way = (recording.stroke >= 0) & np.isfinite(q) & np.isfinite(tau)
    if not under_way.any():
        return None
    low, high = q[under_way].min(), q[under_way].max()
    share = (q - low) / max(high - low, np.finfo(float).tiny)
    used = under_way & (share > MIDDLE[0]) & (share < MIDDLE[1])
    forth, back = (used & (recording.stroke % 2 == side) for side in (0, 1))
    if min(forth.sum(), back.sum()) < 5:
        return None
    way = len(np.unique(recording.stroke[used])) * (MIDDLE[1] - MIDDLE[0]) * float(high - low)
    speed = way / float(used.sum() * recording.period)
    return float(tau[forth].mean() - tau[back].mean()) / 2, speed


Line = dict[str, object]

_PLACES = {"q": 6, "tau": 4}
"""Decimals, far finer than displayed."""
TORQUE = 10.0 ** -_PLACES["tau"]
"""Resolution of torque tracks [N m or N]."""


def start(
    robot: Robot,
    plan: Plan,
    rehearsal: float | None,
    *,
    simulated: bool,
    hand: bool = False,
    watched: bool = False,
) -> Line:
    """Return the values of line ``start``."""
    return {
        "robot": robot_data(robot),
        "workspace": workspace_data(plan.workspace),
        "measurements": len(plan.measurements),
        "rehearsal": rehearsal,
        "simulated": simulated,
        "hand": hand,
        "watched": watched,
    }


def armed(axes: Sequence[AxisInfo]) -> Line:
    """Return the values of line ``armed``."""
    stated = [
        {
            "name": axis.name,
            "identity": axis.identity,
            "lower": _number(axis.q_min),
            "upper": _number(axis.q_max),
            "velocity": _number(axis.velocity_max),
        }
        for axis in axes
    ]
    return {"axes": stated}


def sample(taken: Sample) -> Line:
    """Return the values of line ``sample``."""
    return {
        "t": round(taken.time, 4),
        "q": [_number(q, _PLACES["q"]) for q in taken.q],
        "tau": [_number(tau, _PLACES["tau"]) for tau in taken.tau],
        "flags": list(taken.flags),
    }


def torque(axes: Sequence[int], time: Array, *torques: Array, measurement: str = "") -> Line:
    """Return the values of line ``torque``.

    Parameters
    ----------
    axes : sequence of int
        Axes from 0.
    time : ndarray, shape (n,)
        Time [s].
    *torques : ndarray, shape (n, n_axes)
        Measured and predicted torque, and band [N m or N].
    measurement : str
        Id of the recording.
    """
    names = ("torque", "predicted", "band")
    tracks = ([Track(time, column).data(TORQUE) for column in each.T] for each in torques)
    return {"axes": list(axes), "measurement": measurement, **dict(zip(names, tracks, strict=True))}


def alarm(raised: Alarm, unit: str, push: int) -> Line:
    """Return the values of line ``alarm`` for push number `push`."""
    return {
        "push": push,
        "axis": raised.axis - 1,
        "torque": _number(raised.torque),
        "threshold": _number(raised.threshold),
        "unit": unit,
        "t": round(raised.time, 4),
    }


def event(happened: Event, left: float, numbers: Mapping[str, int]) -> Line:
    """Return the values of line ``event``.

    Parameters
    ----------
    left : float
        Remaining time on the wall clock [s].
    numbers : mapping of str to int
        Number of each measurement in the plan.
    """
    line: Line = {
        "name": type(happened).__name__,
        "doing": doing(happened),
        "notice": notice(happened),
        "t": _number(happened.time, 3),
        "total": _number(happened.time + happened.remaining, 3),
        "left": _number(left, 1),
    }
    if isinstance(happened, AboutMeasurement):
        measurement = happened.measurement
        kind, axes = KINDS[measurement.kind], [axis + 1 for axis in measurement.moved]
        seen, shows = kind.seen.format(axis=axes[0], partner=axes[-1]), kind.shows
        line |= {
            "seen": seen,
            "shows": shows,
            "measurement": measurement.id,
            "number": numbers.get(measurement.id),
            "axes": list(measurement.moved),
        }
    return line


def _number(value: float, places: int = 6) -> float | None:
    return round(value, places) if math.isfinite(value) else None
