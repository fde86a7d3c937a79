"""Models beside one another, and an estimate beside the truth, which virtual plants alone have.

Parameters of size 0 have no relative error, so groups are judged by their norm, and the model as
such by the torques that it predicts on a motion that has nothing to do with the measurements
(`trajectory`): the rigid-body part, relative to its root mean square. How often intervals of
95 % hold the truth shows whether the stated uncertainties are right.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
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
from hil.show.rounding import clock, rounded, signed, unit
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

    def summary(self) -> Outcome:
        """Parameters side by side, and the torques that their differences are worth."""
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
    model = loaded(model)
    robot, variance = model.robot, np.diag(model.covariance)
    if isinstance(other, Model) or _is_model(other):
        second = loaded(other)
        second.refuse_other_robot(robot, "the first model")
        values, variance = second.values, variance + np.diag(second.covariance)
    else:
        values = true_parameters(robot, other)
    torque = _torque_error(robot, model.values - values, values)
    return ModelComparison(robot, model.values, values, np.sqrt(variance), torque)


def _is_model(place: Path | str) -> bool:
    path = Path(place)
    return path.is_dir() or path.name == NAME or str(path).endswith(f".{NAME}")


@dataclass(frozen=True, eq=False)
class Comparison(ModelComparison):
    """How far an estimate is from the truth: `values` as found, `others` as they are.

    Attributes
    ----------
    half_width : ndarray, shape (n_base,)
        Of the intervals of 95 % of the estimate.
    group_error : dict
        Norm of the error of each group of base parameters over the norm of the group.
    source : str
        What was compared.
    """

    half_width: Array
    group_error: dict[str, float]
    source: str = ""

    def summary(self) -> Outcome:
        """Parameters one by one, then groups, torques and coverage."""
        return Outcome((_parameters(self),), sentences=(*_sentences(self), self.source))

    @property
    def inside(self) -> Mask:
        """Which intervals of 95 % hold the truth, shape (n_base,)."""
        return np.abs(self.difference) <= self.half_width

    @property
    def mean_torque_error(self) -> float:
        """Mean of `torque` over the joints."""
        return float(np.nanmean(self.torque))


def comparison(estimate: Estimate, robot: Robot, truth: Array) -> Comparison:
    """Set an estimate against the true base parameters, shape (n_base,)."""
    groups = base_parameters(robot).groups
    members = {group: list(k) for group, k in groups.items() if k and truth[list(k)].any()}
    error = estimate.p - truth
    return Comparison(
        robot=robot,
        values=estimate.p,
        others=truth,
        standard_errors=estimate.standard_error,
        torque=_torque_error(robot, error, truth),
        half_width=estimate.half_width(),
        group_error={
            group: float(np.linalg.norm(error[k]) / np.linalg.norm(truth[k]))
            for group, k in members.items()
        },
    )


def against_truth(
    run: Run,
    truth: Path | str,
    method: str = "improved",
    others: Sequence[Run] = (),
) -> Comparison:
    """Compare what runs of the virtual plant gave with the truth.

    What is kept of them is taken, else they are identified, as `hil identify` does.

    Parameters
    ----------
    truth : path or str
        Plant file, or the name of one that comes along.
    others : sequence of Run
        Further runs of the same plant, taken together with the first.

    Raises
    ------
    FileError
        An unusable plant file, a damaged recording, or a model in the folder that was edited.
    Mismatch
        Not a run of the virtual plant, or of another one; a model in the folder that was made from
        other runs.
    NotIdentifiable, NotEnoughData
        Measurements that do not suffice.
    """
    true = true_parameters(run.robot, truth)
    for each in (run, *others):
        refuse_other_plant(each, truth)
    _refuse_other_model(run, others)
    recordings = list(pooled([run, *others]))
    result = comparison(found_in(run, method, others).estimate, run.robot, true)
    source = (
        f"{len(recordings)} measurements in {clock(recordings[-1][1].time[-1])} of robot time,"
        f" {method} method, truth of {truth}"
    )
    return replace(result, source=source)


def _refuse_other_model(run: Run, others: Sequence[Run]) -> None:
    """Refuse to judge other recordings than those of the model that lies in the run's folder."""
    path = run.path / NAME
    if not path.exists():
        return
    together = read_model_file(path).provenance.together_with
    if len(together) != len(others):
        given = "".join(f" --with {each}" for each in together)
        raise Mismatch(
            f"{path}: was made from {len(together) + 1} runs, and {len(others) + 1} would be"
            f" compared; compare with{given or 'out --with'}, or identify the same runs first"
        )


def _sentences(result: Comparison) -> Iterator[str]:
    """Groups, torques and coverage of a comparison."""
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


def _torque_error(robot: Robot, error: Array, truth: Array) -> Array:
    """Relative errors of the torques that p predicts; they are linear in p."""
    torques = FreeTorques(robot)
    true = torques.rms(truth)
    return torques.rms(error) / np.where(true > 0, true, np.nan)


def _percent(share: float) -> str:
    return f"{100 * share:8.3f} %"
