"""Defects of the drive's obedience: commands of the controlword without effect.

Only commands by controlword are affected. The reaction to the loss of a heartbeat belongs to
another part of the firmware, which works: where 6007h names a reaction, a disobedient drive ends in
FAULT by way of the fault reaction (605Eh), even if 6007h names the quick stop without effect. The
watchdog is therefore the last resort of the master of such a drive.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sim_plant.drive.cia402_states import Command


@dataclass(frozen=True, slots=True)
class Disobedience:
    """Ignored commands of a drive while its axis is energised.

    Attributes
    ----------
    ignored : frozenset of Command
        Commands without effect.
    keeps_voltage : bool
        A quick stop ends in QUICK STOP ACTIVE, regardless of 605Ah.
    runs_on : bool
        A quick stop changes only the state: the axis continues to its target.
    """

    ignored: frozenset[Command] = frozenset()
    keeps_voltage: bool = False
    runs_on: bool = False


OBEDIENT = Disobedience()
