"""``gain: unknown`` in a map: imported unscaled, identified, and predicted in SI."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from free_run import TRUTH, arm, recorded
from small_recording import a_map, write_csv, write_map

from checked_files.yaml_file import FileError
from hil.errors import Mismatch
from hil.imports.importing import import_recordings
from hil.report.page import report
from hil.results.identification import identify
from hil.results.model import Model
from hil.results.predicted_torques import predicted_torques
from hil.results.validation import scored
from hil.runs.pooling import pooled

if TYPE_CHECKING:
    from pathlib import Path

    from hil.imports.statement import Statement
    from hil.runs.run import Run

GAIN = 0.25


def write_columns(folder: Path, gain: float, name: str = "data.csv") -> None:
    """Write half a minute of two axes; the first torque has an unknown gain."""
    ((_, made),) = recorded(arm(), TRUTH, n=1, duration=30.0)
    named = ["t", "q1", "q2", "m1", "m2"]
    columns = [made.time, *made.q.T, made.tau[:, 0] / gain, made.tau[:, 1]]
    write_csv(folder / name, dict(zip(named, columns, strict=True)))


def write_map_of(folder: Path, content: dict[str, object], name: str = "map.yaml") -> Path:
    path = write_map(folder, content, name)
    (folder / "pair.yaml").write_text(arm().text)
    return path


def imported(folder: Path, name: str = "run", stated: list[Statement] | None = None) -> Run:
    """Return a run whose first torque is a current with unknown gain."""
    write_columns(folder, GAIN)
    content = a_map()
    content["joints"][0]["torque"] = {"column": "m1", "unit": "A", "gain": "unknown"}
    heard = [] if stated is None else stated
    return import_recordings([write_map_of(folder, content)], folder / name, heard.append)


def test_an_unknown_gain_is_stated_identified_kept_and_shown(tmp_path: Path) -> None:
    stated: list[Statement] = []
    run = imported(tmp_path, stated=stated)
    assert "gain of joint 1 unknown: torques stay in A" in "\n".join(stated[0].lines())
    model = identify(run)
    model.save(run.path / "model.yaml")
    (gain,) = Model.load(run.path).details.gains
    assert gain.axis == 1
    assert gain.value == pytest.approx(GAIN, rel=0.02)
    assert "gain of axis 1, unknown in the map: 0.2" in str(model.summary())
    assert "gain of axis 1, unknown in the map: 0.2" in report(run).read_text()


def test_a_model_with_the_gain_predicts_other_recordings_of_unknown_gain(tmp_path: Path) -> None:
    run = imported(tmp_path)
    other = imported(tmp_path, "other")
    model = identify(run)
    judged = scored(model, predicted_torques(model, pooled([other])))
    assert judged.axes[0].gain == pytest.approx(1.0, abs=0.02)
    ((_, current),) = pooled([other])
    in_torque = GAIN * np.sqrt(np.mean(current.tau[:, 0] ** 2))
    assert judged.axes[0].torque == pytest.approx(in_torque, rel=0.03)
    with pytest.raises(Mismatch, match="the gain of axis 1 is unknown, and the model holds none"):
        list(predicted_torques(_gainless(tmp_path), pooled([other])))


def _gainless(folder: Path) -> Model:
    write_columns(folder, 1.0, "plain.csv")
    plain = write_map_of(folder, a_map("plain.csv"), "plain.yaml")
    return identify(import_recordings([plain], folder / "plain"))


def test_maps_that_disagree_on_an_unknown_gain_make_no_run(tmp_path: Path) -> None:
    imported(tmp_path)
    known = write_map_of(tmp_path, a_map(), "known.yaml")
    with pytest.raises(FileError, match=r"known.yaml:\d+: joints: joints of unknown gain differ"):
        import_recordings([tmp_path / "map.yaml", known], tmp_path / "both")
    assert not (tmp_path / "both").exists()


def test_an_unknown_gain_of_a_motor_that_two_joints_share_is_refused(tmp_path: Path) -> None:
    imported(tmp_path)
    content = a_map(torque_side="motor")
    content["joints"][1]["torque"] = {"column": "m2", "unit": "A", "gain": "unknown"}
    path = write_map(tmp_path, content, "coupled.yaml")
    (tmp_path / "pair.yaml").write_text(arm().text + "couplings:\n  - {motor: 2, joint: 1}\n")
    with pytest.raises(FileError, match=r"joints.1.torque.gain: motor 2 acts on joints 1 and 2"):
        import_recordings([path], tmp_path / "coupled")
