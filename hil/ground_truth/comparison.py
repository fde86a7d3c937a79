"""Comparison of models, and of an estimate with the truth of a virtual plant.

Parameters of size 0 have no relative error. Groups of parameters are therefore judged by the norm
of the error, and the model by rigid-body torques on an independent motion (`trajectory`), relative
to their root mean square. The share of 95 % intervals that hold the truth tests the stated
uncertainties.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import Mismatch
from hil.ground_truth.true_parameters import refuse_other_plant, true_parameters
from hil.model.base_parameters import base_parameters
from hil.results.findings import found_in
from hil.results.model import Model, loaded
from hil.results.model_file import NAME, read_model_file
from hil.results.prediction import FreeTorques
from hil.results.tables.parameters import NAMED
from hil.runs.pooling import pooled
from hil.show.outcome import Outcome
from hil.show.rounding import clock, count, rounded, signed, unit
from hil.show.table import Marked, Part, Table, figures, table

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.arrays import Array, Mask
    from hil.estimation.estimate import Estimate
    from hil.model.base_parameters import BaseParameters
    from hil.model.robot import Robot
    from hil.runs.run import Run
    from hil.show.table import Row


@dataclass(frozen=True, eq=False)
class ModelComparison:
    """Comparison of the base parameters of two models, or of a model and the truth.

    Attributes
    ----------
    model : Estimate
    others : ndarray, shape (n_base,)
        Base parameters of the second model, or true ones.
    variances : ndarray, shape (n_base,)
        Squared standard errors of `others`; 0 for the truth.

    Examples
    --------
    >>> compared = hil.compare("runs/first", "manutec-r15")
    >>> compared.difference.shape, bool((compared.torque < 0.01).all())
    ((14,), True)
    """

    model: Estimate
    others: Array
    variances: Array | float = 0.0

    @property
    def robot(self) -> Robot:
        """Robot of both models."""
        return self.model.robot

    @property
    def values(self) -> Array:
        """Base parameters of the model, shape (n_base,)."""
        return self.model.values

    @property
    def standard_errors(self) -> Array:
        """Errors of the difference, for independent errors of both models, shape (n_base,)."""
        return np.sqrt(np.diag(self.model.covariance) + self.variances)

    @cached_property
    def torque(self) -> Array:
        """Torque of the difference over the torque of the second model, shape (n_joints,).

        Root mean squares of rigid-body torques on a free motion; NaN for a joint without torque.
        """
        torques = FreeTorques(self.robot)
        other = torques.rms(self.others)
        return torques.rms(self.difference) / np.where(other > 0, other, np.nan)

    @property
    def difference(self) -> Array:
        """Differences, first less second, shape (n_base,)."""
        return self.values - self.others

    @property
    def z(self) -> Array:
        """Differences over standard errors, shape (n_base,)."""
        return self.difference / self.standard_errors

    def summary(self) -> Outcome:
        """Return parameters side by side, with the torques of the differences."""
        base = base_parameters(self.robot)
        each = zip(
            base.names, base.meanings, self.values, self.others, self.standard_errors, self.z,
            base.units, strict=True,
        )  # fmt: skip
        parameters = table(
            f"{self.robot.name}: two sets of base parameters",
            (*NAMED, *figures("first", "second", "difference", "std. error", "z"), "unit"),
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
        return Outcome((parameters, torques))

    def __repr__(self) -> str:
        return str(self.summary())

    def _repr_html_(self) -> str:
        return self.summary()._repr_html_()


def compare(model: Model | Path | str, other: Model | Path | str) -> ModelComparison:
    """Compare a model with another model of the robot, or with the truth of a virtual plant.

    Parameters
    ----------
    model : Model or path
    other : Model, path or str
        Model, model file or run; plant file, or name of a built-in plant.

    Raises
    ------
    Mismatch
        Another robot or plant.
    FileError
        An unusable file.

    Examples
    --------
    >>> compared = hil.compare("runs/first", "manutec-r15")  # with the virtual plant's truth
    >>> bool((abs(compared.z) < 4).all())
    True
    """
    model = loaded(model)
    if isinstance(other, Model) or _is_model(other):
        second = loaded(other)
        second.refuse_other_robot(model.robot, "the first model")
        return ModelComparison(model, second.values, np.diag(second.covariance))
    return ModelComparison(model, true_parameters(model.robot, other))


def _is_model(place: Path | str) -> bool:
    path = Path(place)
    return path.is_dir() or path.name == NAME or str(path).endswith(f".{NAME}")


@dataclass(frozen=True, eq=False)
class Comparison(ModelComparison):
    """Errors of an estimate: `others` are true.

    Attributes
    ----------
    source : str
        Source of the estimate.
    """

    source: str = ""

    @property
    def group_error(self) -> dict[str, float]:
        """Relative norm of the error of each group of base parameters that is not zero."""
        groups, norm = base_parameters(self.robot).groups, np.linalg.norm
        members = {group: list(k) for group, k in groups.items() if self.others[list(k)].any()}
        return {
            group: float(norm(self.difference[k]) / norm(self.others[k]))
            for group, k in members.items()
        }

    def summary(self) -> Outcome:
        """Return errors of parameters, groups and torques, and the coverage."""
        return Outcome((_parameters(self),), sentences=(*_sentences(self), self.source))

    @property
    def inside(self) -> Mask:
        """Mask of 95 % intervals that hold the truth, shape (n_base,)."""
        return np.abs(self.difference) <= self.model.half_width()

    @property
    def mean_torque_error(self) -> float:
        """Mean of `torque` over the joints."""
        return float(np.nanmean(self.torque))


def truth_comparison(
    run: Run, truth: Path | str, method: str = "improved", others: Sequence[Run] = ()
) -> Comparison:
    """Compare the model of runs on the virtual plant with the truth.

    A stored model is used if present; otherwise the runs are identified as by `hil identify`.

    Parameters
    ----------
    truth : path or str
        Plant file, or name of a built-in plant.
    others : sequence of Run
        Further runs of the plant, identified together with the first.

    Raises
    ------
    FileError
        An unusable plant file, a damaged recording, or a model in the folder that was edited.
    Mismatch
        Not a run of this virtual plant, or a stored model of other runs.
    NotIdentifiable, NotEnoughData
        Too few measurements.
    """
    true = true_parameters(run.robot, truth)
    for each in (run, *others):
        refuse_other_plant(each, truth)
    _refuse_other_model(run, others)
    recordings = list(pooled([run, *others]))
    model = found_in(run, method, others).model
    source = (
        f"{count(len(recordings), 'measurement')} in {clock(recordings[-1][1].time[-1])} of robot"
        f" time, {method} method, truth of {truth}"
    )
    return Comparison(model, true, source=source)


def _refuse_other_model(run: Run, others: Sequence[Run]) -> None:
    """Refuse recordings that differ from those of the model in the run's folder."""
    path = run.path / NAME
    if not path.exists():
        return
    together = read_model_file(path).provenance.together_with
    if len(together) != len(others):
        given = "".join(f" --with {each}" for each in together)
        raise Mismatch(
            f"{path}: identified from {len(together) + 1} runs, but {len(others) + 1} are given; "
            f"compare with{given or 'out --with'}, or identify the same runs first"
        )


