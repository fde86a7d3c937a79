"""Constants and state of the exported watch: names, units, dimensions.

Constants come from the model and from the thresholds learned by a watch. They are those of
`hil.watching`, for the functions of `hil.export.watch_steps`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.results.watch import LEARNING
from hil.watching import detector, friction
from hil.watching.detector import Detector
from hil.watching.watcher import OVER

if TYPE_CHECKING:
    from hil.results.model import Model
    from hil.results.watch import Watched

BLIND = 1e30
"""Threshold where no push is visible, relative to the torque limit."""


class Constant(NamedTuple):
    """Constant of the code: a number, or an array as nested lists."""

    value: object
    unit: str
    meaning: str


def constants(model: Model, found: Watched) -> dict[str, Constant]:
    """Return the constants of the code, in SI units; `limit` is a share of the torque limit.

    Raises
    ------
    NotEnoughData
        The model has no law of friction.
    """
    robot, period = model.robot, found.period
    fresh, started = (Detector(model, period) for _ in range(2))
    started.begin(found.axes)
    tables, turn, windows = fresh.tables.values, fresh.turning, fresh.windows
    shares = "1, of the torque limit"
    rows: dict[str, tuple[object, str, str]] = {
        "joints": (robot.n_joints, "", "number of axes"),
        "parameters": (len(model.values), "", "number of base parameters"),
        "period": (period, "s", "time between two samples"),
        "gap": (detector.GAP, "", "longest time between successive samples, in periods"),
        "needed": (
            round((found.learned or LEARNING) / period),
            "",
            "samples in motion for learning anew",
        ),
        "over": (OVER + period / 4, "s", "time without a sign after which an alarm ends"),
        "limit": (robot.torque_limit, robot.torque_units, "torque limits"),
        "fastest": (robot.velocity_limit, "rad/s or m/s", "velocity limits"),
        "inertia": (robot.reflected_inertia, "kg m2 or kg", "inertia of the motors, joint side"),
        "covariance": (model.covariance, "", "covariance of the base parameters"),
        "slow": (detector.SLOW, "", "share of the velocity limit below which an axis may rest"),
        "per_node": (fresh.tables.per_node, "s/rad or s/m", "nodes of the tables by speed"),
        "last_place": (friction.LAST_PLACE, "", "last place in the tables"),
        "offset": (tables[0].T, "N m or N", "offset of friction by speed"),
        "level": (tables[1].T, "N m or N", "level of friction by speed"),
        # friction depends on the load in proportion, at every speed
        "offset_of_load": (tables[2].mean(axis=0), "1", "offset of friction by load"),
        "level_of_load": (tables[3].mean(axis=0), "1", "level of friction by load"),
        "last_speed": (len(friction.SPEEDS) - 1, "", "last node of the deviation of friction"),
        "unknowns": (friction.N_UNKNOWNS, "", "number of unknowns of the deviation of friction"),
        "speeds": (friction.SPEEDS, "1", "nodes of the deviation, shares of the velocity limit"),
        "first_p": (fresh.level.covariance, "", "first covariance of the deviation of friction"),
        "wander": (
            fresh.level.wander * fresh.n_block * period / 60,
            "",
            "covariance of the deviation's random walk in a block",
        ),
        "error": (friction.ERROR, shares, "error of a block's mean, not by friction"),
        "block": (fresh.n_block, "", "samples in a block, after which learned values hold"),
        "lasting": (detector.LASTING, "s", "duration from which a deviation is learned"),
        "sure": (detector.SURE, "1", "largest doubt of samples for learning"),
        "rest": (turn.n_still, "", "samples within the shortest distance for a standstill"),
        "n_distances": (len(friction.DISTANCES), "", "number of presliding distances"),
        "distances": (friction.DISTANCES, "rad or m", "presliding distances"),
        "free": (~turn.known * 1.0, "", "1 for axes with a distance to be found"),
        "first_taken": (turn.taken, "", "first presliding distance of each axis, from 0"),
        "turning": (friction.TURNING, "1", "difference of directions in a reversal"),
        "damping_doubt": (friction.DAMPING_DOUBT, "1", "relative uncertainty of the damping"),
        "unclear": (friction.UNKNOWN, "1", "doubt about an unknown direction"),
        "enough_seen": (float(friction.ENOUGH), "", "samples in reversals for a distance"),
        "n_windows": (len(windows), "", "number of windows"),
        "windows": (windows, "samples", "lengths of the windows"),
        "longest": (int(windows[-1]), "samples", "longest window"),
        "sigmas": (detector.SIGMAS, "1", "threshold in standard deviations of the scatter"),
        "visible": (detector.VISIBLE, shares, "largest threshold"),
        "blind": (BLIND, shares, "threshold where no push is visible"),
        "allowance": (detector.CERTAIN, "1", "allowance for few squares, in standard deviations"),
        "enough": (detector.ENOUGH / period, "samples", "motion for a valid scatter"),
        "most": (detector.MEMORY / period, "samples", "averaging time of the scatter"),
        "learned_squares": (started.scatter.squares.T, "1", "learned squares of the scatter"),
        "learned_weight": (started.scatter.weights, "samples", "motion in the scatter"),
        "learned_shown": (
            started.turning.sums[:3].transpose(2, 0, 1),
            "",
            "learned sums for presliding distance and damping",
        ),
        "learned_seen": (started.turning.sums[3, 0], "samples", "reversals in the sums"),
    }
    return {
        name: Constant(value.tolist() if isinstance(value, np.ndarray) else value, unit, meaning)
        for name, (value, unit, meaning) in rows.items()
    }


class Field(NamedTuple):
    """Field of the state: type, and names of the constants that are its dimensions."""

    kind: str
    shape: tuple[str, ...] = ()


_AXIS, _WINDOWS, _SUMS = ("joints",), ("joints", "n_windows"), ("joints", "three", "n_distances")
_UNKNOWNS, _SQUARE = ("joints", "unknowns"), ("unknowns", "unknowns")
OUTPUTS = {"external": "float", "threshold": "float", "alarm": "bool"}
"""Fields of the state for the user: torque [N m or N], its threshold, and alarms."""
STATE: dict[str, Field] = {
    **{name: Field(kind, _AXIS) for name, kind in OUTPUTS.items()},
    "lost": Field("float"),
    **dict.fromkeys(("held", "since", "newest", "latest", "moved", "in_block"), Field("int")),
    **dict.fromkeys(
        (
            "now", "before", "measured", "velocity", "acceleration", "rigid", "friction", "level",
            "path", "unknown", "damping", "damped", "doubt", "quiet", "weight", "seen", "seen_now",
            "used", "doubted",
        ),
        Field("float", _AXIS),
    ),
    "columns": Field("float", ("rows",)),
    "taken": Field("int", _AXIS),
    "doubtful": Field("bool", _AXIS),
    "paths": Field("float", ("joints", "rest")),
    "row": Field("float", ("joints", "n_distances")),
    **dict.fromkeys(("residuals", "bands"), Field("float", ("joints", "longest"))),
    **dict.fromkeys(("bound", "squares", "squares_now"), Field("float", _WINDOWS)),
    **dict.fromkeys(("shown", "shown_now"), Field("float", _SUMS)),
    **dict.fromkeys(("x", "b"), Field("float", _UNKNOWNS)),
    **dict.fromkeys(("p", "f"), Field("float", ("joints", *_SQUARE))),
    **dict.fromkeys(("g", "h"), Field("float", _SQUARE)),
}  # fmt: skip
"""Fields of the state, with values kept between calls: see `hil.export.watch_steps`."""
