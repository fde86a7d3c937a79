"""A campaign over EtherCAT gives exactly the numbers of a campaign over CAN."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
import same_campaign

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.long
def test_every_data_set_is_the_same(tmp_path: Path) -> None:
    counts = {"gravity": 4, "inertia": 10, "coupling": 1}
    same, total, *_ = same_campaign.compared(counts, tmp_path)
    assert (same, total) == (15 * 6, 15 * 6)
