"""`hil run --foxglove`: addresses, and files left behind."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest

from hil.planning.plan import dump_plan
from hil.runs.run import Run

if TYPE_CHECKING:
    from pathlib import Path

    from command_line import Hil

    from hil.planning.plan import Plan

pytest.importorskip("foxglove")


def test_a_run_states_where_it_is_streamed_and_records_as_ever(
    hil: Hil, small_plan: Plan, tmp_path: Path
) -> None:
    (tmp_path / "plan.yaml").write_text(dump_plan(small_plan))
    status, out, err = hil("run", tmp_path / "plan.yaml", "-o", tmp_path / "run", "--foxglove", "0")
    assert (status, err) == (0, "")
    assert re.search(r"Foxglove: open a connection to ws://127\.0\.0\.1:\d+\n", out)
    assert not Run.open(tmp_path / "run").missing


def test_an_address_alone_is_refused(hil: Hil, small_plan: Plan, tmp_path: Path) -> None:
    (tmp_path / "plan.yaml").write_text(dump_plan(small_plan))
    status, _, err = hil(
        "run", tmp_path / "plan.yaml", "-o", tmp_path / "run", "--foxglove-address", "10.0.0.1"
    )
    assert status == 2
    assert "needs --foxglove" in err
    assert not (tmp_path / "run").exists()
