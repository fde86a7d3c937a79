"""Recursion by machine code, built at installation, and by NumPy arrays."""

import numpy as np
import pytest

from hil import Robot, regressor
from hil.model import recursion_by_arrays

recursion = pytest.importorskip("hil.model.recursion", reason="no C compiler at installation")


@pytest.mark.parametrize("parents", [(-1, 0, 1, 2), (-1, 0, 0, -1)])
@pytest.mark.parametrize("rows", [(0, 1, 2, 3), (2,), (1, 3)])
def test_arrays_give_what_is_compiled_to_the_last_bit(
    rows: tuple[int, ...], parents: tuple[int, ...]
) -> None:
    """Columns of all ten parameters of every link are compared, also with prismatic joints."""
    drawn = np.random.default_rng(5)
    angle = drawn.uniform(-3.0, 3.0, (37, 4))
    others = drawn.uniform(-2.0, 2.0, (3, 37, 4))
    state = np.concatenate([[np.cos(angle)], [np.sin(angle)], others])
    alpha = drawn.uniform(-2.0, 2.0, 4)
    revolute = np.array([1.0, 0.0, 1.0, 1.0])
    frames = np.column_stack([np.cos(alpha), np.sin(alpha), drawn.uniform(size=4), revolute])
    kinds, links = np.tile(np.arange(10), 4), np.repeat(np.arange(4), 10)
    found = []
    by_joint = [[c.copy() for c in joint] for joint in state.transpose(2, 0, 1)]
    common = frames, np.array(parents), np.array([1.0, 2.0, -9.81]), kinds, links
    for way, of in ((recursion, state), (recursion_by_arrays, by_joint)):
        out = np.full((37, len(rows), 40), np.nan)
        way.columns(of, *common, np.array(rows), out)
        found.append(out)
    assert (found[0] == found[1]).all()
    moves = np.eye(4, dtype=bool)
    for link, parent in enumerate(parents):
        moves[link] |= moves[parent] if parent >= 0 else False
    assert not found[0].any(axis=0)[~moves[links][:, list(rows)].T].any()


@pytest.mark.parametrize("n", [1, 3, 4, 5, 2047, 2050, 30_000])
def test_a_sample_has_the_same_regressor_in_a_call_of_any_size(n: int) -> None:
    """The choice of code does not depend on the first call or the number of samples."""
    robot = Robot.load("manutec-r15")
    q, qd, qdd = np.random.default_rng(6).uniform(-2.0, 2.0, (3, 30_000, robot.n_joints))
    every = regressor(robot, q, qd, qdd)
    assert (regressor(robot, q[:n], qd[:n], qdd[:n]) == every[:n]).all()
