"""What a run needs of a drive's objects over EtherCAT: the profile's, and those of process data."""

from __future__ import annotations

from drivers.commissioning.held_values import mapping_count
from drivers.commissioning.requirement import ROUNDED, Use, refused, silent
from drivers.commissioning.requirements import add_rows
from drivers.ethercat.objects import ASSIGNED_IN, ASSIGNED_OUT, CYCLES

_ANY = range(1 << 32)
_MASTER = "it takes its cycle from the frames"

REQUIREMENTS = add_rows((
    refused(
        mapping_count(ASSIGNED_OUT), Use.SET, "it cannot be commanded by process data",
        serves=_ANY, served="what it assigns must carry controlword and target",
    ),
    refused(
        mapping_count(ASSIGNED_IN), Use.SET, "it sends no process data",
        serves=_ANY, served="what it assigns must carry statusword, position and current",
    ),
    *(
        silent(each, Use.SET, _MASTER, serves=_ANY, kept=ROUNDED, served=_MASTER)
        for each in CYCLES
    ),
))  # fmt: skip
"""The rows by object, in the order in which a drive is asked for them."""
