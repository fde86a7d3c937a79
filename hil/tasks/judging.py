"""A model against other data: held-out recordings, another model, the truth of a plant."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hil.ground_truth.true_parameters import true_parameters
from hil.results.model import Model
from hil.results.predicted_torques import predicted_torques
from hil.results.prediction import FreeTorques
from hil.results.rounding import rounded, signed, unit
from hil.results.tables.parameters import NAMED
from hil.results.tables.table import figures, table
from hil.results.tables.terminal import Summary
from hil.results.validation import Validation, of_own_recordings
from hil.results.validation import validate as judge
from hil.runs.pooling import pooled
from hil.runs.run import opened

if TYPE_CHECKING:
    from hil.arrays import Array
    from hil.model.robot import Robot
    from hil.runs.run import Run


def validate(model: Model | Path | str, run: Run | Path | str) -> Validation:
    """Validate a model on a run that it was not identified from; nothing is written.

    Parameters
    ----------
    model : Model or path
        The model, its file or the folder of its run.
    run : Run or path
        Held-out recordings of the same robot.

    Returns
    -------
    Validation
        Its `word` is good, doubtful or failed; `reason` states why, `axes` the scores.

    Raises
    ------
    Mismatch
        Another robot.
    FileError
        A damaged file.
    """
    model, run = _loaded(model), opened(run)
    model.refuse_other_robot(run.robot, str(run.path))
    return of_own_recordings(model, run) or judge(model, predicted_torques(model, pooled([run])))


@dataclass(frozen=True, eq=False)
class ModelComparison:
    """Base parameters of two models, or of a model and the truth.

    Attributes
    ----------
    robot : Robot
    values, others : ndarray, shape (n_base,)
    standard_errors : ndarray, shape (n_base,)
        Of the difference, both models' errors taken as independent.
    torque : ndarray, shape (n_joints,)
        Root mean square of the difference of predicted rigid-body torques on a free motion, as a
        fraction of the other's torque; NaN for a joint without any.
    """

    robot: Robot
    values: Array
    others: Array
    standard_errors: Array
    torque: Array

    @property
    def difference(self) -> Array:
        """First less second, shape (n_base,)."""
        return self.values - self.others

    @property
    def z(self) -> Array:
        """Differences over their standard errors, shape (n_base,)."""
        return self.difference / self.standard_errors

    def summary(self) -> Summary:
        """Parameters side by side, and the torques that their differences are worth."""
        from hil.model.base_parameters import base_parameters

        base = base_parameters(self.robot)
        each = zip(
            base.names, base.meanings, self.values, self.others, self.standard_errors, self.z,
            base.units, strict=True,
        )  # fmt: skip
        parameters = table(
            f"{self.robot.name}: two sets of base parameters",
            (
                *NAMED,
                *figures("first", "second", "difference", "std. error", "z"),
                "unit",
            ),
            (
                (
                    name,
                    meaning,
                    *(rounded(float(x), float(s)) for x in (first, second, first - second, s)),
                    signed(f"{z:.1f}"),
                    unit(of),
                )
                for name, meaning, first, second, s, z, of in each
            ),
        )
        torques = table(
            "Torques of a free motion",
            ("axis", *figures("difference, %")),
            ((str(k), f"{100 * share:.3g}") for k, share in enumerate(self.torque, start=1)),
        )
        return Summary((parameters, torques))

    def __repr__(self) -> str:
        return str(self.summary())

    def _repr_html_(self) -> str:
        return self.summary()._repr_html_()


def compare(model: Model | Path | str, other: Model | Path | str) -> ModelComparison:
    """Compare a model with another one of the same robot, or with the truth of a virtual plant.

    Parameters
    ----------
    model : Model or path
    other : Model, path or str
        A model, its file or its run; or a plant file, or the name of a built-in plant.

    Raises
    ------
    Mismatch
        Another robot or plant.
    FileError
        A file that cannot be used.
    """
    model = _loaded(model)
    robot, variance = model.robot, np.diag(model.covariance)
    if isinstance(other, Model) or _is_model(other):
        second = _loaded(other)
        second.refuse_other_robot(robot, "the first model")
        values, variance = second.values, variance + np.diag(second.covariance)
    else:
        values = true_parameters(robot, other)
    torques = FreeTorques(robot)
    size = torques.rms(values)
    return ModelComparison(
        robot, model.values, values, np.sqrt(variance),
        torques.rms(model.values - values) / np.where(size > 0, size, np.nan),
    )  # fmt: skip


def _is_model(place: Path | str) -> bool:
    from hil.results.model_file import NAME

    path = Path(place)
    return path.is_dir() or path.name == NAME or str(path).endswith(f".{NAME}")


def _loaded(model: Model | Path | str) -> Model:
    return model if isinstance(model, Model) else Model.load(model)
