"""Find axes at rest whose torque says nothing: a brake or static friction carries the load.

The torque of an axis at rest shows weight and the reaction to the motion of other axes, as long as
neither a brake nor static friction carries a part of them. A brake carries all: the recorded torque
is constant but for noise, and its equation 0 = A p bends the parameters of all axes. The equations
of an axis at rest are left out if all columns together predict its torque in held-out pieces of
time no better than a constant.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hil.least_squares.choice import HeldOut

if TYPE_CHECKING:
    from collections.abc import Sequence

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

    def held(axis: int) -> bool:
        products = np.zeros_like(pieces.products)
        products[:, axis] = pieces.products[:, axis]
        own = replace(pieces, products=products).normal(np.ones(pieces.n_channels))
        held_out, offset = HeldOut(own, own), pieces.layout.index("offset", axis)
        every = np.append(np.arange(len(pieces.shared)), offset)
        return float(held_out.error(every).sum()) >= float(held_out.error(every[-1:]).sum())

    return tuple(axis for axis in still if held(axis))
