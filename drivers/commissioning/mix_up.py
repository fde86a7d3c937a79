"""Whether a drive that contradicts its entry of the drives file is that of another entry.

Where node numbers are mixed up, each drive contradicts the entry that it is taken for; to correct
ratings until they fit would make it worse. So its identity (1018) and all that it says of motor,
encoder and gear are compared with the entries whose own drives do not fit them either.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.commissioning.configure import check_identity
from drivers.commissioning.consistency import comparisons
from drivers.commissioning.verdict import Grade
from drivers.drive_bus import DriveError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from drivers.drives_file import AxisDrive
    from drivers.remote_dictionary import RemoteDictionary


def mixed_up(
    server: RemoteDictionary,
    axis: AxisDrive,
    pairs: Iterable[tuple[RemoteDictionary, AxisDrive]],
) -> str | None:
    """Return which entries a drive fits that contradicts its own, with the remedy; None if none.

    Parameters
    ----------
    server : RemoteDictionary
        The drive; only read.
    axis : AxisDrive
        Its entry, which it contradicts.
    pairs : iterable of (RemoteDictionary, AxisDrive)
        All drives with their entries.
    """
    fitting = [
        (there, other)
        for there, other in pairs
        if other.node != axis.node and fits(server, other) and not fits(there, other)
    ]
    if not fitting:
        return None
    names = " or ".join(f"{other.name} (node {other.node})" for _, other in fitting)
    hint = f"by identity and ratings this is the drive of {names}"
    swapped = [other.node for there, other in fitting if fits(there, axis)]
    if len(swapped) == 1:
        nodes = " and ".join(map(str, sorted((server.node, *swapped))))
        return f"{hint}: nodes {nodes} are swapped, exchange them in the drives file"
    return f"{hint}: correct the node numbers in the drives file"


def fits(server: RemoteDictionary, axis: AxisDrive) -> bool:
    """Whether a drive confirms something that an entry states, and contradicts nothing."""
    looked_at = server.copy_through(lambda client: client)
    try:
        check_identity(looked_at, axis)
        found = {comparison.grade for comparison in comparisons(looked_at, axis)}
    except DriveError:
        return False
    return Grade.OK in found and Grade.REFUSED not in found
