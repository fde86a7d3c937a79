"""CoE's own in the object dictionaries of drives (`drivers.dictionary.bus_rules.BusRules`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.commissioning.held_values import assignment_slot, mapping_count
from drivers.dictionary.bus_rules import BusRules, ProcessDataReview
from drivers.ethercat.objects import ASSIGNED_IN, ASSIGNED_OUT
from drivers.ethercat.pdo_set_up import MAPPING_IN, MAPPING_OUT
from drivers.ethercat.requirements import REQUIREMENTS
from drivers.ethercat.restoring import restore_process_data

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drivers.dictionary.current_candidates import CurrentCandidate
    from drivers.dictionary.dictionary import Dictionary


def _review(_: Dictionary, usable: Sequence[CurrentCandidate]) -> ProcessDataReview:
    """Take the first current object: process data of EtherCAT have room for any."""
    return ProcessDataReview(usable[0] if usable else None, None, ())


RULES = BusRules(
    requirements=REQUIREMENTS,
    asked=tuple(
        entry
        for index, mapping in ((ASSIGNED_OUT, MAPPING_OUT), (ASSIGNED_IN, MAPPING_IN))
        for entry in (assignment_slot(index, 1), mapping_count(mapping))
    ),
    mappings=(MAPPING_OUT, MAPPING_IN),
    restore_process_data=restore_process_data,
    review_process_data=_review,
)
"""No watchdog is an object: that of the sync manager is put back by `EthercatDrive.hand_back`."""
