"""The paper's figures of the virtual robot, from what the file of results keeps."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from hil.friction.curves import torque
from hil.planning.design.friction import OPERATION
from hil.report.charts.chart import GREEN, INK, MEASURED, MODEL, MUTED, in_turn

if TYPE_CHECKING:
    from collections.abc import Callable

    from hil.arrays import Array
    from hil.model.robot import Robot

    Drawn = dict[str, Any]

WIDE = 7.4
"""Width [inch]: 736 pixels of a page, so that 9 points are 12 pixels."""
LOOK = {
    "font.size": 9.5, "axes.titlesize": 10, "axes.labelsize": 9.5, "xtick.labelsize": 9,
    "ytick.labelsize": 9, "legend.fontsize": 9, "figure.constrained_layout.use": True,
}  # fmt: skip
STYLES = {"linear": (MUTED, ":", 1), "cube-root": (GREEN, "--", 2), "arctan": (MODEL, "-", 3)}
"""Colour, line and equation of the paper's friction models."""


def fig_1(drawn: Drawn, robot: Robot) -> Figure:
    """Normalised characteristics, and models of axis 1."""
    figure = Figure(figsize=(WIDE, 3.3))
    left, right = figure.subplots(1, 2)
    points = np.array(drawn["sweep"]["points"])
    for axis, colour in enumerate(in_turn(robot.n_joints), start=1):
        v, forward, _ = by_speed(points, axis)
        x = v / robot.velocity_limit[axis - 1]
        left.plot(x, forward / robot.torque_limit[axis - 1], "o-", color=colour, ms=3, label=axis)
    left.set(title="(a) all axes", xlabel="speed / limit", ylabel="friction / peak torque")
    left.set_ylim(0, 0.55)
    left.legend(title="axis", ncols=3)
    speed, forward, backward = by_speed(points, 1)
    right.plot(speed, (forward - backward) / 2, "o", color=MEASURED, ms=4, label="measured")
    v = np.linspace(speed[0], speed[-1], 200)
    for kind, (colour, line, number) in STYLES.items():
        a = drawn["sweep"]["models"]["1"][kind][1:]
        right.plot(v, torque(kind, a, v), line, color=colour, label=f"eq. ({number})")
    right.set(title="(b) axis 1", xlabel="speed [rad/s]", ylabel="friction [N m]")
    right.legend()
    return figure


def fig_2(drawn: Drawn, _: Robot) -> Figure:
    """Friction of axis 2 over time with stops, and its characteristic in operation."""
    figure = Figure(figsize=(WIDE, 3.3))
    left, right = figure.subplots(1, 2)
    points = np.array(drawn["stops"]["points"])
    minutes, level = points[:, 1], (points[:, 3] - points[:, 4]) / 2
    apart = np.diff(minutes, prepend=minutes[0]) > 0.5
    left.plot(minutes, np.where(apart, np.nan, level), "-", color=MUTED, lw=0.8)
    left.plot(minutes, level, ".", color=MEASURED, ms=3)
    for at, stop in zip(np.flatnonzero(apart), ("5", "1", "2"), strict=True):
        left.annotate(f"{stop} min", (minutes[at], level[at]), (6, -3), textcoords="offset points")
    left.set(title="(a) stops of 5, 1 and 2 min", xlabel="time [min]", ylabel="friction [N m]")
    for curve, colour, label in zip(in_operation(drawn), in_turn(4), OPERATION, strict=True):
        v, forward, backward = curve
        x, y = np.append(-v[::-1], v), np.append(backward[::-1], forward)
        right.plot(x, y, "o-", color=colour, ms=2.5, label=f"{label / 60:.0f} min")
    right.set(title="(b) axis 2 in operation", xlabel="speed [rad/s]", ylabel="friction [N m]")
    right.legend(title="after")
    return figure


def by_speed(points: Array, axis: int) -> Array:
    """Speeds of an axis, rising, and torques forward and backward."""
    own = points[points[:, 0] == axis]
    return np.asarray(own[np.argsort(own[:, 2]), 2:].T)


def in_operation(drawn: Drawn) -> list[Array]:
    """The same of the characteristics one after another."""
    points = np.array(drawn["operation"]["points"])
    return [by_speed(each, int(points[0, 0])) for each in np.array_split(points, len(OPERATION))]


def fig_3(drawn: Drawn, _: Robot) -> Figure:
    """Velocity and torque of a measurement of g2 and of one of M22."""
    figure = Figure(figsize=(WIDE, 3.8))
    panels = figure.subplots(2, 2, sharex="col")
    names = "(a) gravitational torque $g_2$", "(b) moment of inertia $M_{22}$"
    for (above, below), name, each in zip(panels.T, names, drawn["trajectories"], strict=True):
        above.plot(each["t"], each["v"], color=MODEL)
        below.plot(each["t"], each["Q"], color=MEASURED)
        above.set(title=name, ylabel=r"$\dot q_2$ [rad/s]")
        below.set(xlabel="time [s]", ylabel="$Q_2$ [N m]")
    return figure


