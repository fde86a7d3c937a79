"""`hil view` and `hil dry-run --page`: paths of pages, and refusals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from hil.planning.plan import dump_plan
from hil.planning.workspace import Box, Workspace
from hil.view.page import MARK

if TYPE_CHECKING:
    from pathlib import Path

    from command_line import Hil

    from hil.planning.plan import Plan


@pytest.fixture
def plan_file(small_plan: Plan, tmp_path: Path) -> Path:
    path = tmp_path / "plan.yaml"
    path.write_text(dump_plan(small_plan))
    return path


def test_the_page_of_a_plan_stands_beside_it(hil: Hil, plan_file: Path) -> None:
    status, printed, _ = hil("view", plan_file)
    assert status == 0
    page = plan_file.with_suffix(".html")
    assert f"page in {page} (0.6 MB)" in printed
    assert MARK in page.read_text(encoding="utf-8")


def test_a_robot_is_shown_by_its_name(hil: Hil, tmp_path: Path) -> None:
    assert hil("view", "manutec-r15", "-o", tmp_path / "arm.html")[0] == 0
    assert "6 joints" in (tmp_path / "arm.html").read_text(encoding="utf-8")


def test_a_plan_that_is_refused_can_be_looked_at(
    hil: Hil, plan_file: Path, small_plan: Plan
) -> None:
    table = Workspace(boxes=(Box(name="table", low=(0.3, -1.0, -1.0), high=(1.2, 1.0, 0.0)),))
    plan_file.write_text(dump_plan(small_plan.model_copy(update={"workspace": table})))
    page = plan_file.with_name("seen.html")
    status, _, said = hil("dry-run", plan_file, "--page", page)
    assert status == 1
    assert "into table" in said
    assert "into table" in page.read_text(encoding="utf-8")


def test_what_is_no_page_of_ours_is_kept(hil: Hil, plan_file: Path) -> None:
    page = plan_file.with_suffix(".html")
    page.write_text("mine")
    status, _, said = hil("view", plan_file)
    assert status == 1
    assert "choose another name" in said
    assert hil("dry-run", plan_file, "--page", page)[0] == 1
    assert page.read_text() == "mine"


@pytest.mark.parametrize("option", ["--robot", "--model"])
def test_options_that_say_nothing_about_a_robot_are_refused(hil: Hil, option: str) -> None:
    status, _, said = hil("view", "manutec-r15", option, "other.yaml")
    assert status == 2
    assert f"{option} does not apply to a robot" in said


def test_a_file_that_is_neither_plan_nor_robot_is_refused(hil: Hil, tmp_path: Path) -> None:
    (tmp_path / "notes.yaml").write_text("a: 1\n")
    status, _, said = hil("view", tmp_path / "notes.yaml")
    assert status == 1
    assert "notes.yaml" in said
