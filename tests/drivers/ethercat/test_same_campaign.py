"""A campaign over EtherCAT gives the very numbers of one over CAN."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
import same_campaign

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.long
def test_every_data_set_is_the_same(tmp_path: Path) -> None:
    counts = {"gravity": 2, "inertia": 4, "coupling": 1}
    same, total, *_ = same_campaign.compared(counts, tmp_path)
    assert (same, total) == (7 * 6, 7 * 6)
