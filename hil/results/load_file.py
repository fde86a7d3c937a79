"""Record of a load and of its runs: `load.yaml`.

The file names its recordings, so that reports show a load without a new computation: Table 3,
parameters of the load, gains of the drives, and Figs. 5 and 6. `payload.yaml` of earlier versions
is read as well.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator

from checked_files.yaml_file import FileModel
from hil.estimation.loads.figures import AxisMisfit, Figure
from hil.model.base_parameters import base_parameters, link_share
from hil.model.drive_train_file import USUAL_BOUND
from hil.model.load import load_columns
from hil.planning.measurement import ELEMENT_KINDS
from hil.results.provenance import KeptResult, RunStamp, same_parameters
from hil.runs.journal import now
from hil.version import __version__

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from hil.arrays import Array
    from hil.estimation.estimate import Estimate
    from hil.estimation.loads.figures import Load
    from hil.model.robot import Robot
    from hil.results.load import LoadFit
    from hil.runs.run import Run


NAME = "load.yaml"
DRAWN = tuple(name for name, kind in ELEMENT_KINDS.items() if kind.figure)
"""Kinds of measurement in figures of the paper."""


def _drawn(kind: str) -> str:
    if kind not in DRAWN:
        raise ValueError(f"{kind!r} must be one of {', '.join(DRAWN)}")
    return kind


class ParameterChange(FileModel):
    """Column of Table 3: a base parameter without and with the load."""

    name: str
    meaning: str = ""
    unit: str
    without: float
    loaded: float
    change: float
    standard_error: float
    expected: float
    share: str
    """Expression of the change in the parameters of the load."""


class GainRecord(FileModel):
    """Gain of one axis by the known mass; `error` is relative.

    Torque constant [N m/A]. For imported runs: factor of the gain in the map, or, if the map states
    an unknown gain, N m or N per unit of the signal without an assumed value.
    """

    axis: int
    assumed: float | None
    told: bool
    corrected: float | None
    standard_error: float | None
    error: float | None
    error_standard_error: float | None


class ElementRecord(FileModel):
    """Measured and modelled element of g(q) or M(q) of one measurement."""

    id: str
    kind: Annotated[str, AfterValidator(_drawn)]
    axis: int
    value: float
    standard_error: float | None
    model: float


class LoadFile(KeptResult):
    """Content of `load.yaml`.

    Attributes
    ----------
    loaded : tuple of RunStamp
        Runs with the load.
    mass : float or None
        Stated mass [kg].
    verdict : tuple of str
        Sentences for the operator.
    unseen : tuple of str
        Parameters of the load that the robot file states as zero.
    unidentifiable : tuple of str
        Parameters of the load without information in the recordings.
    changes : tuple of ParameterChange
        Changes between two runs that each identify the robot; empty otherwise, as are the
        attributes below.
    chi_squared, degrees_of_freedom, p_value
        Test of the changes against a rigid load.
    imported : bool
        True for an imported loaded run.
    own : tuple of float
        Base parameters of the loaded run alone with the gains of its map; empty if equal to those
        in `changes`, or unknown.
    elements_without, elements_loaded : tuple of ElementRecord
        Elements of Figs. 5 and 6 in the order of the plans; axes count from 1.
    """

    names = NAME, "payload.yaml"
    format: Literal[1] = 1
    made: str
    version: str
    without: RunStamp
    loaded: Annotated[
        tuple[RunStamp, ...], BeforeValidator(lambda x: [x] if isinstance(x, dict) else x)
    ]
    mass: float | None
    verdict: tuple[str, ...] = ()
    rigidity: tuple[AxisMisfit, ...] = ()
    load: tuple[Figure, ...]
    unseen: tuple[str, ...]
    unidentifiable: tuple[str, ...] = ()
    changes: tuple[ParameterChange, ...] = ()
    chi_squared: float = 0.0
    degrees_of_freedom: int = 0
    p_value: float = 1.0
    imported: bool = False
    own: tuple[float, ...] = ()
    gains: tuple[GainRecord, ...] = ()
    elements_without: tuple[ElementRecord, ...] = ()
    elements_loaded: tuple[ElementRecord, ...] = ()

    def stale(self, folder: Run, p: Array) -> str:
        """Return the reason if the file does not match the present runs; empty if it does.

        Parameters
        ----------
        p : ndarray, shape (n_base,)
            Present base parameters of the loaded run.
        """
        return (
            self.loaded[-1].change(folder)
            or self.without.change_beside(folder)
            or same_parameters(self.own or [each.loaded for each in self.changes], p)
        )


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def write_load(
    path: Path, without: Run, loaded: Sequence[Run], found: LoadFit, verdict: Sequence[str]
) -> LoadFile:
    """Write `load.yaml` into the folder `path`, atomically; return its content."""
    load, before, after, own = found.load, found.before, found.after, found.own
    kept = LoadFile(
        made=now(),
        version=__version__,
        without=RunStamp.create(without, path),
        loaded=tuple(RunStamp.create(run, path) for run in loaded),
        mass=load.stated_mass,
        verdict=tuple(verdict),
        rigidity=load.misfit,
        load=tuple(load.quantities()),
        unseen=load.unseen,
        unidentifiable=load.unidentifiable,
        chi_squared=load.rigid.square,
        degrees_of_freedom=load.rigid.directions,
        p_value=load.rigid.p_value,
        imported=loaded[-1].imported,
        changes=_changes(without.robot, load, before, after) if before and after else (),
        own=() if own is None or own is after else tuple(own.values.tolist()),
        gains=_gains(found.by_mass, found.assumed) if found.by_mass else (),
        elements_without=_elements(before),
        elements_loaded=_elements(after),
    )
    kept.write(path)
    return kept


def _changes(
    robot: Robot, load: Load, before: Estimate, after: Estimate
) -> tuple[ParameterChange, ...]:
    """Return the changes between two estimates; common errors of the drives cancel."""
    base, shares = base_parameters(robot), link_share(robot, robot.n_joints - 1)
    expected = load_columns(robot).K @ load.phi
    drives = after.drive_effect - before.drive_effect
    scatter = before.scatter_covariance + after.scatter_covariance
    variance = np.diag(scatter) + (drives**2).sum(axis=1)
    return tuple(
        ParameterChange(
            name=name,
            meaning=base.meanings[k],
            unit=base.units[k],
            without=float(before.values[k]),
            loaded=float(after.values[k]),
            change=float(after.values[k] - before.values[k]),
            standard_error=float(np.sqrt(variance[k])),
            expected=float(expected[k]),
            share=shares[k],
        )
        for k, name in enumerate(base.names)
    )


def _gains(found: Load, assumed: Array) -> tuple[GainRecord, ...]:
    """Return the gains; gains less certain than usual torque constants are not identifiable."""
    gain, relative, unknown = found.gains, found.gain_errors, np.isnan(assumed)
    constant = gain * np.where(unknown, 1.0, assumed)
    error = np.where(unknown, np.nan, 1.0 / gain - 1.0)
    of_error = np.where(unknown, relative, relative / gain)
    return tuple(
        GainRecord(
            axis=k + 1,
            assumed=_finite(each),
            told=bool(relative[k] < USUAL_BOUND),
            corrected=_finite(constant[k]),
            standard_error=_finite(constant[k] * relative[k]),
            error=_finite(error[k]),
            error_standard_error=_finite(of_error[k]),
        )
        for k, each in enumerate(assumed)
    )


def _elements(estimate: Estimate | None) -> tuple[ElementRecord, ...]:
    return tuple(
        ElementRecord(
            id=value.id,
            kind=value.kind,
            axis=value.axis + 1,
            value=value.shown[0],
            standard_error=_finite(value.shown[1]),
            model=value.model,
        )
        for value in (estimate.local if estimate else ())
        if value.kind in DRAWN
    )
