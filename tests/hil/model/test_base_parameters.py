"""Base parameters by Gautier and Khalil's rules, of any chain; for those of the paper see
test_paper.
"""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.model.base_parameters import BaseParameters, base_parameters
from hil.model.robot import Robot, parse_robot


def remove_body(text: str, *patterns: str) -> str:
    for pattern in patterns:
        text, count = re.subn(pattern, "", text)
        assert count
    return text


@pytest.fixture(scope="module")
def manutec_text() -> str:
    return Robot.load("manutec-r15").text


def test_values_go_into_the_heads(manutec):
    base = base_parameters(manutec)
    heads = "Izz1 Ixx2 Ixz2 Izz2 sx2 Ixx3 Izz3 sy3 Ixx4 Izz4 Ixx5 Izz5 sy5 Izz6"
    assert " ".join(base.heads) == heads
    assert np.array_equal(base.matrix @ base.placement, np.eye(14))


def test_all_sixty_link_parameters_give_36_of_which_10_in_gravity(manutec_text):
    text = remove_body(manutec_text, r"\n    parameters:.*", r"(?s)\nties:.*")
    base = base_parameters(parse_robot(text, "full.yaml"))
    assert len(base) == 36
    assert len(base.groups["gravity"]) == 10


def test_without_the_tie_there_are_15_and_the_difference_stands_alone(manutec_text):
    base = base_parameters(parse_robot(remove_body(manutec_text, r"(?s)\nties:.*"), "untied.yaml"))
    assert len(base) == 15
    assert "Ixx6 - Iyy6" in base.expressions


def test_base_parameters_are_computed_once_per_robot(manutec):
    assert base_parameters(manutec) is base_parameters(Robot.load("manutec-r15"))


def expressions(base: BaseParameters) -> list[str]:
    return list(base.expressions)


def test_planar_arm_across_gravity_keeps_only_planar_parameters(chains):
    base = base_parameters(chains.robot(chains.joint(), chains.joint(d="a")))
    assert expressions(base) == ["Izz1 + a^2 m2", "Izz2", "sx2", "sy2"]
    assert base.groups["gravity"] == ()


def test_planar_arm_in_gravity_also_identifies_first_moments_of_its_first_link(chains):
    base = base_parameters(chains.robot(chains.joint(), chains.joint(d="a"), gravity=(0, -9.81, 0)))
    assert expressions(base) == ["Izz1 + a^2 m2", "sx1 + a m2", "sy1", "Izz2", "sx2", "sy2"]


def test_sliding_only_chain_identifies_only_masses(chains):
    slide = chains.joint("prismatic")
    across = chains.joint("prismatic", alpha="pi/2")
    assert expressions(base_parameters(chains.robot(slide, across))) == ["m1", "m2"]


def test_prismatic_joint_gives_its_whole_inertia_away(chains):
    base = base_parameters(
        chains.robot(
            chains.joint(),
            chains.joint(alpha="pi/2"),
            chains.joint("prismatic", alpha="pi/2"),
        )
    )
    third = [h for h in base.heads if h.endswith("3")]
    assert third == ["sx3", "sy3", "sz3", "m3"]


def test_slide_along_the_first_turning_axis_identifies_mass_but_no_moment_along_it(chains):
    base = base_parameters(chains.robot(chains.joint(), chains.joint("prismatic", d="a")))
    assert expressions(base) == ["Izz1 + Izz2 + 2 a sx2", "m2"]


def test_unnamed_lengths_stand_as_numbers(chains):
    base = base_parameters(chains.robot(chains.joint(), chains.joint(d=0.5)))
    assert base.expressions[0] == "Izz1 + 0.25 m2"


def test_parameters_of_equal_coefficient_with_absent_heads_are_merged(chains):
    shoulder = chains.joint(parameters=["Izz"])
    upper = chains.joint(parameters=[], alpha="-pi/2")
    elbow = chains.joint(parameters=["m"], d="a")
    robot = chains.robot(shoulder, upper, elbow)
    base = base_parameters(robot)
    assert expressions(base) == ["Izz1 + a^2 m3", "-a^2 m3"]
    assert base.heads == ("Izz1", "Ixx2")
    carriers = dict(zip(robot.standard_parameters, base.placement[:, 1], strict=True))
    assert {k: v for k, v in carriers.items() if v} == pytest.approx(
        {"Ixx2": 1, "Izz2": -1, "sx2": -1 / 0.3}
    )


def test_gravity_direction_counts(chains):
    joints = chains.joint(), chains.joint(alpha="pi/2")
    upright = base_parameters(chains.robot(*joints))
    tilted = base_parameters(chains.robot(*joints, gravity=(0, -6, -7)))
    assert {"sx1", "sy1"} & set(upright.heads) == set()
    assert {"sx1", "sy1"} <= set(tilted.heads)


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 2**32 - 1))
def test_any_chain_is_regrouped_without_contradiction_to_its_numeric_rank(chains, seed):
    robot = chains.random(seed)
    base = base_parameters(robot)  # raises if regrouping and rank disagree
    assert sorted(k for group in base.groups.values() for k in group) == list(range(len(base)))
    assert base.matrix.shape == (len(base), 10 * robot.n_joints)
    assert len(base) == (np.linalg.matrix_rank(base.matrix) if len(base) else 0)


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 2**32 - 1))
def test_expressions_mean_what_the_matrix_says(chains, seed):
    robot = chains.random(seed)
    base = base_parameters(robot)
    random = np.random.default_rng(seed)
    values = {name: random.normal() for name in robot.standard_parameters}
    numbers = base.matrix @ [values[name] for name in robot.standard_parameters]
    for text, number in zip(base.expressions, numbers, strict=True):
        python = re.sub(r"(?<=[\w)]) (?=[\w(])", "*", text.replace("^", "**"))
        assert eval(python, {**values, **robot.file.lengths}) == pytest.approx(number, abs=1e-4)  # noqa: S307
