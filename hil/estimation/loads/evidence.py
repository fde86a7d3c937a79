"""Evidence of a run about robot and load: blocks of the same form for any kind of run.

The first column is the torque of an axis as it was read, in SI by stated gains or in the unit of
its signal. Shared columns are those of the base parameters, of the friction of coupled motors, and
of the torque that turns rotors of known inertia (`ROTOR`); own columns are an axis's friction. So
every gain and every load is a combination of columns.
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
        Kind of groups: measurements or periods with friction of their own, or pieces of time.
    apart : frozenset of str
        Columns with separate unknowns in each run of this kind.
    terms : tuple of frozenset of str
        Own columns of each axis in its friction law.
    gains : ndarray, shape (n_joints,)
        Gains [N m or N per unit of the signal]; initial values where they are unknown.
    cells : Blocks, optional
        Samples of free motions, grouped by state.
    unknown : tuple of int
        Axes, from 0, with an unknown gain in the map.
    scale_open : bool
        True if a further unknown gain was fixed at an arbitrary value.
    beside : ndarray
        Covariance as in `hil.least_squares.balance.Kind`.
    doubt : ndarray
        Covariance from sources that leave the weight of the run unchanged: lags, gears, encoder
        steps.
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


def stroke_evidence(blocks: Blocks, loaded: Mask, doubt: Array | None = None) -> Evidence:
    """Return the evidence of condensed measurements, with friction of the load on `loaded` axes.

    Runs of the same kind share the `doubt` of the first run.
    """
    torque, rotor = np.eye(1, blocks.products.shape[-1]), blocks.place(ROTOR)
    motors = np.zeros_like(torque)
    # the condensed torque excludes the rotors
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
    """Condense measurements, with friction of the transmitted torque on the same axes as `fit`.

    Parameters
    ----------
    p : ndarray, shape (n_base,)
        Base parameters for the transmitted torque.
    """

    def load_axis(each: Stacked) -> Stacked:
        return each.loaded(each.load(p)) if fit.loaded[each.axis] else each

    stacks = (axes for motion, s in prepared for axes in stack(robot, motion, s))
    return condensed_blocks(robot, [[load_axis(each) for each in axes] for axes in stacks])


def free_motion_evidence(robot: Robot, runs: Sequence[Gathered]) -> list[Evidence]:
    """Return the evidence of imported runs, with a common dead zone and common friction terms."""
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
