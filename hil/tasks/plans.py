"""Plans of every kind: strokes for base parameters, friction, an exciting trajectory, a load.

Each kind is a function with its own options; `designed` finds the function by name and refuses
options of another kind or incompatible options, with the reason.
"""

from __future__ import annotations

import re
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from hil.errors import InvalidValue

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from hil.model.robot import Robot
    from hil.planning.design.trajectories import ExcitationCriterion
    from hil.planning.plan import Plan
    from hil.planning.prediction.information import Precision
    from hil.planning.workspace import Workspace
    from hil.results.load import BareRun
    from hil.runs.run import Run
    from hil.show.table import Table

    Now = Callable[[str], None]

MINUTES = 10.0
"""Default duration of a plan with --refine [min]."""


class Unsuited(InvalidValue):
    """Incompatible options.

    Attributes
    ----------
    text : str
        Reason, with the options in command-line form.
    """

    def __init__(self, text: str) -> None:
        super().__init__(re.sub(r"--([a-z-]+)", lambda found: found[1].replace("-", "_"), text))
        self.text = text


class Designed(NamedTuple):
    """Plan and robot, with tables to show; precision before and after a refinement."""

    plan: Plan
    robot: Robot
    shown: tuple[Table | str, ...] = ()
    refinement: tuple[Precision, Precision] | None = None


def designed(kind: str, now: Now = lambda _: None, **options: Any) -> Designed:
    """Design a plan of a kind.

    Parameters
    ----------
    kind : {"strokes", "friction", "trajectory", "load"}
    now : callable
        Function called with the description of the present computation.
    **options
        Options of the kind; left-out options, or None, have their defaults.

    Raises
    ------
    Unsuited
        Options of another kind, or incompatible options.
    InvalidValue
        Values without a possible plan.
    """
    options = {name: value for name, value in options.items() if value not in (None, False, [])}
    for name in options:
        kinds = [each for each, design in KINDS.items() if name in signature(design).parameters]
        if kind not in kinds:
            option, taking = f"--{name.replace('_', '-')}", " and ".join(kinds)
            why = _REASONS.get((kind, name), f"it is for {taking or 'no kind of plan'}")
            raise Unsuited(f"{option} does not apply to kind {kind}: {why}; omit the option")
    return KINDS[kind](now=now, **options)


def plan(robot: Robot | Path | str | None = None, kind: str = "strokes", **options: Any) -> Plan:
    """Plan measurements.

    Parameters
    ----------
    robot : Robot, path or str, optional
        Built-in robot or robot file; unnecessary with `refine` and for the kind ``load``, where a
        run states the robot.
    kind : {"strokes", "friction", "trajectory", "load"}
        Strokes for base parameters, sweeps for friction, a periodic trajectory, or slow strokes for
        the mass of a load.
    **options
        As in ``hil plan``, with underscores. For strokes: ``gravity``, ``inertia``, ``coupling``,
        ``minutes``, ``with_trajectories``, ``distinguish``, ``refine``, ``noise_from``, ``warm_up``
        [s], ``workspace``; for friction: ``experiment``, ``axis`` (a list, from 1), ``workspace``;
        for a trajectory: ``minutes``, ``period`` [s], ``criterion``, ``harmonics``, ``seed``,
        ``warm_up``, ``drives``; for a load: ``model`` (a run), ``minutes``, ``at_most`` [kg],
        ``pose`` (axes from 0 and positions), ``refine``.

    Returns
    -------
    Plan
        Plan to be checked by `hil.dry_run` and measured by `hil.measure`.

    Raises
    ------
    InvalidValue
        Incompatible options, or values without a possible plan.

    Examples
    --------
    >>> plan = hil.plan("manutec-r15", "friction", axis=[6])
    >>> len(plan.measurements), plan.measurements[0].id
    (16, 'f6-01')
    """
    from hil.model.robot import Robot, refuse_unknown
    from hil.planning.plan import load_workspace

    if robot is not None:
        robot = robot if isinstance(robot, Robot) else Robot.load(robot)
        refuse_unknown(robot)
        if isinstance(place := options.get("workspace"), (str, Path)):
            options["workspace"] = load_workspace(Path(place), robot)
    return designed(kind, robot=robot, **options).plan


