"""Figures of the paper for the virtual robot, from the kept results."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from hil.estimation.absent_parameters import Sinusoid
from hil.friction.curves import torque
from hil.planning.design.friction import OPERATION
from hil.show.charts.chart import GREEN, INK, MEASURED, MODEL, MUTED, ordered_colours

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from hil.arrays import Array
    from hil.model.robot import Robot

    Drawn = Mapping[str, Any]

WIDE = 7.4
"""Width [inch]: 736 pixels of a page, so that 9 points are 12 pixels."""
LOOK: Any = {
    "font.size": 9.5, "axes.titlesize": 10, "axes.labelsize": 9.5, "xtick.labelsize": 9,
    "ytick.labelsize": 9, "legend.fontsize": 9, "figure.constrained_layout.use": True,
}  # fmt: skip


def fig_1(drawn: Drawn, robot: Robot) -> Figure:
    """Draw normalised characteristics, and models of axis 1."""
    figure, (left, right) = _panels(3.3, 1, 2)
    points = np.array(drawn["sweep"]["points"])
    for axis, colour in enumerate(ordered_colours(robot.n_joints), start=1):
        v, forward, _ = sort_by_speed(points, axis)
        x, y = v / robot.velocity_limit[axis - 1], forward / robot.torque_limit[axis - 1]
        left.plot(x, y, "o-", color=colour, ms=3, label=axis)
    left.set(title="(a) all axes", xlabel="speed / limit", ylabel="friction / peak torque")
    left.set_ylim(0, 0.55)
    left.legend(title="axis", ncols=3)
    speed, forward, backward = sort_by_speed(points, 1)
    right.plot(speed, (forward - backward) / 2, "o", color=MEASURED, ms=4, label="measured")
    v, law = np.linspace(speed[0], speed[-1], 200), drawn["sweep"]["models"]["1"]
    right.plot(v, torque("linear", law["linear"][1:], v), ":", color=MUTED, label="eq. (1)")
    right.plot(v, torque("cube-root", law["cube-root"][1:], v), "--", color=GREEN, label="eq. (2)")
    right.plot(v, torque("arctan", law["arctan"][1:], v), "-", color=MODEL, label="eq. (3)")
    right.set(title="(b) axis 1", xlabel="speed [rad/s]", ylabel="friction [N m]")
    right.legend()
    return figure


def fig_2(drawn: Drawn, _: Robot) -> Figure:
    """Draw friction of axis 2 over time with stops, and its characteristic in operation."""
    figure, (left, right) = _panels(3.3, 1, 2)
    _, minutes, _, forward, backward = np.array(drawn["stops"]["points"]).T
    level, apart = (forward - backward) / 2, np.diff(minutes, prepend=minutes[0]) > 0.5
    left.plot(minutes, np.where(apart, np.nan, level), "-", color=MUTED, lw=0.8)
    left.plot(minutes, level, ".", color=MEASURED, ms=3)
    for at, stop in zip(np.flatnonzero(apart), ("5", "1", "2"), strict=True):
        left.annotate(f"{stop} min", (minutes[at], level[at]), (6, -3), textcoords="offset points")
    left.set(title="(a) stops of 5, 1 and 2 min", xlabel="time [min]", ylabel="friction [N m]")
    for curve, colour, begun in zip(
        operating_characteristics(drawn), ordered_colours(4), OPERATION, strict=True
    ):
        v, forward, backward = curve
        x, y = np.append(-v[::-1], v), np.append(backward[::-1], forward)
        right.plot(x, y, "o-", color=colour, ms=2.5, label=f"{begun / 60:.0f} min")
    right.set(title="(b) axis 2 in operation", xlabel="speed [rad/s]", ylabel="friction [N m]")
    right.legend(title="after")
    return figure


def sort_by_speed(points: Array, axis: int) -> Array:
    """Return ascending speeds of an axis, with torques forward and backward."""
    own = points[points[:, 0] == axis]
    return np.asarray(own[np.argsort(own[:, 2]), 2:].T)


def operating_characteristics(drawn: Drawn) -> list[Array]:
    """Return the successive characteristics in operation, in the form of `sort_by_speed`."""
    points = np.array(drawn["operation"]["points"])
    return [
        sort_by_speed(each, int(points[0, 0])) for each in np.array_split(points, len(OPERATION))
    ]


def fig_3(drawn: Drawn, _: Robot) -> Figure:
    """Draw velocity and torque of a measurement of g2 and of one of M22."""
    figure, panels = _panels(3.8, 2, 2, sharex="col")
    names = "(a) gravitational torque $g_2$", "(b) moment of inertia $M_{22}$"
    for k, (name, each) in enumerate(zip(names, drawn["trajectories"], strict=True)):
        panels[k].plot(each["t"], each["v"], color=MODEL)
        panels[k].set(title=name, ylabel=r"$\dot q_2$ [rad/s]")
        panels[k + 2].plot(each["t"], each["Q"], color=MEASURED)
        panels[k + 2].set(xlabel="time [s]", ylabel="$Q_2$ [N m]")
    return figure


def fig_4(_: Drawn, robot: Robot) -> Figure:
    """Draw frames of the robot file at q = 0, frames with a common origin side by side."""
    figure, (panel,) = _panels(3.9, 1, 1)
    pose, flat, size = np.eye(4), np.array([[1.0, -0.4, 0.0], [0.0, -0.3, 1.0]]), 0.15
    apart = np.array([[0, 0], [-0.3, -0.2], [0, 0], [0, 0], [0.35, 0], [0.7, 0]])
    chain = [np.zeros(2)]
    for k, aside in enumerate(apart):
        pose = pose @ robot.zero_pose(k)
        chain.append(flat @ pose[:3, 3])
        x, y = chain[-1] + aside
        panel.plot([chain[-1][0], x], [chain[-1][1], y], ":", color=MUTED, lw=1)
        panel.plot(x, y, "o", color=INK, ms=4)
        for name, column, colour in (("x", 0, MEASURED), ("z", 2, MODEL)):
            u, v = size * flat @ pose[:3, column]
            panel.quiver(x, y, u, v, color=colour, scale=1, width=0.004, **ON_AXES)
            panel.text(x + 1.3 * u, y + 1.3 * v, f"${name}_{k + 1}$", color=colour, va="bottom")
    panel.plot(*np.array(chain).T, "-", color=MUTED, lw=5, alpha=0.35, zorder=0)
    panel.text(0.15, -0.08, "$l_1$")
    panel.text(0.44, 0.3, "$l_2$")
    panel.set(xlim=(-0.5, 1.45), ylim=(-0.32, 0.98), aspect="equal")
    panel.axis("off")
    return figure


ON_AXES: Any = {"angles": "xy", "scale_units": "xy"}


def fig_5(drawn: Drawn, _: Robot) -> Figure:
    """Draw gravity torques over the number of the configuration."""
    return _elements(drawn, "gravity", (2, 3, 4, 5), "$g_{}$ [N m]")


def fig_6(drawn: Drawn, _: Robot) -> Figure:
    """Draw moments of inertia over the number of the configuration, without the part of p_g."""
    return _elements(drawn, "inertia", (1, 2, 3, 4, 5, 6), "$M_{{{0}{0}}}$ [kg m²]")


def _elements(drawn: Drawn, kind: str, axes: Sequence[int], label: str) -> Figure:
    rows = len(axes) // 2
    figure, panels = _panels(2.1 * rows + 0.4, rows, 2)
    for panel, axis in zip(panels, axes, strict=True):
        for case, mark, line, name in LINES:
            x, value, model = shown(drawn, case, kind, axis).T
            gaps = np.flatnonzero(np.diff(x) > 1) + 1
            path = np.insert(x, gaps, np.nan), np.insert(model, gaps, np.nan)
            panel.plot(*path, line, color=MODEL, lw=0.9, label=f"model, {name}")
            panel.plot(x, value, mark, color=MEASURED, ms=4, mfc="none", label=f"measured, {name}")
        panel.set_ylabel(label.format(axis))
        panel.xaxis.set_major_locator(MaxNLocator(6, integer=True))
    figure.supxlabel("configuration number", fontsize=9.5)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=4)
    return figure


LINES = (("bare", "o", "-", "without"), ("loaded", "x", "--", "with the load"))


def shown(drawn: Drawn, case: str, kind: str, axis: int) -> Array:
    """Return number, measured value and model of one axis's elements, of M without p_g."""
    own = enumerate((each for each in drawn[case] if each["kind"] == kind), start=1)
    chosen = [(n, each) for n, each in own if each["axis"] == axis]
    share = [each["of_gravity"] * (kind == "inertia") for _, each in chosen]
    rows = [(n, each["value"], each["model"]) for n, each in chosen]
    return np.array(rows) - np.outer(share, [0, 1, 1])


