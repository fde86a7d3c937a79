"""A load from a short run beside a whole one, in the operator's words; kept in `load.yaml`."""

from __future__ import annotations

import math
import os
from importlib.metadata import version
from typing import TYPE_CHECKING, Literal

import numpy as np
import yaml
from scipy import special

from checked_files.yaml_file import FileModel
from hil.errors import Mismatch
from hil.estimation.load_beside_bare import fit_beside
from hil.estimation.load_columns import payload_names, without_mass
from hil.estimation.payload import require_load
from hil.estimation.payload_figures import CONTRADICTS, FIRST_MOMENTS, MASS, Payload
from hil.estimation.two_step_methods import prepare
from hil.model.robot_file import LINK_PARAMETERS
from hil.results.load_pose import helpful_poses, parameter_of
from hil.results.naming import named
from hil.results.payload_file import QuantityRecord
from hil.results.rounding import rounded, unit
from hil.results.stamp import RunStamp, same_recordings
from hil.runs.atomic_file import write_file
from hil.runs.journal import now
from hil.runs.pooling import pooled

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from hil.estimation.load_beside_bare import FittedLoad
    from hil.estimation.payload_figures import Quantity
    from hil.model.robot import Robot
    from hil.results.bare_run import BareRun
    from hil.results.load_pose import Pose
    from hil.runs.run import Run

    Array = NDArray[np.float64]

NAME = "load.yaml"
BESIDE = 0.001
"""Chance of a load's first moments across the last axis, were it on it, from which on it is not."""
LOOSE = 0.001
"""Chance of what a rigid load leaves, from which on it is not rigid."""
ROUGH = 0.1
"""Half-width of an interval from which a figure is rough, as share of its value."""


WHOLE_RUNS = "take two whole runs"
"""What helps where no pose does."""


class AxisRecord(FileModel):
    """How much more measurements of one axis contradict one another than without the load.

    Attributes
    ----------
    axis : int
        Number from 1.
    ratio : float
        Of mean squares.
    p_value : float
        Chance of one at least as great, were the load rigid.
    """

    axis: int
    ratio: float
    p_value: float


class LoadFile(FileModel):
    """Content of `load.yaml`.

    Attributes
    ----------
    without : RunStamp
    loaded : tuple of RunStamp
        The runs with the load.
    mass : float or None
        As it was stated [kg].
    verdict : tuple of str
        What the operator is to read, line by line.
    rigidity : tuple of AxisRecord
    unseen : tuple of str
        Parameters of the load that the robot file takes as zero.
    unidentifiable : tuple of str
        Those that the measurements leave open.
    """

    format: Literal[1] = 1
    made: str
    version: str
    without: RunStamp
    loaded: tuple[RunStamp, ...]
    mass: float | None
    verdict: tuple[str, ...]
    rigidity: tuple[AxisRecord, ...] = ()
    load: tuple[QuantityRecord, ...]
    unseen: tuple[str, ...]
    unidentifiable: tuple[str, ...]


def find_load(bare: BareRun, loaded: Sequence[Run], mass: float | None = None) -> Payload:
    """Find the load that `loaded` carry.

    Parameters
    ----------
    mass : float, optional
        Of the load, if it is known: held [kg].

    Raises
    ------
    FileError
        A damaged recording.
    Mismatch
        Another robot, recordings of the run without the load, or a mass that contradicts.
    NoLoad
        No load that stands out of its error.
    NotIdentifiable
        Recordings of which none can be used.
    """
    for run in loaded:
        _refuse_unfit(bare.run, run)
    with named(loaded[-1]):
        bare, found = _beside_axis(bare, loaded, _payload(bare, loaded, None))
        require_load(found)
        if mass is None:
            return found
        _refuse_contradiction(found, mass)
        return _payload(bare, loaded, mass)


def _beside_axis(bare: BareRun, loaded: Sequence[Run], found: Payload) -> tuple[BareRun, Payload]:
    """Take in what the robot file leaves out of the last link, where the load calls for it.

    A load beside the last axis, taken for one on it, contradicts itself as a loose one does. So its
    first moments across the axis are freed before that is said: it is taken for beside the axis if
    one of them stands out of its error, and it is rigid then.
    """
    wider = bare.beside_axis()
    if wider is bare:
        return bare, found
    beside = _payload(wider, loaded, None)
    newly = [k for k in FIRST_MOMENTS if LINK_PARAMETERS[k] in found.unseen]
    error = np.sqrt(np.diag(beside.phi_covariance))[newly]
    if not (newly and np.all(error > 0) and beside.degrees is not None) or is_loose(beside):
        return bare, found
    chance = 2 * special.stdtr(beside.degrees[newly], -np.abs(beside.phi[newly]) / error)
    return (wider, beside) if len(newly) * chance.min() <= BESIDE else (bare, found)


