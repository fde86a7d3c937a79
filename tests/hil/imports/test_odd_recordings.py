"""Any imported recording is identified without traceback, NaN or warning."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from small_recording import a_map, table, write_csv, write_map

from hil.errors import HilError
from hil.imports.importing import import_recordings
from hil.results.identification import identify
from hil.results.model import Model

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Columns = dict[str, Any]

ACCEPT = ["range", "velocity", "shape", "still", "spikes"]


def coarse(step: float, *names: str) -> Callable[[Columns], None]:
    """Return a function that rounds columns to a step."""

    def change(columns: Columns) -> None:
        for name in names:
            columns[name] = np.round(columns[name] / step) * step

    return change


def constant(value: float, *names: str) -> Callable[[Columns], None]:
    """Return a function that sets columns to a value."""

    def change(columns: Columns) -> None:
        for name in names:
            columns[name] = np.full(len(columns["t"]), value)

    return change


def trembling(columns: Columns) -> None:
    noise = np.random.default_rng(0).standard_normal(len(columns["t"]))
    columns["q2"] = 0.3 + 1e-4 * noise


def resting(columns: Columns) -> None:
    constant(0.3, "q2")(columns)
    constant(0.0, "m2")(columns)


def slow(columns: Columns) -> None:
    columns["q1"] = np.linspace(-1.0, 1.0, len(columns["t"]))
    columns["q2"] = np.linspace(1.0, -1.0, len(columns["t"]))


KINDS = {
    "no noise": lambda _: None,
    "positions in steps of 0.01 rad": coarse(0.01, "q1", "q2"),
    "positions in steps of 0.3 rad": coarse(0.3, "q1", "q2"),
    "torques in steps of 8 N m": coarse(8.0, "m1", "m2"),
    "first axis at rest": constant(0.3, "q1"),
    "second axis at rest": constant(0.3, "q2"),
    "second axis at rest without torque": resting,
    "second axis trembles": trembling,
    "both axes at rest": constant(0.3, "q1", "q2"),
    "slow axes": slow,
    "constant torque of the first axis": constant(3.0, "m1"),
    "constant torque of the second axis": constant(3.0, "m2"),
    "constant torques": constant(5.0, "m1", "m2"),
    "no torque of the first axis": constant(0.0, "m1"),
    "no torque of the second axis": constant(0.0, "m2"),
    "no torques": constant(0.0, "m1", "m2"),
}  # fmt: skip


@pytest.mark.long
@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("unknown", [False, True], ids=["known gains", "unknown gain"])
@pytest.mark.parametrize("kind", KINDS)
def test_odd_recordings_are_identified_or_refused(tmp_path: Path, kind: str, unknown: bool) -> None:
    columns = table(20.0)
    KINDS[kind](columns)
    write_csv(tmp_path / "data.csv", columns)
    content = a_map(accept=ACCEPT)
    if unknown:
        content["joints"][1]["torque"] |= {"unit": "A", "gain": "unknown"}
    try:
        run = import_recordings([write_map(tmp_path, content)], tmp_path / "run")
        model = identify(run)
    except HilError as error:
        assert "nan" not in str(error)  # noqa: PT017 - what is refused is as good
        return
    model.save(tmp_path / "model.yaml")  # fails for NaN
    assert Model.load(tmp_path / "model.yaml").verdict == model.verdict
    assert model.verdict is not None
