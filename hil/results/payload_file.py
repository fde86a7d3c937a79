"""`payload.yaml`: a load as it was found from two runs, in the folder of the loaded one.

Reports show it without computing it again: Table 3, the load, the drives' gains, and what Figs. 5
and 6 need of both runs. The file says of which recordings it was made.
"""

from __future__ import annotations

from importlib.metadata import version
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
import yaml
from pydantic import AfterValidator

from checked_files.yaml_file import FileModel, load_yaml
from hil.model.base_parameters import base_parameters, link_share
from hil.planning.measurement import ELEMENT_KINDS
from hil.results.stamp import RunStamp, same_parameters
from hil.runs.atomic_file import write_file
from hil.runs.journal import now

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.estimation.estimate import Estimate
    from hil.estimation.payload_figures import Quantity
    from hil.estimation.torque_constants import Gains
    from hil.results.payload import FoundPayload
    from hil.runs.run import Run

    Array = NDArray[np.float64]

NAME = "payload.yaml"
DRAWN = tuple(name for name, kind in ELEMENT_KINDS.items() if kind.figure)
"""Kinds of measurement that figures of the paper show."""


def _drawn(kind: str) -> str:
    if kind not in DRAWN:
        raise ValueError(f"{kind!r} must be one of {', '.join(DRAWN)}")
    return kind


class Change(FileModel):
    """A column of Table 3: one base parameter without and with the load."""

    name: str
    unit: str
    without: float
    loaded: float
    change: float
    standard_error: float
    expected: float
    share: str
    """Of the load in it."""


class QuantityRecord(FileModel):
    """A figure of the load."""

    name: str
    value: float
    standard_error: float
    half_width: float | None = None
    """Of the interval of 95 %."""
    unit: str

    @classmethod
    def of(cls, figure: Quantity) -> QuantityRecord:
        """What is kept of a figure."""
        return cls(
            name=figure.name,
            value=figure.value,
            standard_error=figure.standard_error,
            half_width=figure.half_width,
            unit=figure.unit,
        )


class GainRecord(FileModel):
    """Gain of one axis by the known mass; `error` is relative.

    A torque constant [N m/A]; or of imported runs a factor of the map's gain, or where the map
    leaves that unknown N m or N for one unit of the signal, and nothing is assumed.
    """

    axis: int
    assumed: float | None
    told: bool
    corrected: float | None
    standard_error: float | None
    error: float | None
    error_standard_error: float | None


class ElementRecord(FileModel):
    """One measurement by itself: an element of g(q) or M(q), measured and modelled."""

    id: str
    kind: Annotated[str, AfterValidator(_drawn)]
    axis: int
    value: float
    standard_error: float | None
    model: float


class PayloadFile(FileModel):
    """Content of `payload.yaml`.

    Attributes
    ----------
    without, loaded : RunStamp
    mass : float or None
        As it was stated [kg].
    chi_squared, degrees_of_freedom, p_value
        Of what a rigid load leaves of the changes.
    unseen : tuple of str
        Parameters of the load that the robot file takes as zero.
    unidentifiable : tuple of str
        Parameters of the load that the recordings do not determine.
    imported : bool
        Whether the runs were imported.
    own : tuple of float
        Base parameters of the loaded run alone, with the gains that its map states; empty where
        these are the changes' or where there are none.
    elements_without, elements_loaded : tuple of ElementRecord
        What Figs. 5 and 6 are drawn from, in the plans' order; axes count from 1.
    """

    format: Literal[1] = 1
    made: str
    version: str
    without: RunStamp
    loaded: RunStamp
    mass: float | None
    changes: tuple[Change, ...]
    load: tuple[QuantityRecord, ...]
    chi_squared: float
    degrees_of_freedom: int
    p_value: float
    unseen: tuple[str, ...]
    unidentifiable: tuple[str, ...] = ()
    imported: bool = False
    own: tuple[float, ...] = ()
    gains: tuple[GainRecord, ...]
    elements_without: tuple[ElementRecord, ...]
    elements_loaded: tuple[ElementRecord, ...]

    def stale(self, folder: Run, p: Array) -> str:
        """Why it does not belong to these runs as they are now; empty if it does.

        Parameters
        ----------
        p : ndarray, shape (n_base,)
            Base parameters that the loaded run has now.
        """
        return (
            self.loaded.change(folder)
            or self.without.change_beside(folder)
            or same_parameters(self.own or [each.loaded for each in self.changes], p)
        )


def write_payload(without: Run, loaded: Run, found: FoundPayload) -> PayloadFile:
    """Write `payload.yaml` into the loaded run's folder, whole or not at all, and return it."""
    kept = _content(without, loaded, found)
    text = yaml.safe_dump(kept.model_dump(mode="json"), sort_keys=False, width=100)
    write_file(loaded.path / NAME, text.encode())
    return kept


def read_payload(folder: Run) -> PayloadFile | None:
    """Read what was found of a load in a run, if anything was.

    Raises
    ------
    FileError
        A damaged file.
    """
    path = folder.path / NAME
    return load_yaml(path, PayloadFile) if path.exists() else None


def _content(without: Run, loaded: Run, found: FoundPayload) -> PayloadFile:
    payload = found.payload
    return PayloadFile(
        made=now(),
        version=version("canopen-robot-identification"),
        without=RunStamp.of(without, beside=loaded),
        loaded=RunStamp.of(loaded),
        mass=payload.stated_mass,
        changes=_changes(found),
        load=tuple(QuantityRecord.of(q) for q in payload.quantities()),
        chi_squared=payload.chi_squared,
        degrees_of_freedom=payload.degrees_of_freedom,
        p_value=payload.p_value,
        unseen=payload.unseen,
        unidentifiable=payload.unidentifiable,
        imported=loaded.imported,
        own=() if found.own is None or found.own is found.after else tuple(found.own.p.tolist()),
        gains=_gains(found, found.gains) if found.gains else (),
        elements_without=_elements(found.before),
        elements_loaded=_elements(found.after),
    )


def _changes(found: FoundPayload) -> tuple[Change, ...]:
    base, payload = base_parameters(found.robot), found.payload
    shares = link_share(found.robot, found.robot.n_joints - 1)
    return tuple(
        Change(
            name=name,
            unit=base.units[k],
            without=float(payload.before[k]),
            loaded=float(payload.after[k]),
            change=float(payload.change[k]),
            standard_error=float(payload.standard_error[k]),
            expected=float(payload.expected[k]),
            share=shares[k],
        )
        for k, name in enumerate(base.names)
    )


def _gains(found: FoundPayload, gains: Gains) -> tuple[GainRecord, ...]:
    return tuple(
        GainRecord(
            axis=k + 1,
            assumed=_finite(assumed),
            told=bool(gains.identifiable[k]),
            corrected=_finite(gains.constant[k]),
            standard_error=_finite(gains.constant_error[k]),
            error=_finite(gains.error[k]),
            error_standard_error=_finite(gains.standard_error[k]),
        )
        for k, assumed in enumerate(found.assumed)
    )


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _elements(estimate: Estimate) -> tuple[ElementRecord, ...]:
    return tuple(
        ElementRecord(
            id=value.id,
            kind=value.kind,
            axis=value.axis + 1,
            value=value.value,
            standard_error=None if np.isnan(value.standard_error) else value.standard_error,
            model=value.model,
        )
        for value in estimate.local
        if value.kind in DRAWN
    )
