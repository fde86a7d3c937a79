"""`hil plan --kind`: options of other kinds are refused with the reason."""

from __future__ import annotations

from typing import TYPE_CHECKING, get_args

import pytest
from small_run import identified_run

from hil.runs.run import Run
from hil.tasks.plans import KINDS, Unsuited, designed

if TYPE_CHECKING:
    from pathlib import Path

    from command_line import Hil


ROBOT = "manutec-r15"


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("--kind friction --minutes 5", "the experiment determines speeds and durations"),
        ("--kind friction --gravity 5", "--gravity does not apply to kind friction: it is for str"),
        ("--kind strokes --axis 2", "it is for friction"),
        ("--kind strokes --period 20", "it is for trajectory"),
        ("--kind trajectory --experiment stops", "it is for friction"),
        (
            "--kind trajectory --workspace cell.yaml",
            "trajectories are only checked against joint limits",
        ),
        ("--kind load --model RUN", "the robot is that of the run without the load"),
        ("--kind friction --experiment stops", "stops takes one axis; give it with --axis"),
        ("--kind strokes --at-most 4", "it is for load"),
        ("--with-trajectories", "for only trajectories use kind trajectory"),
    ],
)
def test_options_of_another_kind_are_refused_with_the_reason(
    line: str, why: str, hil: Hil, tmp_path: Path
) -> None:
    words = line.split()
    if "RUN" in words:
        words[words.index("RUN")] = str(identified_run(tmp_path / "run"))
    if "cell.yaml" in words:
        (tmp_path / "cell.yaml").write_text("boxes: []\n")
        words[words.index("cell.yaml")] = str(tmp_path / "cell.yaml")
    status, _, err = hil("plan", ROBOT, *words, "-o", tmp_path / "plan.yaml")
    assert status == 2, err
    assert why in " ".join(err.replace("│", " ").split())
    assert not (tmp_path / "plan.yaml").exists()


@pytest.mark.parametrize("kind", ["friction", "trajectory"])
def test_a_robot_is_needed(kind: str, hil: Hil, tmp_path: Path) -> None:
    status, _, err = hil("plan", "--kind", kind, "-o", tmp_path / "plan.yaml")
    assert (status, "give a robot" in err) == (2, True)


@pytest.mark.long
def test_a_load_s_plan_is_made_beside_a_run_without_it(hil: Hil, tmp_path: Path) -> None:
    run, plan = identified_run(tmp_path / "run"), tmp_path / "slow.yaml"
    status, _, err = hil("plan", "--kind", "load", "--model", run, "--at-most", 500, "-o", plan)
    assert (status, "a load of 500 kg" in err, "lighter load" in err) == (1, True, True)
    status, _, err = hil("plan", "--kind", "load", "-o", plan)
    assert (status, "kind load needs the run without the load" in err) == (2, True)
    options = {"model": Run.open(run), "refine": [run], "at_most": 5.0}
    with pytest.raises(Unsuited, match="for slow strokes; with refine the load is known"):
        designed("load", **options)


def test_every_kind_is_offered() -> None:
    from hil.cli.planning import Kind

    assert get_args(Kind) == tuple(KINDS)