def estimate_load(bare: BareRun, loaded: Sequence[Run]) -> Payload:
    """The same before there is enough to say whether there is a load."""
    for run in loaded:
        _refuse_unfit(bare.run, run)
    with named(loaded[-1]):
        return _payload(bare, loaded, None)


def verdict(found: Payload, advice: Mapping[str, str] | None = None) -> tuple[str, ...]:
    """What was found, in sentences: figures with intervals, whether it is rigid, what is open.

    Parameters
    ----------
    advice : mapping of str to str, optional
        What would help, by the parameter of the load that is rough or open (`unsure`).
    """
    figures = [q for q in found.quantities() if q.name == "mass" or "centre" in q.name]
    lines = ["; ".join(_in_words(q) for q in figures)]
    lines += _of_rigidity(found)
    if not is_loose(found):
        lines += _of_unsure(found, advice or {})
    if found.unseen:
        lines.append(
            f"taken as zero: {', '.join(found.unseen)}, absent from the last link in the robot file"
        )
    return tuple(lines)


def unsure(found: Payload) -> tuple[str, ...]:
    """Parameters of the load that are rough or open, each once."""
    rough = [parameter_of(q.name) for q in _rough(found)]
    return tuple(dict.fromkeys([*rough, *found.unidentifiable]))


def advised(robot: Robot, poses: Mapping[str, Pose]) -> dict[str, str]:
    """What would help in words, by parameter."""
    return {name: _advice(robot, pose) for name, pose in poses.items()}


def _advice(robot: Robot, pose: Pose) -> str:
    to = f"to {100 * pose.share:.0f} % of its error by one more measurement, as predicted"
    if pose.position is None:
        return f"measure again with more strokes of axis {pose.axis} ({to})"
    turns = bool(robot.revolute[pose.axis - 1])
    at = f"{math.degrees(pose.position):.0f}" if turns else f"{pose.position:.2g}"
    unit_of = "degrees" if turns else "m"
    return (
        f"measure again with axis {pose.axis} at {at} {unit_of}: --pose axis{pose.axis}={at} ({to})"
    )


def _of_unsure(found: Payload, advice: Mapping[str, str]) -> Iterator[str]:
    """What is rough or open, and what would help; what the same would help in one line."""
    else_ = "" if found.stated_mass else ", or state the mass"
    rough = _rough(found)
    for help_ in dict.fromkeys(advice.get(parameter_of(q.name), WHOLE_RUNS) for q in rough):
        listed = ", ".join(
            f"{q.name} (± {100 * q.half_width / abs(q.value):.0f} %)"
            for q in rough if advice.get(parameter_of(q.name), WHOLE_RUNS) == help_
        )  # fmt: skip
        yield f"rough: {listed}; {help_}{else_}"
    for name in found.unidentifiable:
        yield f"not identifiable: {name}; {advice.get(name, WHOLE_RUNS)}"


def _rough(found: Payload) -> list[Quantity]:
    """Mass and moments of inertia about the centre whose intervals are wide."""
    return [
        q for q in found.quantities()
        if q.name in {"mass", *(f"I{k}{k} about the centre" for k in "xyz")}
        and q.standard_error and q.half_width > ROUGH * abs(q.value)
    ]  # fmt: skip


def is_loose(found: Payload) -> bool:
    """Whether the axes' torques contradict a load that is rigid and fixed, or no body is so."""
    return _rigid_chance(found) <= LOOSE or _is_no_body(found)


def _is_no_body(found: Payload) -> bool:
    """Whether a moment of inertia about the centre is negative beyond its error."""
    least = found.least_inertia()
    return least is not None and least[1] <= LOOSE


def _rigid_chance(found: Payload) -> float:
    """Chance of the worst axis's misfit, as one of so many that were tested."""
    chances = [each.p_value for each in found.misfit]
    return min(1.0, len(chances) * min(chances)) if chances else 1.0


def _of_rigidity(found: Payload) -> list[str]:
    if not found.misfit:
        return []
    chance, least = _rigid_chance(found), found.least_inertia()
    if least is not None and _is_no_body(found):
        return [
            f"not rigid, not fixed, or friction changed with it: no body has the inertia that was"
            f" found, with {_in_words(least[0])} about an axis through the centre; fasten the load"
            " and its cables, empty what can flow, and measure again"
        ]
    if not is_loose(found):
        axes = ", ".join(str(each.axis + 1) for each in found.misfit)
        return [f"rigid and fixed, as far as axes {axes} show (p = {chance:.2g})"]
    worst = min(found.misfit, key=lambda each: each.p_value)
    return [
        f"not rigid, not fixed, or friction changed with it: measurements of axis {worst.axis + 1}"
        f" contradict one another {np.sqrt(worst.ratio):.2g} times as much as without the load"
        f" (p = {chance:.2g}); fasten the load and its cables, empty what can flow, and measure"
        " again"
    ]