def _refuse(*cases: tuple[object, str]) -> None:
    """Refuse the first applicable case, with the reason."""
    for holds, why in cases:
        if holds:
            raise Unsuited(why)


def _strokes(
    now: Now,
    robot: Robot | None = None,
    gravity: int | None = None,
    inertia: int | None = None,
    coupling: int | None = None,
    minutes: float | None = None,
    with_trajectories: bool = False,
    distinguish: str | None = None,
    refine: Sequence[Path] = (),
    noise_from: Path | None = None,
    warm_up: float = 0.0,
    workspace: Workspace | None = None,
) -> Designed:
    """Design strokes from g(q) and M(q): for earlier runs, by minutes, by counts, or for causes."""
    asked = {"gravity": gravity, "inertia": inertia, "coupling": coupling}
    counts = {kind: number for kind, number in asked.items() if number is not None}
    _refuse(
        ((robot is None) == (not refine), "give either a robot, or a run with --refine"),
        (
            counts and (minutes is not None or refine),
            "--gravity, --inertia and --coupling are for a plan by counts; omit them with "
            "--minutes and --refine, which choose the counts",
        ),
        (
            refine and (warm_up or workspace is not None or noise_from is not None),
            "--refine takes workspace and noise from the run; omit --warm-up, --workspace and "
            "--noise-from",
        ),
        (
            with_trajectories and refine,
            "--with-trajectories cannot be used with --refine, which chooses among strokes",
        ),
        (
            with_trajectories and minutes is None,
            "--with-trajectories needs --minutes, to choose among all kinds; for only "
            "trajectories use kind trajectory",
        ),
        (
            distinguish is not None and (refine or minutes is not None),
            "--distinguish extends a plan by counts as far as needed; omit --minutes and --refine",
        ),
        (
            noise_from is not None and minutes is None and distinguish is None,
            "--noise-from is for --minutes and --distinguish; a plan by counts uses no noise",
        ),
    )
    if robot is None:
        from hil.planning.design.by_minutes import refine as refined
        from hil.planning.prediction.information import information, precision
        from hil.tasks.measuring import experience_of

        now("reading earlier runs")
        folders, (noise, known, _) = experience_of(refine)
        first, robot, minutes = folders[0], folders[0].robot, minutes or MINUTES
        taken = {measurement.id for folder in folders for measurement in folder.motions}
        now(f"choosing the most informative measurements in {minutes:g} minutes")
        plan = refined(robot, minutes, noise, known, first.planned, taken)
        more = information(robot, plan.measurements, plan.sample_period, noise)
        before, then = (precision(robot, each, noise.source) for each in (known, known + more))
        return Designed(plan, robot, refinement=(before, then))
    if minutes is not None:
        from hil.planning.design.by_minutes import design_within
        from hil.tasks.measuring import expected_of

        now(f"choosing the most informative measurements in {minutes:g} minutes")
        noise = expected_of(robot, noise_from).noise
        plan = design_within(
            robot, minutes, noise, warm_up, workspace, with_trajectories=with_trajectories
        )
        return Designed(plan, robot)
    from hil.planning.design.by_counts import design

    now("choosing measurements")
    named = None
    if distinguish is not None:
        from hil.estimation.excluded import distinguishing

        named = distinguishing.causes_named(robot, distinguish)
    plan = design(robot, counts, warm_up, workspace)
    if named is None:
        return Designed(plan, robot)
    from hil.results.tables import excluded
    from hil.tasks.measuring import expected_of

    now("choosing measurements that distinguish causes")
    expected = expected_of(robot, noise_from)
    reached = distinguishing.distinguish(plan, robot, expected.noise, expected.p, named)
    table = excluded.distinguished(reached, expected.source)
    return Designed(reached.plan, robot, (table, *excluded.distinguishing(reached)))


