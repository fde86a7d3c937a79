"""Friction of a cold start, predicted at the mean level and at the warmth of the gears.

    python benchmarks/warmth.py [FOLDER]

Measures six campaigns of 39 measurements of the manutec-r15, each begun cold with another seed.
Four campaigns are identified together; the friction of the other two is predicted. The table has
the residual friction torque of each axis as a share of friction, in the first three minutes and in
the whole campaign: by the law alone, at the mean level of the campaigns, and by the law at the
warmth after the preceding motion. Existing campaigns, also of benchmarks/history.py, are reused.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from figures import Figure, keep
from history import FOLDER, made

from hil.estimation.condensed import stack
from hil.estimation.friction.points import history
from hil.estimation.signals import signals
from hil.friction.warmth import warmth_at
from hil.results.identification import identify
from hil.runs.pooling import recorded
from hil.runs.run import Run

if TYPE_CHECKING:
    from hil.friction.warmth import History
    from hil.results.model import Model

SEEDS, OTHERS = (300, 302, 304, 306), (308, 310)
BEGIN = 180.0
"""Duration of the first part of a run [s]."""
DESCRIBED = (("warming", "s", 2), ("cooling", "s", 2), ("cold", "", 4), ("warm", "", 4))


def main() -> None:
    """Make missing campaigns, print and keep residuals."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, nargs="?", default=FOLDER)
    folder = parser.parse_args().folder
    first, *more = (Run.open(made(folder, "unchanged", seed)) for seed in SEEDS)
    model = identify(first, others=more)
    squares = sum(left(model, Run.open(made(folder, "unchanged", seed))) for seed in OTHERS)
    print(
        "axis  warming, s  cooling, s   cold   warm   begin: law, warmth, %   all: law, warmth, %"
    )
    kept: dict[str, Figure] = {}
    for axis, rows in enumerate(squares):
        print(f"{axis + 1:4} {described(model, axis)}  {shares(rows)}")
        for part, row in zip(("begin", "all"), rows, strict=True):
            for how, each in zip(("law", "warmth"), row[1:] if row[0] else (), strict=False):
                kept[f"axis-{axis + 1}-{part}-{how}"] = Figure(percent(each, row[0]), "%")
        if own := model.friction_law.axes[axis].warmth:
            kept |= {
                f"axis-{axis + 1}-{name}": Figure(getattr(own, name), unit, digits)
                for name, unit, digits in DESCRIBED
            }
    keep(
        "warmth", kept, depends=("hil/friction", "hil/estimation/friction"),
        command="python benchmarks/warmth.py", seeds=(*SEEDS, *OTHERS),
    )  # fmt: skip


def left(model: Model, run: Run) -> np.ndarray:
    """Return squares of friction and of residuals by law and warmth, shape (n_joints, 2, 3).

    The second axis contains the first minutes and all samples.
    """
    robot, pairs = model.robot, list(recorded(run))
    past, sums = history(robot, pairs), np.zeros((robot.n_joints, 2, 3))
    for motion, recording in pairs:
        s = signals(recording)
        for each in (each for axes in stack(robot, motion, s) for each in axes):
            state = np.zeros((1, robot.n_joints))
            state[0, each.axis] = course(model, past, each.axis, np.array([each.time]))
            own = each.torques[:, 0] - each.X[:, : each.n_base] @ model.values
            motion_of = s.q[each.index], s.qd[each.index], 0.0
            found = [
                model.predict(*motion_of, ["friction"], warmth=warmth)[:, each.axis]
                for warmth in (None, np.repeat(state, len(own), axis=0))
            ]
            values = [own @ own, *(np.sum((own - f) ** 2) for f in found)]
            sums[each.axis, 1] += values
            sums[each.axis, 0] += np.multiply(values, each.time < past.begin + BEGIN)
    return sums


def course(model: Model, past: History, axis: int, time: np.ndarray) -> float:
    """Return the warmth of an axis; NaN for an unidentified one."""
    own = model.friction_law.axes[axis].warmth
    if own is None:
        return float("nan")
    return float(warmth_at(past, axis, own.warming, own.cooling, time)[0])


def described(model: Model, axis: int) -> str:
    """Return time constants and levels of an axis."""
    own = model.friction_law.axes[axis].warmth
    if own is None:
        return "          none identified             "
    return f"{own.warming:11.0f} {own.cooling:11.0f}  {own.cold:5.3f}  {own.warm:5.3f}"


def shares(rows: np.ndarray) -> str:
    """Return root mean squares of residuals as percentages of friction."""
    return "   ".join(
        " ".join(f"{percent(each, row[0]):6.2f}" for each in row[1:]) if row[0] else "     -"
        for row in rows
    )


def percent(squares: float, whole: float) -> float:
    """Return a root mean square as a percentage of another."""
    return 100 * float(np.sqrt(squares / whole))


if __name__ == "__main__":
    main()
