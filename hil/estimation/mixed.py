"""Recordings of several kinds as one regression: what was measured here, and what was imported.

Each kind becomes blocks in its own way: strokes and trajectories with friction found anew in each
(`hil.estimation.two_step_methods`), free motions with the laws of friction that held-out pieces
call for (`hil.estimation.free_motion`). Base parameters have the same names in both, so the blocks
add up to one regression. Filters, rates and friction differ, so the torque of an axis is a channel
of its own in each kind, with its own weight and its own friction; nothing but the base parameters
passes from one to the other. Gains that the map of an import leaves unknown are found with all, by
Gauss and Newton's method from where the parameters of the strokes have them. How much a whole kind
counts follows from leaving out its groups (`hil.least_squares.balance`). What lags, gives way and
drifts is found in each kind by itself.

Estimated is as by measurements alone (`hil.estimation.two_step_methods.measured`): errors of groups
that are left out, and what else leaves the parameters of a kind uncertain, in proportion to what of
them is in those of all.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from hil.estimation.free_motion.gathering import as_kinds, gather_rates
from hil.estimation.free_motion.scaling import found_gains
from hil.estimation.free_motion.variants import DEFAULT, VARIANTS
from hil.estimation.options import DEFAULTS
from hil.estimation.two_step_methods import joint, measured, prepare, with_reached_limits
from hil.least_squares.balance import Kind, balance
from hil.model.base_parameters import base_parameters
from hil.planning.free_motion import FreeMotion

if TYPE_CHECKING:
    from hil.estimation.estimate import Estimate
    from hil.estimation.options import Options
    from hil.model.robot import Robot
    from hil.runs.recording import Recorded


def fit_joint(robot: Robot, recorded: Recorded, options: Options = DEFAULTS) -> Estimate:
    """Identify base parameters from recordings of several kinds together.

    Raises
    ------
    NotEnoughData, NotIdentifiable
        As the methods of each kind.
    """
    own = (each for each in recorded if not isinstance(each[0], FreeMotion))
    raw, unusable = prepare(own)
    robot = with_reached_limits(robot, raw)
    found, names = joint(robot, raw, options.nuisance), base_parameters(robot).names
    p = found.solver.solve()
    imported = gather_rates(robot, recorded, VARIANTS[DEFAULT], options, p)
    unknown = any(each.scaling.unknown for each in imported)
    # two rounds of Gauss and Newton's method for unknown gains: it squares the error of a first
    # gain, which is a few percent beside parameters of strokes
    for _ in range(2 if unknown else 0):
        kinds = [Kind(found.solver.regression), *as_kinds(imported)]
        fit = balance(kinds, names).whole.regression.fit("white")
        imported = [each.rescaled(fit) for each in imported]
    estimate, fit = measured(robot, raw, unusable, found, options, as_kinds(imported))
    return replace(
        estimate,
        gains=tuple(gain for each in imported for gain in found_gains(robot, each.scaling, fit)),
        n_measurements=len(raw) + sum(each.found.n_recordings for each in imported),
        edges=(*estimate.edges, *(edge for each in imported for edge in each.edges)),
    )
