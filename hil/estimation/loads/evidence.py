"""What a run says of a robot, with a load or without: blocks of one form for all kinds of run.

The torque of an axis is the first column, as it was read, in SI by the gains that are stated or in
the unit of its signal. Columns that all axes share are those of the base parameters, of coupled
motors' friction and of the torque that turns rotors of known inertia (`ROTOR`); own columns are an
axis's friction. So every gain and every load is a combination of columns.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np

from hil.estimation.condensed import ROTOR, condensed_blocks, stack
from hil.estimation.free_motion.choice import law_terms
from hil.estimation.free_motion.solution import BLOCKS
from hil.friction.equation import ASYMMETRIC, COMMON, LOAD
from hil.friction.terms import COLUMNS
from hil.model.base_parameters import base_parameters

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array, Mask
    from hil.estimation.condensed import Stacked
    from hil.estimation.free_motion.gathering import Gathered
    from hil.estimation.signals import Prepared
    from hil.estimation.simultaneous import SimultaneousFit
    from hil.least_squares.blocks import Blocks
    from hil.model.robot import Robot


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Blocks of a run.

    Attributes
    ----------
    kind : str
        What groups are: measurements or periods with friction of their own, or pieces of time.
    blocks : Blocks
    apart : frozenset of str
        Columns whose unknowns another run of this kind has anew.
    terms : tuple of frozenset of str
        Own columns of each axis that its law of friction has.
    gains : ndarray, shape (n_joints,)
        [N m or N for one unit of the signal], to begin with where they are open.
    cells : Blocks, optional
        The same samples by state, of free motions.
    unknown : tuple of int
        Axes, from 0, whose gain the map leaves open.
    scale_open : bool
        Whether one more gain is, which was held at random.
    beside : ndarray
        As of `hil.least_squares.balance.Kind`.
    doubt : ndarray
        The same of what does not change how much the run counts: lags, gears, encoders' steps.
    """

    kind: Literal["strokes", "free motions"]
    blocks: Blocks
    apart: frozenset[str]
    terms: tuple[frozenset[str], ...]
    gains: Array
    cells: Blocks | None = None
    unknown: tuple[int, ...] = ()
    scale_open: bool = False
    beside: Array = field(default_factory=lambda: np.zeros((0, 0)))
    doubt: Array = field(default_factory=lambda: np.zeros((0, 0)))


def of_strokes(blocks: Blocks, loaded: Mask, doubt: Array | None = None) -> Evidence:
    """Evidence of condensed measurements, friction of the load on axes that are `loaded` alone.

    Runs of one kind share their `doubt`, that of the first.
    """
    torque, rotor = np.eye(1, blocks.products.shape[-1]), blocks.place(ROTOR)
    motors = np.zeros_like(torque)
    # condensed is the torque less that of the rotors
    torque[:, rotor] = motors[:, rotor] = 1.0
    return Evidence(
        kind="strokes",
        blocks=blocks.recast(torque, {ROTOR: motors}, (ROTOR,)),
        apart=frozenset(COMMON[k] for k in ASYMMETRIC),
        terms=tuple(frozenset(COMMON if each else COMMON[:LOAD]) for each in loaded),
        gains=np.ones(blocks.n_channels),
        doubt=np.zeros((0, 0)) if doubt is None else doubt,
    )


def condensed_like(robot: Robot, fit: SimultaneousFit, prepared: Prepared, p: Array) -> Blocks:
    """Condense measurements, friction of the transmitted torque where a fit of others has it.

    Parameters
    ----------
    p : ndarray, shape (n_base,)
        By which torque is transmitted.
    """

    def of_axis(each: Stacked) -> Stacked:
        return each.loaded(each.load(p)) if fit.loaded[each.axis] else each

    stacks = (axes for motion, s in prepared for axes in stack(robot, motion, s))
    return condensed_blocks(robot, [[of_axis(each) for each in axes] for axes in stacks])


def of_free_motions(robot: Robot, runs: Sequence[Gathered]) -> list[Evidence]:
    """Evidence of imported runs: they share the dead zone and, axis by axis, terms of friction."""
    slowest = max((run.choice.slowest for run in runs), default=0)
    terms = tuple(
        frozenset(term for run in runs for term in law_terms(run.choice.laws[axis]))
        for axis in range(robot.n_joints)
    )
    used = [name for name in COLUMNS if any(name in law for law in terms)]
    found = []
    for run in runs:
        shared = run.recorded.layout.shared
        pieces, cells = (
            each[slowest].only(shared, used) for each in (run.recorded.pieces, run.recorded.cells)
        )
        coupled = set(shared) - {*base_parameters(robot).names, ROTOR}
        found.append(Evidence(
            kind="free motions",
            blocks=pieces.grouped(BLOCKS),
            apart=frozenset({*coupled, *COLUMNS}),
            terms=terms,
            gains=run.scaling.gains,
            cells=cells.where(cells.counts.sum(axis=1) > 0),
            unknown=run.scaling.unknown,
            scale_open=run.scaling.unknown != run.found.unknown_gains,
            beside=run.choice_covariance,
        ))  # fmt: skip
    return found