def _sentences(result: Comparison) -> Iterator[str]:
    """State group errors, torque errors and coverage of a comparison."""
    for group, error in result.group_error.items():
        name = group.replace("_", "-")
        yield f"{name + ' group,':20} relative error in the norm   {_percent(error)}"
    joints = ", ".join(_percent(error).strip() for error in result.torque)
    yield (
        f"{'torques,':20} mean relative rms over joints{_percent(result.mean_torque_error)}"
        f"  (joints 1 to {result.robot.n_joints}: {joints})"
    )
    inside = f"{result.inside.sum()} of {len(result.values)}"
    yield f"{'intervals of 95 %,':20} hold the truth for {inside} parameters"


def _parameters(result: Comparison) -> Table:
    base = base_parameters(result.robot)
    return table(
        f"{result.robot.name}: estimate against truth",
        (*NAMED, *figures("truth", "estimate", "std. error", "error", "z"), "in 95 %", "unit"),
        (Part(tuple(_parameter(result, base, k) for k in m)) for m in base.groups.values()),
    )


def _parameter(result: Comparison, base: BaseParameters, k: int) -> Row:
    s = float(result.standard_errors[k])
    values = (result.others[k], result.values[k], s, result.difference[k])
    return (
        base.names[k],
        base.meanings[k],
        *(rounded(float(value), s) for value in values),
        signed(f"{result.z[k]:.1f}"),
        "yes" if result.inside[k] else Marked("no"),
        unit(base.units[k]),
    )


def _percent(share: float) -> str:
    return f"{100 * share:8.3f} %"
