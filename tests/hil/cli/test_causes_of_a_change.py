"""`hil validate`, `accept`, `history` and `payload` name the causes of differences between two
runs.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
import yaml
from small_run import write_run
from synthetic import TABLE_3_A

from hil.commands import history
from hil.model.base_parameters import base_parameters
from hil.results.findings import identify_and_keep
from hil.results.model_file import NAME
from hil.runs.run import Run

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from command_line import Hil

    from hil.estimation.excluded.result import Excluded
    from hil.model.robot import Robot
    from hil.runs.pooling import Pooled

LOAD = {"m6": 10.86, "sz6": 1.5204, "Ixx6": 0.2387, "Iyy6": 0.2387, "Izz6": 0.047}
FOUND = ": axis 6: a load on the last link"


@pytest.fixture(scope="module")
def runs(manutec: Robot, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Identified runs: without a load, with a load, and with a load and another upper arm."""
    place = tmp_path_factory.mktemp("runs")
    phi = np.array([LOAD.get(name, 0.0) for name in manutec.standard_parameters])
    change = base_parameters(manutec).matrix @ phi
    other_arm = TABLE_3_A + change
    other_arm[base_parameters(manutec).names.index("p4")] *= 1.02
    for seed, (name, p) in enumerate(
        {"bare": TABLE_3_A, "loaded": TABLE_3_A + change, "other_arm": other_arm}.items()
    ):
        run = write_run(place / name, manutec, (manutec, p), seed=seed + 1)
        identify_and_keep(Run.open(run.path), "improved").model.save(run.path / NAME)
    return place


@pytest.fixture(scope="module", autouse=True)
def _each_pair_is_compared_once() -> Iterator[None]:
    """Commands differ in the runs that they compare and in what they print."""
    compare, found = history.changed, dict[object, "Excluded | None"]()

    def once(robot: Robot, before: Pooled, after: Pooled, known: Sequence[str]) -> Excluded | None:
        key = (*(each.path for runs in (before, after) for each in runs._folders), *known)
        if key not in found:
            found[key] = compare(robot, before, after, known)
        return found[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(history, "changed", once)
        yield


def test_a_validation_that_is_not_good_names_what_changed(hil: Hil, runs: Path) -> None:
    status, out, _ = hil("validate", runs / "loaded", "--model", runs / "bare" / "model.yaml")
    assert (status, "doubtful: " in out) == (0, True)
    assert FOUND in out
    assert "Changes that these recordings would show" in out


def test_a_history_names_what_changed_in_the_newest_run(hil: Hil, runs: Path) -> None:
    _, out, _ = hil("history", runs / "bare", runs / "loaded")
    assert FOUND in out


@pytest.mark.parametrize("drafted", [True, False])
def test_a_robot_that_is_not_accepted_is_compared_with_that_of_the_limits(
    hil: Hil, runs: Path, tmp_path: Path, *, drafted: bool
) -> None:
    limits = tmp_path / "limits.yaml"
    hil("accept", runs / "bare", "--draft", "-o", limits)
    beside = () if drafted else ("--reference", runs / "bare")
    if not drafted:
        content = yaml.safe_load(limits.read_text())
        limits.write_text(yaml.safe_dump(content | {"drafted_from": "elsewhere"}))
    given = "accept", runs / "loaded", "--limits", limits, "-o", tmp_path / "accepted", *beside
    status, out, _ = hil(*given)
    assert (status, FOUND in out) == (3, True)


def test_what_no_load_explains_is_looked_for_beside_it(hil: Hil, runs: Path) -> None:
    _, out, _ = hil("payload", runs / "bare", runs / "loaded")
    assert "cause of the difference" not in out
    _, out, _ = hil("payload", runs / "bare", runs / "other_arm")
    assert "something else changed between the runs" in out
    assert "besides the load" in out
    assert "load sx6" not in out


def test_a_reference_that_cannot_be_compared_is_stated(
    hil: Hil, runs: Path, tmp_path: Path
) -> None:
    model = tmp_path / "model.yaml"
    model.write_bytes((runs / "bare" / "model.yaml").read_bytes())
    _, out, _ = hil("validate", runs / "loaded", "--model", model)
    assert f"need recordings of both runs, and {tmp_path} holds none" in out