def fig_7(drawn: Drawn, _: Robot) -> Figure:
    """Draw the gravity torque g3 over q4: measured, by the robot file, with the effects found."""
    figure, (panel,) = _panels(3.1, 1, 1)
    found, fine = drawn["offset"], np.linspace(-np.pi, np.pi, 200)
    stated, extended = Sinusoid(*found["stated"]), Sinusoid(*found["extended"])
    panel.plot(
        np.degrees(fine), stated.evaluate(fine), color=MODEL, label="model by the robot file"
    )
    panel.plot(found["q"], found["torque"], "o", color=MEASURED, label="measured")
    panel.plot(
        np.degrees(fine), extended.evaluate(fine), ":", color=INK, label="with effects found"
    )
    panel.set(xlabel="$q_4$ [degrees]", ylabel="$g_3$ [N m]", ylim=(3.8, 9.4))
    panel.legend(ncols=3, loc="upper center")
    return figure


def _panels(height: float, rows: int, columns: int, **options: Any) -> tuple[Figure, list[Any]]:
    figure = Figure(figsize=(WIDE, height))
    return figure, list(figure.subplots(rows, columns, squeeze=False, **options).flat)


FIGURES = (fig_1, fig_2, fig_3, fig_4, fig_5, fig_6, fig_7)
