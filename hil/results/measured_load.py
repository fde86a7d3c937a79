"""A load from a short run beside a whole one, in the operator's words; kept in `load.yaml`."""

from __future__ import annotations

import os
from importlib.metadata import version
from typing import TYPE_CHECKING, Literal

import numpy as np
import yaml

from checked_files.yaml_file import FileModel
from hil.errors import Mismatch
from hil.estimation.load_beside_bare import fit_beside
from hil.estimation.payload import payload_names, require_load, without_mass
from hil.estimation.payload_figures import MASS, Payload
from hil.estimation.two_step_methods import prepare
from hil.model.robot_file import LINK_PARAMETERS
from hil.results.naming import named
from hil.results.payload_file import QuantityRecord
from hil.results.rounding import rounded
from hil.results.stamp import RunStamp, same_recordings
from hil.results.tables.cells import unit
from hil.runs.atomic_file import write_file
from hil.runs.journal import now
from hil.runs.pooling import pooled

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from hil.estimation.load_beside_bare import FittedLoad
    from hil.estimation.payload_figures import Quantity
    from hil.results.bare_run import BareRun
    from hil.runs.run import Run

    Array = NDArray[np.float64]

NAME = "load.yaml"
CONTRADICTS = 4.0
"""Standard errors between a stated mass and the one that is found, from which they contradict."""
ROUGH = 0.1
"""Half-width of an interval from which a figure is rough, as share of its value."""


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
        found = _payload(bare, loaded, None)
        require_load(found)
        if mass is None:
            return found
        _refuse_contradiction(found, mass)
        return _payload(bare, loaded, mass)


def estimate_load(bare: BareRun, loaded: Sequence[Run]) -> Payload:
    """The same before there is enough to say whether there is a load."""
    for run in loaded:
        _refuse_unfit(bare.run, run)
    with named(loaded[-1]):
        return _payload(bare, loaded, None)


def verdict(found: Payload) -> tuple[str, ...]:
    """What was found, in sentences: figures with intervals, what is rough, what is open."""
    figures = found.quantities()
    told = [q for q in figures if q.name == "mass" or "centre" in q.name]
    lines = ["; ".join(_in_words(q) for q in told)]
    rough = [q for q in told if q.standard_error and q.half_width > ROUGH * abs(q.value)
             and not q.name.startswith("centre")]  # fmt: skip
    if rough:
        listed = ", ".join(f"{q.name} (± {100 * q.half_width / abs(q.value):.0f} %)" for q in rough)
        lines.append(f"rough: {listed}; take two whole runs, or state the mass")
    if found.unidentifiable:
        lines.append(
            f"not identifiable: {', '.join(found.unidentifiable)}; no measurement of this run shows"
            " them: measure again with more --minutes, or with wider joint ranges"
        )
    if found.unseen:
        lines.append(
            f"taken as zero: {', '.join(found.unseen)}, absent from the last link in the robot file"
        )
    return tuple(lines)


def write_load(path: Path, bare: BareRun, loaded: Sequence[Run], found: Payload) -> LoadFile:
    """Write `load.yaml` into the folder `path`, whole or not at all, and return it."""
    kept = LoadFile(
        made=now(),
        version=version("canopen-robot-identification"),
        without=_stamp(bare.run, path),
        loaded=tuple(_stamp(run, path) for run in loaded),
        mass=found.stated_mass,
        verdict=verdict(found),
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
    raw, _ = prepare(robot, pooled(loaded))
    train = bare.estimate.drive_train
    prepared = raw if train is None else [(m, train.applied(robot, s)) for m, s in raw]
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
