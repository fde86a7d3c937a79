"""The recursion: compiled, which Numba keeps on disk, and by NumPy's arrays."""

import re
from pathlib import Path

import numpy as np
import pytest

from hil.model import recursion, recursion_by_arrays


def test_all_that_is_compiled_into_the_recursion_stands_in_its_own_file() -> None:
    """Numba compiles a file anew when it has changed, and does not look at others."""
    source = Path(recursion.__file__).read_text()
    imported = re.findall(r"^(?:from|import) ([\w.]+)", source, re.MULTILINE)
    assert "numba" in imported
    assert not [name for name in imported if name.startswith("hil")]


@pytest.mark.parametrize("rows", [(0, 1, 2, 3), (2,), (1, 3)])
def test_arrays_give_what_is_compiled_to_the_last_bit(rows: tuple[int, ...]) -> None:
    """Whatever parameters of whatever links are asked for, prismatic joints among them."""
    drawn = np.random.default_rng(5)
    angle = drawn.uniform(-3.0, 3.0, (37, 4))
    others = drawn.uniform(-2.0, 2.0, (3, 37, 4))
    state = np.concatenate([[np.cos(angle)], [np.sin(angle)], others])
    alpha = drawn.uniform(-2.0, 2.0, 4)
    revolute = np.array([1.0, 0.0, 1.0, 1.0])
    chain = np.column_stack([np.cos(alpha), np.sin(alpha), drawn.uniform(size=4), revolute])
    kinds, links = np.tile(np.arange(10), 4), np.repeat(np.arange(4), 10)
    found = []
    by_joint = [[c.copy() for c in joint] for joint in state.transpose(2, 0, 1)]
    common = chain, np.array([1.0, 2.0, -9.81]), kinds, links
    for way, of in ((recursion, state), (recursion_by_arrays, by_joint)):
        out = np.full((37, len(rows), 40), np.nan)
        way.columns(of, *common, np.array(rows), out)
        found.append(out)
    assert (found[0] == found[1]).all()
