"""`hil replay`: page and exit status."""

from __future__ import annotations

from typing import TYPE_CHECKING

from carriage_run import carriage, carriage_run

if TYPE_CHECKING:
    from pathlib import Path

    from command_line import Hil


def test_the_command_writes_a_page_and_its_status_says_whether_a_limit_was_passed(
    tmp_path: Path, hil: Hil
) -> None:
    folder = carriage_run().save(tmp_path / "run").path
    carriage().save(tmp_path / "model.yaml")
    command = "replay", folder, "--model", tmp_path / "model.yaml", "--max-error"
    status, out, _ = hil(*command, "20mm")
    assert status == 0
    assert "rms error" in out
    assert "all position errors are within their limits" in out
    page = (folder / "replay.html").read_text()
    assert 'id="plot-positions"' in page
    carriage(6.0).save(tmp_path / "model.yaml")
    status, out, _ = hil(*command, "20mm")
    assert status == 3
    assert "mm, at most 20.0 mm allowed" in " ".join(out.split())
    assert hil(*command, "2")[0] == 1
    assert hil(*command, "20mm", "--kp", "5")[0] == 2
