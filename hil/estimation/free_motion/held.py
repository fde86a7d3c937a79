"""Find axes at rest whose torque says nothing: a brake or static friction carries the load.

The torque of an axis at rest shows weight and the reaction to the motion of other axes, as long as
neither a brake nor static friction carries a part of them. A brake carries all: the recorded torque
is constant but for noise, and its equation 0 = A p bends the parameters of all axes. The equations
of an axis at rest are left out if

- all columns together predict its torque in held-out pieces of time no better than a constant, or
- they make the residual of a moving axis grow by more than `MATERIAL`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.free_motion.choice import MATERIAL, usual
from hil.least_squares.choice import HeldOut

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array
    from hil.least_squares.blocks import Blocks


def held_axes(pieces: Blocks, still: Sequence[int]) -> tuple[int, ...]:
    """Return the axes among `still`, from 0, that are held.

    Parameters
    ----------
    pieces : Blocks
        By piece of time, a channel per axis.
    still : sequence of int
        Axes at rest.
    """
    moving = np.setdiff1d(np.arange(pieces.n_channels), still).tolist()
    if not still or not moving:
        return ()

    def only(axes: Sequence[int]) -> Blocks:
        products = np.zeros_like(pieces.products)
        products[:, axes] = pieces.products[:, axes]
        return replace(pieces, products=products)

    def left(axes: Sequence[int]) -> Array:
        squares: Array = pieces.mean_squares(usual(only(axes)).solution)[moving]
        return squares

    def related(axis: int) -> bool:
        own = only([axis]).normal(np.ones(pieces.n_channels))
        offset = pieces.layout.index("offset", axis)
        every = np.append(np.arange(len(pieces.shared)), offset)
        held_out = HeldOut(own, own)
        return float(held_out.error(every).sum()) < float(held_out.error(every[-1:]).sum())

    most = (1.0 + MATERIAL) ** 2 * left(moving)
    return tuple(
        axis for axis in still if not related(axis) or (left([*moving, axis]) > most).any()
    )
