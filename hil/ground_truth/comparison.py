"""Estimate against truth, which is known of the virtual plant only.

Parameters of size 0 have no relative error, so groups are judged by their norm, and the model as
such by the torques that it predicts on a motion that has nothing to do with the measurements
(`trajectory`): the rigid-body part, relative to its root mean square. How often intervals of
95 % hold the truth shows whether the stated uncertainties are right.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import Mismatch
from hil.ground_truth.true_parameters import refuse_other_plant, true_parameters
from hil.model.base_parameters import base_parameters
from hil.results.findings import found_in
from hil.results.model_file import NAME, read_model_file
from hil.results.prediction import FreeTorques
from hil.results.rounding import clock, rounded, signed, unit
from hil.results.tables.parameters import NAMED
from hil.results.tables.table import Marked, Part, Table, figures, table
from hil.results.tables.terminal import show, show_sentence
from hil.runs.pooling import pooled

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from rich.console import Console

    from hil.arrays import Array, Mask
    from hil.estimation.estimate import Estimate
    from hil.model.base_parameters import BaseParameters
    from hil.model.robot import Robot
    from hil.results.tables.table import Row
    from hil.runs.run import Run


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """How far an estimate is from the truth.

    Attributes
    ----------
    truth, p, standard_error, half_width : ndarray, shape (n_base,)
        Base parameters as they are and as found; of the latter the uncertainties.
    group_error : dict
        Norm of the error of each group of base parameters over the norm of the group.
    torque_error : ndarray, shape (n_joints,)
        Root mean square of the error of the predicted torque over that of the torque; NaN for a
        joint without any.
    """

    truth: Array
    p: Array
    standard_error: Array
    half_width: Array
    group_error: dict[str, float]
    torque_error: Array

    @property
    def error(self) -> Array:
        """Estimate less truth, shape (n_base,)."""
        return self.p - self.truth

    @property
    def z(self) -> Array:
        """Errors over standard errors, shape (n_base,)."""
        return self.error / self.standard_error

    @property
    def inside(self) -> Mask:
        """Which intervals of 95 % hold the truth, shape (n_base,)."""
        return np.abs(self.error) <= self.half_width

    @property
    def mean_torque_error(self) -> float:
        """Mean of `torque_error` over the joints."""
        return float(np.nanmean(self.torque_error))


def comparison(estimate: Estimate, robot: Robot, truth: Array) -> Comparison:
    """Set an estimate against the true base parameters, shape (n_base,)."""
    groups = base_parameters(robot).groups
    members = {group: list(k) for group, k in groups.items() if k and truth[list(k)].any()}
    error = estimate.p - truth
    return Comparison(
        truth=truth,
        p=estimate.p,
        standard_error=estimate.standard_error,
        half_width=estimate.half_width(),
        group_error={
            group: float(np.linalg.norm(error[k]) / np.linalg.norm(truth[k]))
            for group, k in members.items()
        },
        torque_error=_torque_error(robot, error, truth),
    )


def compare(
    run: Run,
    truth: Path | str,
    console: Console,
    method: str = "improved",
    others: Sequence[Run] = (),
) -> Comparison:
    """Compare what runs of the virtual plant gave with the truth, print.

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
    render(result, run.robot, console)
    show_sentence(
        f"{len(recordings)} measurements in {clock(recordings[-1][1].time[-1])} of robot time,"
        f" {method} method, truth of {truth}",
        console,
    )
    return result


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


def render(result: Comparison, robot: Robot, console: Console) -> None:
    """Print a comparison: parameters one by one, then groups, torques and coverage."""
    show(_parameters(result, robot), console)
    for group, error in result.group_error.items():
        name = group.replace("_", "-")
        text = f"{name + ' group,':20} relative error in the norm   {_percent(error)}"
        show_sentence(text, console)
    joints = ", ".join(_percent(error).strip() for error in result.torque_error)
    show_sentence(
        f"{'torques,':20} mean relative rms over joints{_percent(result.mean_torque_error)}"
        f"  (joints 1 to {robot.n_joints}: {joints})",
        console,
    )
    inside = f"{result.inside.sum()} of {len(result.p)}"
    text = f"{'intervals of 95 %,':20} hold the truth for {inside} parameters"
    show_sentence(text, console)


def _parameters(result: Comparison, robot: Robot) -> Table:
    base = base_parameters(robot)
    return table(
        f"{robot.name}: estimate against truth",
        (
            *NAMED,
            *figures("truth", "estimate", "std. error", "error", "z"),
            "in 95 %",
            "unit",
        ),
        (Part(tuple(_parameter(result, base, k) for k in m)) for m in base.groups.values()),
    )


def _parameter(result: Comparison, base: BaseParameters, k: int) -> Row:
    s = float(result.standard_error[k])
    values = (result.truth[k], result.p[k], s, result.error[k])
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
