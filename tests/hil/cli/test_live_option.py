"""`--live`: optional port, and refusals before any motion."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from hil.cli.measuring import PORTS, insert_ports
from hil.planning.plan import dump_plan

if TYPE_CHECKING:
    from pathlib import Path

    from command_line import Hil

    from hil.planning.plan import Plan


@pytest.fixture
def plan_file(tmp_path: Path, small_plan: Plan) -> Path:
    path = tmp_path / "plan.yaml"
    path.write_text(dump_plan(small_plan))
    return path


def test_a_port_may_be_given_or_not() -> None:
    assert insert_ports(["plan.yaml", "--live", "-o", "run"]) == [
        *("plan.yaml", "--live", str(PORTS["--live"]), "-o", "run"),
    ]
    assert insert_ports(["--live", "plan.yaml"]) == ["--live", str(PORTS["--live"]), "plan.yaml"]
    assert insert_ports(["plan.yaml", "--live"]) == ["plan.yaml", "--live", str(PORTS["--live"])]
    for given in (["--live", "0"], ["--live", "9000"], ["--live=9000"], ["--live", "-1"]):
        assert insert_ports(given) == given


def test_what_cannot_be_served_is_refused_before_anything_moves(
    hil: Hil, plan_file: Path, tmp_path: Path
) -> None:
    call = ("run", plan_file, "-o", tmp_path / "run")
    status, _, _ = hil(*call, "--live", "70000")
    assert status == 2
    status, _, err = hil(*call, "--live", "--live-address", "robot.example")
    assert (status, "not an IP address" in err) == (2, True)
    status, _, err = hil(*call, "--live-address", "0.0.0.0")  # noqa: S104 - on purpose
    assert (status, "--live" in err) == (2, True)
    status, _, err = hil(*call, "--live", "0", "--live-address", "192.0.2.1")
    assert (status, "cannot be served" in err) == (1, True)
    assert not (tmp_path / "run").exists()
