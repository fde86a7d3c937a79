"""Plans on the command line: their files, and output of robot, dry run and predicted precision.

Robot: Table 1, eq. (22) by group, and Table 2. Plan: duration, identifiability and precision; the
last column of predictions is the torque of a standard deviation, relative to the limit.
"""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hil.model.base_parameters import base_parameters
from hil.model.dependencies import DIAGONAL, GRAVITY, OFF_DIAGONAL
from hil.model.robot import ROBOTS
from hil.planning.measurement import FOR_A_LAW
from hil.planning.plan import dump_plan, load_workspace, opened_plan, remarks
from hil.planning.prediction.information import IMPRECISE
from hil.runs.atomic_file import write_file
from hil.show.rounding import clock, count, rounded, significant, unit
from hil.show.table import Column, Marked, Part, figures, table
from hil.show.terminal import show
from hil.terminal.console import give, out, say

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from hil.model.robot import Robot
    from hil.planning.dry_run import DryRun
    from hil.planning.plan import Plan
    from hil.planning.prediction.information import Precision
    from hil.planning.workspace import Workspace


_GROUP_TITLES = {
    GRAVITY: "gravity: in g(q)",
    DIAGONAL: "diagonal: on the diagonal of M(q), not in g(q)",
    OFF_DIAGONAL: "off-diagonal: only off the diagonal of M(q)",
}


def render_robot(robot: Robot) -> None:
    """Print present parameters, base parameters by group, and dependencies of M and g."""
    base, rows = base_parameters(robot), []
    for link, joint in enumerate(robot.file.joints, start=1):
        names = (f"{name}{link}" for name in joint.parameters)
        listed = (f"{n} = {robot.ties[n]}" if n in robot.ties else n for n in names)
        name = f"{joint.name} ({joint.type})" if joint.name else joint.type
        rows.append((str(link), name, ", ".join(listed) or "none"))
    present: tuple[str | Column, ...] = ("link", "joint", Column("parameters", folds=True))
    show(table(f"{robot.name}: link parameters present", present, rows), out)
    parts = [
        Part(
            tuple(
                (base.names[k], base.meanings[k], unit(base.units[k]), base.expressions[k])
                for k in members
            ),
            _GROUP_TITLES[group],
        )
        for group, members in base.groups.items()
    ]
    heads: tuple[str | Column, ...] = (
        "", Column("meaning", folds=True), "unit", Column("expression", folds=True),
    )  # fmt: skip
    show(table(f"{len(base)} base parameters", heads, parts), out)
    if robot.file.lengths:
        say(", ".join(f"{name} = {value:g} m" for name, value in robot.file.lengths.items()))
    widest = 12  # maximum number of joints for a readable table of M and g on a terminal
    if robot.n_joints <= widest:
        # M in its upper triangle, by symmetry, and g
        joints, occurs = range(robot.n_joints), []
        for i in joints:
            cells = [_numbers(base.dependencies.mass[i, j]) if j >= i else "" for j in joints]
            occurs.append((f"i = {i + 1}", *cells, _numbers(base.dependencies.gravity[i])))
        named = (*(f"M_i{j + 1}" for j in joints), "g_i")
        columns: tuple[str | Column, ...] = (
            "", *(Column(head, "right", folds=True) for head in named),
        )  # fmt: skip
        show(table("parameters p_k that occur in M_ij(q) and g_i(q), by k", columns, occurs), out)
    else:
        say(
            f"the table of parameters by element has {robot.n_joints} columns, at most {widest} "
            "are shown; in Python: base_parameters(robot).dependencies"
        )


def _numbers(occurs: NDArray[np.bool_]) -> str:
    """Format indices from 1, three or more in a row as a range: ``1-4, 7``."""
    found = np.flatnonzero(occurs) + 1
    runs = np.split(found, np.flatnonzero(np.diff(found) > 1) + 1) if found.size else []
    parts = [f"{run[0]}-{run[-1]}" if run.size > 2 else ", ".join(map(str, run)) for run in runs]
    return ", ".join(parts) or "0"


def render(result: DryRun, robot: Robot) -> None:
    """Print duration, bus load and identifiability of a plan."""
    costs = tuple(
        (kind, str(result.counts.get(kind, "")), clock(duration))
        for kind, duration in result.durations.items()
    )
    total = ("total", str(sum(result.counts.values())), clock(result.duration))
    columns: tuple[str | Column, ...] = ("", *figures("measurements", "time, m:ss"))
    show(table("Duration", columns, (Part(costs), Part((total,)))), out)
    if result.bus:
        say(
            f"bus load {result.bus_load:.1%} at {result.bus.bitrate / 1000:g} kbit/s"
            f" ({result.bus.frames}; at most {result.bus.most:.0%})"
        )
    if result.lags:
        lag = max(result.lags, key=lambda each: each.most / each.window)
        say(
            f"axis {lag.axis + 1} lags behind its set-points by up to {lag.most:.2g} "
            f"{robot.position_unit(lag.axis)} in {lag.trajectory}, "
            f"{lag.most / lag.window:.0%} of the following error window (6065)"
        )
    for axis, planned in result.without_law.items():
        say(
            f"axis {axis + 1}: {count(planned, 'measurement')} planned, a friction law needs "
            f"{FOR_A_LAW}; predicted torques will lack friction of this axis; "
            "add measurements of this axis",
            "yellow",
        )
    if result.groups:
        rows = [
            (
                _words(group.group),
                ", ".join(group.names),
                str(group.rows),
                f"{group.rank} of {len(group.names)}",
                f"{group.condition:.1f}" if math.isfinite(group.condition) else "infinite",
            )
            for group in result.groups
        ]
        heads = figures("measurements", "rank", "condition")
        named = "group", Column("parameters", folds=True)
        show(table("Identifiability", (*named, *heads), rows), out)
        for group in result.groups:
            if group.poorly_identifiable:
                names = _join_titles(group.poorly_identifiable, robot)
                say(
                    f"poorly identifiable in {_words(group.group)}: {names}; vary more joints or"
                    " add configurations",
                    "yellow",
                )
            if group.hidden:
                names = _join_titles(group.hidden, robot)
                say(
                    f"{names}: distinguished from an offset or from one another only by "
                    "accelerations, not by gravity torques; condition and rank include all kinds "
                    "of measurement"
                )


