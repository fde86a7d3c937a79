"""Details of a fit other than base parameters and friction laws, by the kind of recordings."""

from __future__ import annotations

from typing import ClassVar, TypeAlias

from checked_files.yaml_file import FileModel
from hil.estimation.back_and_forth.result import BackAndForthFit
from hil.estimation.free_motion.result import FreeMotionFit
from hil.friction.law import TermValue


class MeasurementFit(FileModel):
    """Empty details of a fit to strokes and trajectories.

    Friction is fitted anew in each measurement, and the lags and gears of a drive train are not
    part of the model.
    """

    file_key: ClassVar[str | None] = None
    """Key of the details in `model.yaml`; None if nothing is written."""
    with_law: ClassVar[bool] = False
    """True if the friction law was estimated together with the base parameters."""
    blocks: ClassVar[None] = None
    curves: ClassVar[tuple[()]] = ()
    gains: ClassVar[tuple[()]] = ()
    lag: ClassVar[tuple[()]] = ()
    compliance: ClassVar[dict[int, TermValue]] = {}
    not_identified: ClassVar[tuple[str, ...]] = ()
    rest: ClassVar[dict[int, float]] = {}

    def sum_of(self, _name: str) -> str:
        """Return an empty sum, since every parameter is identified individually."""
        return ""


FitDetails: TypeAlias = FreeMotionFit | BackAndForthFit | MeasurementFit
NO_DETAILS = MeasurementFit()
