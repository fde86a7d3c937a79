"""Fit measurements and imported recordings in a joint regression.

Each kind is condensed to blocks separately: strokes and trajectories with separate friction in each
(`hil.estimation.two_step_methods`), free motions with friction laws chosen on held-out pieces
(`hil.estimation.free_motion`). Base parameters have equal names in both, so the blocks add up to
one regression. Filters, rates and friction differ, so the torque of an axis is a separate channel
in each kind, with separate weight and friction; only the base parameters are shared. Unknown gains
of imports are estimated jointly, by Gauss-Newton from the values given by the parameters of the
strokes. The weight of a kind follows from leaving out its groups (`hil.least_squares.balance`).
Lags, compliances and drift are estimated in each kind separately.

Errors are estimated as for measurements alone (`hil.estimation.two_step_methods.measured`): from
leaving out groups, plus the further uncertainties of a kind's parameters, in proportion to the
kind's share in the joint parameters.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from hil.estimation.free_motion.gathering import gather_rates, rate_regressions
from hil.estimation.free_motion.scaling import found_gains
from hil.estimation.free_motion.variants import DEFAULT, VARIANTS
from hil.estimation.options import DEFAULTS
from hil.estimation.two_step_methods import fill_reached_limits, joint, measured, prepare
from hil.least_squares.balance import Kind, balance
from hil.model.base_parameters import base_parameters
from hil.planning.free_motion import FreeMotion

if TYPE_CHECKING:
    from hil.estimation.estimate import Estimate
    from hil.estimation.options import Options
    from hil.model.robot import Robot
    from hil.runs.recording import Recorded


def fit_joint(robot: Robot, recorded: Recorded, options: Options = DEFAULTS) -> Estimate:
    """Identify base parameters jointly from recordings of several kinds.

    Raises
    ------
    NotEnoughData, NotIdentifiable
        See the methods of each kind.
    """
    own = (each for each in recorded if not isinstance(each[0], FreeMotion))
    raw, unusable = prepare(own)
    robot = fill_reached_limits(robot, raw)
    found, names = joint(robot, raw, options.nuisance), base_parameters(robot).names
    p = found.solver.solve()
    imported = gather_rates(robot, recorded, VARIANTS[DEFAULT], options, p)
    unknown = any(each.scaling.unknown for each in imported)
    # two Gauss-Newton rounds for unknown gains: first gains, from the parameters of strokes, have
    # errors of a few percent, and a round squares the error
    for _ in range(2 if unknown else 0):
        kinds = [Kind(found.solver.regression), *rate_regressions(imported)]
        fit = balance(kinds, names).whole.regression.fit("white")
        imported = [each.rescaled(fit) for each in imported]
    estimate, fit = measured(robot, raw, unusable, found, options, rate_regressions(imported))
    return replace(
        estimate,
        gains=tuple(gain for each in imported for gain in found_gains(robot, each.scaling, fit)),
        n_measurements=len(raw) + sum(each.found.n_recordings for each in imported),
        edges=(*estimate.edges, *(edge for each in imported for edge in each.edges)),
    )