def _join_titles(names: Iterable[str], robot: Robot) -> str:
    """Join the titles of base parameters: ``gravity of axis 2 (p5), gravity of axis 3 (p8)``."""
    base = base_parameters(robot)
    title = dict(zip(base.names, base.titles, strict=True))
    return ", ".join(title[name] for name in names)


def _words(group: str) -> str:
    return group.replace("_", "-")


def render_precision(found: Precision, robot: Robot) -> None:
    """Print the predicted precision of every base parameter."""
    columns = {"std. deviation": [_figure(each) for each in found.deviation]}
    _print_precision("Predicted precision", columns, found, robot)


def render_refinement(before: Precision, after: Precision, robot: Robot) -> None:
    """Print the present precision, and the prediction with the proposed measurements."""
    pairs = list(zip(before.deviation.tolist(), after.deviation.tolist(), strict=True))
    columns = {
        "now": [_figure(now) for now, _ in pairs],
        "then": [_figure(then) for _, then in pairs],
        "then / now": [f"{then / now:.2f}" if math.isfinite(now) else "" for now, then in pairs],
    }
    _print_precision("Predicted standard deviations", columns, after, robot)


def _print_precision(
    title: str, columns: dict[str, list[str]], found: Precision, robot: Robot
) -> None:
    """Print figures by group, effects on torques, and imprecise parameters."""
    base, what = base_parameters(robot), Column("meaning", folds=True)
    heads: tuple[str | Column, ...] = ("", what, *figures(*columns), "unit")
    parts = []
    for group, members in base.groups.items():
        rows = []
        for k in members:
            effect = float(found.effect[k])
            rows.append(
                (
                    base.names[k],
                    base.meanings[k],
                    *(each[k] for each in columns.values()),
                    unit(base.units[k]),
                    significant(100 * effect, 2) if math.isfinite(effect) else "",
                    Marked("imprecise" if found.imprecise[k] else ""),
                )
            )
        if members:
            parts.append(Part(tuple(rows), _words(group)))
    show(table(title, (*heads, *figures("torque, %"), ""), parts), out)
    say(
        "torque: effect of one standard deviation, as a share of an axis's torque limit; "
        f"{found.source}"
    )
    if imprecise := _join_titles(np.array(base.names)[found.imprecise].tolist(), robot):
        say(
            f"imprecise: {imprecise}; one standard deviation changes a torque by more than "
            f"{IMPRECISE:.1%} of its limit; give more --minutes, or refine with hil plan --refine",
            "yellow",
        )


def _figure(deviation: float) -> str:
    return rounded(deviation, deviation) if math.isfinite(deviation) else "not identifiable"


def load(plan_file: Path, robot_file: str | None, workspace: Path | None) -> tuple[Plan, Robot]:
    """Read a plan with robot and workspace; show remarks about the workspace.

    Raises
    ------
    FileError
        One of the files cannot be used, or the plan is of another robot.
    """
    the_plan, the_robot = opened_plan(plan_file, robot_file, workspace)
    _show_remarks(the_plan.workspace, the_robot)
    return the_plan, the_robot


def load_guard(path: Path | None, robot: Robot) -> Workspace | None:
    """Read the optional workspace of a new plan; show remarks.

    Raises
    ------
    FileError
        An unusable workspace file.
    """
    guard = None if path is None else load_workspace(path, robot)
    _show_remarks(guard, robot)
    return guard


def _show_remarks(workspace: Workspace | None, robot: Robot) -> None:
    for line in remarks(workspace, robot):
        say(line, style="yellow")


def write_plan(output: Path, designed: Plan, the_robot: Robot) -> None:
    """Write a plan with the path of the robot file, and state the number of measurements."""
    source = Path(the_robot.source)
    if source.parent != ROBOTS:
        file = Path(os.path.relpath(source.resolve(), output.resolve().parent)).as_posix()
        remembered = designed.robot.model_copy(update={"file": file})
        designed = designed.model_copy(update={"robot": remembered})
    write_file(output, dump_plan(designed).encode())
    give(plan=str(output), measurements=len(designed.measurements))
    say(f"{count(len(designed.measurements), 'measurement')} in {output}")
