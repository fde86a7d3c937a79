"""Numbers as a page carries them: whole multiples of a step, as differences, compressed.

What is drawn needs no more digits than a screen shows. `web/src/packed.js` reads it.
"""

from __future__ import annotations

import base64
import gzip
import json
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


class Packed(NamedTuple):
    """A list of numbers.

    Attributes
    ----------
    step : float
        What a number is a multiple of.
    differences : list of int
        Of each multiple to the one before, the first to 0.
    """

    step: float
    differences: list[int]


def packed(values: ArrayLike, step: float) -> dict[str, object]:
    """Numbers of any shape in order, rounded to multiples of `step`."""
    whole = np.rint(np.ravel(np.asarray(values, dtype=float)) / step).astype(np.int64)
    return Packed(step, np.diff(whole, prepend=0).tolist())._asdict()


def deflated(data: object) -> str:
    """JSON of `data`, compressed, as text that HTML may hold."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return base64.b64encode(gzip.compress(text.encode(), compresslevel=6, mtime=0)).decode()