def write_load(path: Path, bare: BareRun, loaded: Sequence[Run], found: Payload) -> LoadFile:
    """Write `load.yaml` into the folder `path`, whole or not at all, and return it."""
    plans = [run.planned for run in loaded]
    stated = [name for name in unsure(found) if bare.free[LINK_PARAMETERS.index(name)].any()]
    advice = advised(bare.robot, helpful_poses(bare, plans, found, stated))
    kept = LoadFile(
        made=now(),
        version=version("canopen-robot-identification"),
        without=_stamp(bare.run, path),
        loaded=tuple(_stamp(run, path) for run in loaded),
        mass=found.stated_mass,
        verdict=verdict(found, advice),
        rigidity=tuple(
            AxisRecord(axis=each.axis + 1, ratio=each.ratio, p_value=each.p_value)
            for each in found.misfit
        ),
        load=tuple(QuantityRecord.of(q) for q in found.quantities()),
        unseen=found.unseen,
        unidentifiable=found.unidentifiable,
    )
    text = yaml.safe_dump(
        kept.model_dump(mode="json"), sort_keys=False, width=100, allow_unicode=True
    )
    write_file(path / NAME, text.encode())
    return kept


def _stamp(run: Run, path: Path) -> RunStamp:
    """Stamp of a run, its folder as seen from `path`."""
    return RunStamp.of(run).model_copy(update={"folder": os.path.relpath(run.path, path)})


def _refuse_unfit(bare: Run, loaded: Run) -> None:
    if bare.robot.digest != loaded.robot.digest:
        raise Mismatch(
            f"{loaded.path}: was measured with another robot file than {bare.path}; name the run"
            " without the load of this robot"
        )
    if same_recordings(bare, loaded):
        raise Mismatch(
            f"{loaded.path}: has the same recordings as {bare.path}; measure with the load into a"
            " folder of its own"
        )


def _refuse_contradiction(found: Payload, mass: float) -> None:
    m, error = found.phi[MASS], np.sqrt(found.phi_covariance[MASS, MASS])
    if abs(m - mass) > CONTRADICTS * error:
        raise Mismatch(
            f"a mass of {mass:g} kg contradicts {m:.4g} ± {error:.2g} kg by these runs; correct the"
            f" mass, or are torque constants off by {100 * (m / mass - 1):.2g} %? hil payload"
            " WITHOUT LOADED --mass finds them from two whole runs"
        )


def _payload(bare: BareRun, loaded: Sequence[Run], mass: float | None) -> Payload:
    robot, free, still = bare.robot, bare.free, np.zeros(10)
    if mass is not None:
        still[MASS], free = mass, without_mass(free)
    raw, _ = prepare(pooled(loaded))
    train = bare.estimate.drive_train
    prepared = raw if train is None else [(m, train.applied(bare.run.robot, s)) for m, s in raw]
    fit = fit_beside(robot, bare.fit, prepared, bare.columns @ free, bare.columns @ still)
    seen = np.where(fit.lost, 0.0, 1.0)
    covariance = np.outer(seen, seen) * (fit.scatter + fit.drives)
    phi = still + free @ (seen * fit.phi)
    change, phi_covariance = bare.columns @ phi, free @ covariance @ free.T
    of_change = bare.columns @ phi_covariance @ bare.columns.T
    absent, _ = payload_names(robot)
    open_ones = np.abs(free) @ fit.lost > 0
    return Payload(
        before=fit.p,
        after=fit.p + change,
        change=change,
        standard_error=np.sqrt(np.diag(of_change)),
        expected=change,
        covariance=of_change,
        phi=phi,
        phi_covariance=phi_covariance,
        stated_mass=mass,
        unseen=absent,
        chi_squared=0.0,
        degrees_of_freedom=0,
        unidentifiable=tuple(name for name, is_open in zip(LINK_PARAMETERS, open_ones, strict=True)
                             if is_open),
        degrees=_degrees(fit, free),
        misfit=fit.misfit,
    )  # fmt: skip


def _degrees(fit: FittedLoad, free: Array) -> Array:
    """Of the load's ten: stated errors have as many as one likes, and scatter has few."""
    scatter, total = np.diag(fit.scatter), np.diag(fit.scatter + fit.drives)
    ratio = np.divide(total, scatter, out=np.ones_like(total), where=scatter > 0)
    found: Array = np.maximum(np.abs(free) @ (fit.degrees * ratio**2), 1.0)
    return found


def _in_words(q: Quantity) -> str:
    if not q.standard_error:
        return f"{q.name} {q.value:g} {unit(q.unit)} as stated"
    value, half = (rounded(each, q.half_width) for each in (q.value, q.half_width))
    return f"{q.name} {value} ± {half} {unit(q.unit)}"