def _friction(
    now: Now,
    robot: Robot | None = None,
    experiment: str = "sweep",
    axis: Sequence[int] = (),
    workspace: Workspace | None = None,
) -> Designed:
    """Design friction measurements of axes, from 1: a sweep, or an experiment on drift."""
    from hil.planning.design import friction

    robot = _required(robot)
    beyond = [number for number in axis if not 1 <= number <= robot.n_joints]
    _refuse(
        (beyond, f"--axis {', '.join(map(str, beyond))} must be in 1 ... {robot.n_joints}"),
        (
            experiment != "sweep" and len(axis) != 1,
            f"{experiment} takes one axis; give it with --axis",
        ),
    )
    now("choosing speeds")
    if experiment == "sweep":
        axes = [number - 1 for number in axis]
        return Designed(friction.sweep(robot, axes, workspace=workspace), robot)
    design = friction.stops if experiment == "stops" else friction.operation
    return Designed(design(robot, axis[0] - 1, workspace=workspace), robot)


def _trajectory(
    now: Now,
    robot: Robot | None = None,
    minutes: float = 5.0,
    period: float | None = None,
    criterion: ExcitationCriterion = "det",
    harmonics: int | None = None,
    seed: int = 0,
    warm_up: float = 0.0,
    drives: Path | None = None,
) -> Designed:
    """Design a periodic trajectory of each branch within the limits, repeated as time permits."""
    from hil.planning.design import trajectories
    from hil.planning.plan import make_plan
    from hil.tasks.measuring import following_of, known_drives

    robot = _required(robot)
    period, harmonics = period or trajectories.PERIOD, harmonics or trajectories.HARMONICS
    branches = range(len(robot.branches))
    cycles = max(1, round(60 * minutes / period / len(branches)))
    following = following_of(known_drives(robot, drives))
    now(f"optimising a trajectory of {robot.n_joints} axes and {harmonics} harmonics")
    found = [
        trajectories.design_trajectory(
            robot, period, cycles, criterion, seed, branch=branch,
            harmonics=harmonics, speed=following.speed if following else None,
        )
        for branch in branches
    ]  # fmt: skip
    notes = tuple(
        f"{cycles} periods of {period:g} s of {each.axes_in_words}, condition number "
        f"{trajectories.condition(robot, each):.3g}"
        for each in found
    )
    return Designed(make_plan(robot, found, warm_up), robot, notes)


def _load(
    now: Now,
    model: Run | BareRun | None = None,
    minutes: float = 3.0,
    at_most: float | None = None,
    pose: tuple[tuple[int, float], ...] = (),
    refine: Sequence[Path] = (),
) -> Designed:
    """Design slow strokes for a load, after a run without load; faster strokes with `refine`."""
    from hil.planning.design.load import REACH, fast_plan, load_capacity, slow_plan
    from hil.results.load import BareRun, estimate_load
    from hil.runs.run import Run

    if model is None:
        raise Unsuited("kind load needs the run without the load: --model")
    _refuse(
        (len(refine) > 1, "kind load takes one run with --refine, the run of slow strokes"),
        (
            refine and at_most is not None,
            "--at-most is for slow strokes; with --refine the load is known",
        ),
    )
    now("reading the run without the load")
    bare = model if isinstance(model, BareRun) else BareRun(model)
    known = bare.known
    if refine:
        now("estimating the load and choosing faster measurements")
        slow = Run.open(refine[0])
        found = estimate_load(bare, [slow])
        return Designed(fast_plan(known, minutes, slow.planned, found, pose), known.robot)
    now("choosing slow measurements")
    plan = slow_plan(known, minutes, at_most, pose)
    held = (
        f"all axes hold a load of {load_capacity(known, plan):.3g} kg in these poses, with its "
        f"centre of mass up to {REACH:g} m from the last frame"
    )
    return Designed(plan, known.robot, (held,))


def _required(robot: Robot | None) -> Robot:
    if robot is None:
        raise Unsuited("give a robot")
    return robot


KINDS: dict[str, Callable[..., Designed]] = {
    "strokes": _strokes, "friction": _friction, "trajectory": _trajectory, "load": _load,
}  # fmt: skip
_REASONS = {
    ("load", "robot"): "the robot is that of the run without the load (--model)",
    ("load", "workspace"): "the workspace is that of the run without the load",
    ("trajectory", "workspace"): "trajectories are only checked against joint limits",
    ("friction", "minutes"): "the experiment determines speeds and durations",
}
"""Reasons for refusing an option of another kind, if more specific than the kind's name."""
