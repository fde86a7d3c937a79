"""What a command is to write, and where, is looked at before it computes."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

    from command_line import Hil


def test_a_plan_without_a_folder_to_stand_in_is_refused_as_wrong_usage(
    hil: Hil, tmp_path: Path
) -> None:
    output = tmp_path / "no" / "plan.yaml"
    status, _, err = hil("plan", "manutec-r15", "-o", output)
    assert (status, "there is no folder" in err) == (2, True)
    assert not output.parent.exists()
