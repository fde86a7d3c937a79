"""Descriptions of base parameters in words are unique, for any robot."""

from __future__ import annotations

from pathlib import Path

import pytest

from hil.model.base_parameters import base_parameters
from hil.model.robot import Robot, available_robots

ROBOTS = Path(__file__).parents[2] / "robots"


@pytest.mark.parametrize(
    ("robot", "name", "title"),
    [
        ("manutec-r15", "p5", "gravity of axis 2 (p5)"),
        ("manutec-r15", "p7", "inertia of axis 3 (p7)"),
        ("manutec-r15", "p2", "inertia xx - yy of link 2 (p2)"),
        ("manutec-r15", "p3", "product of inertia xz of link 2 (p3)"),
        ("staubli-tx40", "p8", "gravity of axis 2, y (p8)"),
        ("emps", "p1", "mass moved by axis 1 (p1)"),
        (str(ROBOTS / "scara.yaml"), "p3", "mass times x of link 2 (p3)"),
    ],
)
def test_a_parameter_is_named_by_what_it_is(robot: str, name: str, title: str) -> None:
    base = base_parameters(Robot.load(robot))
    assert base.titles[base.names.index(name)] == title


@pytest.mark.parametrize("robot", [*available_robots(), *map(str, sorted(ROBOTS.glob("*.yaml")))])
def test_no_two_of_a_robot_are_alike(robot: str) -> None:
    base = base_parameters(Robot.load(robot))
    assert len(set(base.meanings)) == len(base)
