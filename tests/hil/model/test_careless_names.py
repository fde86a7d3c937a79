"""Suggestions for mistyped keys and names, and names in messages without pattern syntax."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
import yaml

from checked_files.near import did_you_mean
from checked_files.yaml_file import FileError, load_yaml
from hil.errors import UnknownName
from hil.model.robot import ROBOTS, Robot
from hil.planning.plan import Plan, dump_plan, load_plan

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.parametrize(
    ("given", "known", "clause"),
    [
        ("velocty", ["velocity", "stroke"], "; did you mean velocity?"),
        ("torque", ["mass", "stroke"], ""),
        ("any", [], ""),
    ],
)
def test_the_nearest_known_name_is_offered_if_any_is_near(
    given: str, known: list[str], clause: str
) -> None:
    assert did_you_mean(given, known) == clause


@pytest.mark.parametrize(
    ("old", "new", "meant"),
    [
        ("gravity: [0", "gravty: [0", "gravty: unknown key; .*; did you mean gravity"),
        ("torque_limit: 945", "torque_limt: 945", r"joints\.0\.torque_limt: .* mean torque_limit"),
        ("{gear_ratio: 105", "{gear_rati: 105", r"joints\.0\.drive\.gear_rati: .* mean gear_ratio"),
    ],
)
def test_an_unknown_key_of_a_robot_file_names_the_key_that_is_near(
    old: str, new: str, meant: str, tmp_path: Path
) -> None:
    path = tmp_path / "robot.yaml"
    path.write_text((ROBOTS / "manutec-r15.yaml").read_text().replace(old, new, 1))
    with pytest.raises(FileError, match=meant):
        Robot.load(path)


def test_an_unknown_key_of_a_measurement_names_the_key_of_its_kind(
    small_plan: Plan, tmp_path: Path
) -> None:
    path = tmp_path / "plan.yaml"
    path.write_text(dump_plan(small_plan).replace("  velocity:", "  velocty:", 1))
    with pytest.raises(FileError, match=r"velocty: unknown key; .*; did you mean velocity\?"):
        load_yaml(path, Plan)


def test_an_unknown_robot_names_the_one_that_is_near() -> None:
    with pytest.raises(UnknownName, match=r"manutec: unknown robot; did you mean manutec-r15\?"):
        Robot.load("manutec")


def test_a_name_that_no_file_can_have_is_refused_in_words(tmp_path: Path) -> None:
    path = tmp_path / "robot.yaml"
    text = (ROBOTS / "manutec-r15.yaml").read_text()
    path.write_text(text.replace("name: manutec-r15", 'name: "man\\e[31m"', 1))
    with pytest.raises(
        FileError, match=r"name: 'man\\\\x1b\[31m' must begin with a letter or"
    ) as it:
        Robot.load(path)
    assert "^" not in str(it.value)


def test_a_configuration_of_too_few_joints_is_refused_with_its_line(
    small_plan: Plan, manutec: Robot, tmp_path: Path
) -> None:
    content = yaml.safe_load(dump_plan(small_plan))
    content["measurements"][0]["q"].pop()
    path = tmp_path / "plan.yaml"
    path.write_text(yaml.safe_dump(content))
    with pytest.raises(FileError, match=r"plan\.yaml:\d+: measurements\.0\.q: 5 values must be 6"):
        load_plan(path, manutec)
