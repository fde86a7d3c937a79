"""Slaves on one cable, with ideal motors."""

from __future__ import annotations

import pytest
from ideal_machine import IdealMachine

from sim_plant.ethercat.segment import Segment


@pytest.fixture
def segment() -> Segment:
    network = Segment(IdealMachine(3))
    network.power_on()
    return network
