"""Scan of the line: slaves and their offers.

A slave gives access to its objects in PREOP, so each is brought there, and back to INIT if found
there; nothing else is written, and nothing is energised.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.dictionary.found_nodes import Scan
from drivers.dictionary.live import read_dictionary
from drivers.dictionary.review import review
from drivers.drive_bus import DriveRefused
from drivers.ethercat.drive import EthercatDrive
from drivers.ethercat.rules import RULES
from drivers.ethercat.slaves import Slaves
from drivers.remote_dictionary import NoAnswer

if TYPE_CHECKING:
    from collections.abc import Callable

    from drivers.ethercat.line import Line
    from drivers.ethercat.station import Station


def scan_line(line: Line, is_asked: Callable[[int], bool], timeout: float) -> Scan:
    """Find the slaves on a line and their offers.

    Parameters
    ----------
    line : Line
        Line of the slaves.
    is_asked : callable
        Returns True if the slave at a position, from 1, is to be read.
    timeout : float
        Longest response time [s].

    Raises
    ------
    BusUnavailable
        No frame returns, or another master is at work.
    """
    scan = Scan()
    for station in Slaves(line).all:
        if is_asked(station.position):
            _read_slave(station, scan, timeout)
    return scan


def _read_slave(station: Station, scan: Scan, timeout: float) -> None:
    node = station.position
    found = scan.heard(node)
    found.state, found.shown_by = station.shown, "AL state"
    drive = EthercatDrive(lambda: station, station.line, f"slave {node}", timeout)
    try:
        drive.bring_up()
        found.dictionary = read_dictionary(drive, node, RULES)
        found.review = review(found.dictionary, RULES)
        found.answers = 1
        drive.hand_back()
    except (NoAnswer, DriveRefused) as error:
        found.state = f"{found.state}; {error}"
