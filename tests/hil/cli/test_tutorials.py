"""Commands of the README, of its linked pages and of the tutorials have the printed results.

Not carried out anywhere: `pipx install .`, because it asks the package index; the program of the
wheel is started in tests/system/test_wheel.py. `hil try` of these pages is carried out in
test_try_command.py, `uvx` nowhere. The EtherCAT tutorial needs a network namespace:
tests/drivers/ethercat/test_over_a_cable.py.
"""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
import yaml
from walked import ROOT, Step, Walk, lacking, steps

from hil.ground_truth.true_parameters import true_parameters
from hil.results.model import Model

if TYPE_CHECKING:
    from command_line import Hil

EDS = ROOT / "sim_plant" / "canopen" / "cia402_drive.eds"
DESK = "--interface socketcan --channel can0"
WALKED = {
    "README.md",
    "docs/index.md",
    "docs/how-to/commissioning.md",
    "docs/tutorials/ethercat.md",
    "docs/tutorials/one-axis.md",
    "docs/tutorials/recording.md",
    "docs/tutorials/virtual-robot.md",
}
REFERENCE = {"docs/reference/plant.md", "docs/explanation/excluded.md", "docs/explanation/paper.md"}
"""Linked reference pages, without steps to follow."""


@pytest.fixture
def walk(hil: Hil, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Walk:
    monkeypatch.chdir(tmp_path)
    return Walk(hil, monkeypatch)


def doors(document: str) -> set[str]:
    text = (ROOT / document).read_text(encoding="utf-8")
    table = text.split("| you are | begin with |\n")[1].split("\n\n")[0]
    linked = re.findall(r"\]\((?:https://.*?/main/)?(.*?)\)", table)
    folder = (ROOT / document).parent
    return {str((folder / each).resolve().relative_to(ROOT)) for each in linked}


def test_every_door_and_tutorial_is_walked_and_both_front_pages_open_the_same_ones() -> None:
    assert doors("README.md") == doors("docs/index.md")
    tutorials = {str(path.relative_to(ROOT)) for path in (ROOT / "docs/tutorials").glob("*.md")}
    assert doors("README.md") | tutorials == WALKED - {"README.md", "docs/index.md"} | REFERENCE | {
        "docs/tutorials/index.md"
    }
    assert not steps("docs/tutorials/index.md")
    assert steps("docs/index.md") == [Step("hil try")]


def test_what_a_page_shows_and_a_command_does_not_print_is_found() -> None:
    printed = "head\n\none  1.5\ntwo 2.5 of 3\nthree\nlast\n"
    for shown in (["one 1.5", "two 2.5 ..."], ["head", "...", "three", "last"], ["", "two … 3"]):
        assert not lacking(shown, printed)
    for shown in (["one 1.6"], ["one 1.5", "three"], ["three", "...", "head"], ["two 2.5"]):
        assert lacking(shown, printed)


def test_readme_s_campaign_and_the_pages_that_go_on_with_it(walk: Walk) -> None:
    """One robot also serves as the next robot of the series, and passes the limits drafted from
    itself."""
    walk("README.md", {"pipx install .": "", "hil try": ""})
    walk("docs/how-to/results.md")
    walk("docs/how-to/view.md")
    walk(
        "docs/how-to/acceptance.md",
        {
            "hil run plan.yaml -o runs/next": "cp -r runs/first runs/next",
            "hil identify runs/next": "",
        },
    )
    page = (ROOT / "docs/how-to/acceptance.md").read_text(encoding="utf-8")
    shown = yaml.safe_load(page.split("```yaml\n")[1].split("```")[0])
    drafted = yaml.safe_load(Path("limits.yaml").read_text(encoding="utf-8"))
    assert shown["residual"].items() <= drafted["residual"].items()
    assert all(each in drafted["quantities"] for each in shown["quantities"])
    rest = {key: value for key, value in shown.items() if key not in {"residual", "quantities"}}
    assert rest.items() <= {key: drafted[key] for key in rest}.items()


def test_the_virtual_robot_is_identified_and_validated(walk: Walk) -> None:
    page = "docs/tutorials/virtual-robot.md"
    printed = "".join(walk(page, {"hil try": ""}).values())
    assert "hold the truth for 14 of 14 parameters" in printed
    (verdict,) = re.findall(r"(?m)^good: torque predicted within .* axis \d$", printed)
    assert verdict in (ROOT / page).read_text(encoding="utf-8")
    assert Path("runs/virtual/report.html").is_file()


def test_one_axis_is_identified_on_its_twin_and_then_as_on_the_desk(walk: Walk) -> None:
    """The twin serves as the drive on the desk; its drives file supplies the missing values."""
    shutil.copy(EDS, "drive.eds")
    printed = walk(
        "docs/tutorials/one-axis.md",
        {
            "ip link set can0 up type can bitrate 1000000": "",
            "--nodes 1 -o drives.yaml": "--nodes 1 -o drafted.yaml",
            DESK: "--channel twin/plant.yaml",
            " drives.yaml": " twin/drives.yaml",
        },
        # an arm that is held horizontal sags by more than the twin's position window
        ends={f"hil drives check drives.yaml {DESK}": 1},
    )
    assert "hold the truth for 2 of 2 parameters" in "".join(printed.values())
    assert Path("runs/desk/report.html").is_file()


def test_a_box_of_drives_is_commissioned(walk: Walk) -> None:
    page = "docs/how-to/commissioning.md"
    walk(page, ends={"hil drives check wrong.yaml --axis 1": 1})
    text = (ROOT / page).read_text(encoding="utf-8")
    drafted = text.split("```yaml\n")[1].split("```")[0]
    assert lacking(drafted.splitlines(), Path("draft.yaml").read_text(encoding="utf-8")) == []


def test_a_recording_is_identified_and_judged(walk: Walk) -> None:
    Path("examples").symlink_to(ROOT / "examples")
    walk("docs/tutorials/recording.md")
    model = Model.load("runs/head")
    plant = ROOT / "examples" / "pan_tilt" / "plant.yaml"
    truth, (low, high) = true_parameters(model.robot, plant), model.interval().T
    inside = (low <= truth) & (truth <= high)
    assert inside.sum() == 6
    missed = np.maximum(low - truth, truth - high)[~inside] / (high - low)[~inside]
    # ripple of these two motors resembles gravity
    assert (missed < 0.25).all()


def test_the_map_that_is_shown_is_the_one_that_comes_along() -> None:
    text = (ROOT / "docs/tutorials/recording.md").read_text(encoding="utf-8")
    (shown,) = re.findall(r"```yaml\n(.*?)```", text, re.DOTALL)
    kept = (ROOT / "examples" / "pan_tilt" / "excitation.yaml").read_text(encoding="utf-8")
    assert yaml.safe_load(shown) == yaml.safe_load(kept)