def fig_4(_: Drawn, robot: Robot) -> Figure:
    """Frames of the robot file at q = 0, those of one origin beside each other."""
    figure = Figure(figsize=(WIDE, 3.9))
    panel = figure.add_subplot()
    pose, flat, size = np.eye(4), np.array([[1.0, -0.4, 0.0], [0.0, -0.3, 1.0]]), 0.15
    apart = np.array([[0, 0], [-0.3, -0.2], [0, 0], [0, 0], [0.35, 0], [0.7, 0]])
    chain = [np.zeros(2)]
    for k, aside in enumerate(apart):
        pose = pose @ robot.zero_pose(k)
        chain.append(flat @ pose[:3, 3])
        origin = chain[-1] + aside
        panel.plot(*np.array([chain[-1], origin]).T, ":", color=MUTED, lw=1)
        panel.plot(*origin, "o", color=INK, ms=4)
        for name, column, colour in (("x", 0, MEASURED), ("z", 2, MODEL)):
            arrow = size * flat @ pose[:3, column]
            panel.quiver(
                *origin, *arrow, color=colour, angles="xy", scale_units="xy", scale=1, width=0.004
            )
            panel.text(*(origin + 1.3 * arrow), f"${name}_{k + 1}$", color=colour, va="bottom")
    panel.plot(*np.array(chain).T, "-", color=MUTED, lw=5, alpha=0.35, zorder=0)
    for k, (label, aside) in enumerate((("$l_1$", (0.15, -0.08)), ("$l_2$", (-0.06, 0.3)))):
        panel.text(*(chain[2 + k] + aside), label)
    panel.set(xlim=(-0.5, 1.45), ylim=(-0.32, 0.98), aspect="equal")
    panel.axis("off")
    return figure


def fig_5(drawn: Drawn, _: Robot) -> Figure:
    """Gravity torques over the number of the configuration."""
    return _elements(drawn, "gravity", (2, 3, 4, 5), "$g_{}$ [N m]", (2, 2))


def fig_6(drawn: Drawn, _: Robot) -> Figure:
    """Moments of inertia over it, less what p_g gives of them."""
    return _elements(drawn, "inertia", range(1, 7), "$M_{{{0}{0}}}$ [kg m²]", (3, 2))


def _elements(drawn: Drawn, kind: str, axes: Any, label: str, shape: tuple[int, int]) -> Figure:
    figure = Figure(figsize=(WIDE, 2.1 * shape[0] + 0.4))
    panels = figure.subplots(*shape).flat
    marks = {"bare": ("o", "-", "without"), "loaded": ("x", "--", "with the load")}
    for panel, axis in zip(panels, axes, strict=True):
        for case, (mark, line, name) in marks.items():
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


def shown(drawn: Drawn, case: str, kind: str, axis: int) -> Array:
    """Number, measured value and model of one axis's elements, p_g compensated in those of M."""
    own = [each for each in drawn[case] if each["kind"] == kind]
    return np.array(
        [
            (n, *(each[k] - (each["of_gravity"] if kind == "inertia" else 0) for k in PAIR))
            for n, each in enumerate(own, start=1)
            if each["axis"] == axis
        ]
    )


PAIR = ("value", "model")


def fig_7(drawn: Drawn, _: Robot) -> Figure:
    """g3 over q4: measured, by the robot file, and with what was found."""
    figure = Figure(figsize=(WIDE, 3.1))
    panel = figure.add_subplot()
    q, value, model = of_fig_7(drawn).T
    panel.plot(q, model, "-", color=MODEL, label="model by the robot file")
    panel.plot(q, value, "o", color=MEASURED, label="measured")
    fine = np.radians(np.linspace(-175, 175, 200))
    panel.plot(np.degrees(fine), sinusoid(q, value)[0](fine), ":", color=MEASURED, label="sinusoid")
    panel.set(xlabel="$q_4$ [degrees]", ylabel="$g_3$ [N m]")
    panel.legend(ncols=3)
    return figure


def of_fig_7(drawn: Drawn) -> Array:
    """q4 [degrees], g3 measured and by the model: configurations 10 to 24."""
    own = [each for each in drawn["offset"]["elements"] if each["kind"] == "gravity"][9:24]
    return np.array([(each["q"][3], each["value"], each["model"]) for each in own])


def sinusoid(degrees: Array, torque: Array) -> tuple[Callable[[Array], Array], float]:
    """Sinusoid through torques over an angle, and its phase [degrees]."""
    q = np.radians(degrees)
    a = np.linalg.lstsq(np.column_stack([np.cos(q), np.sin(q), np.ones_like(q)]), torque)[0]
    phase = float(np.degrees(np.arctan2(a[1], a[0])))
    return lambda x: np.asarray(a[0] * np.cos(x) + a[1] * np.sin(x) + a[2]), phase


FIGURES: dict[str, Callable[[Drawn, Robot], Figure]] = {
    "1": fig_1, "2": fig_2, "3": fig_3, "4": fig_4, "5": fig_5, "6": fig_6, "7": fig_7,
}  # fmt: skip
