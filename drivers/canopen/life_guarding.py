"""Life guarding (CiA 301), for drives that cannot watch our heartbeat: the requests.

The master asks each such node for its state at intervals, by a remote frame under the identifier of
its heartbeat. The node answers with a toggle bit and its NMT state, which is as good as a heartbeat
to us. Requests go out with our heartbeat and stop with it, so that both kinds of drives stop alike.
"""

from __future__ import annotations

import can

ERROR_CONTROL = 0x700


def guarding_request(node: int) -> can.Message:
    """Return the remote frame that asks a node for its state."""
    return can.Message(
        arbitration_id=ERROR_CONTROL + node, is_remote_frame=True, is_extended_id=False, dlc=1
    )
