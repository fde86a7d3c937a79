"""CANopen slave without a profile: the services of CiA 301 around an object dictionary.

The node is independent of the bus. Frames come in through the handlers of `routes` and go out
through `emit`. The handlers change with NMT state and configuration; then the node calls `rewired`
and the network reads `routes` again.
"""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

from sim_plant.canopen.abort_codes import AbortCode, SdoAbort
from sim_plant.canopen.cob_id import FLAG, IDENTIFIER, check_change
from sim_plant.canopen.eds import STORE_EDS, drive_eds
from sim_plant.canopen.emcy import Emergencies, ErrorCode
from sim_plant.canopen.heartbeat import HEARTBEAT, HeartbeatConsumer, HeartbeatProducer
from sim_plant.canopen.multi_axis import NodeDictionary, multi_axis_eds
from sim_plant.canopen.nmt import NmtSlave, NmtState
from sim_plant.canopen.node_guarding import NodeGuarding
from sim_plant.canopen.object_dictionary import ObjectDictionary
from sim_plant.canopen.pdo import Rpdo, Tpdo
from sim_plant.canopen.sdo_server import SdoServer
from sim_plant.canopen.sync_counter import SyncCounter
from sim_plant.personality import PLAIN, Personality

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from sim_plant.canopen.pdo import Report
    from sim_plant.canopen.timers import Timers

PDOS = 4
"""PDOs in each direction."""

_STATE_AFTER_LOSS = {0: NmtState.PRE_OPERATIONAL, 2: NmtState.STOPPED}
"""State of an operational node after a loss of communication (1029h:1); 1 changes nothing."""


class CanopenNode:
    """Communication of a slave.

    Parameters
    ----------
    node_id : int
    timers : Timers
        Shared by all nodes of the bus.
    emit : callable
        Sends a frame: identifier and data.
    rewired : callable
        Called when any of `routes`, `remote_routes`, `sync_actions`, `sync_reports` and
        `event_actions` has changed.
    personality : Personality
        Visible objects of the dictionary, and timing of RPDOs.
    axis : int
        Number of the axis in the node, from 1; the first axis serves the whole node (see `join`).
    """

    def __init__(
        self,
        node_id: int,
        timers: Timers,
        emit: Callable[[int, bytes], None],
        rewired: Callable[[], None],
        personality: Personality = PLAIN,
        axis: int = 1,
    ) -> None:
        self.node_id = node_id
        self._axes: Sequence[CanopenNode] = (self,)
        self._speaks = axis == 1
        self._sheet = drive_eds(personality)
        self._connected = True
        self._rpdo_at_once = personality.rpdo_at_once
        self._emit = emit
        self._rewired = rewired
        self.dictionary = ObjectDictionary(node_id, personality, axis=axis)
        self.emergencies = Emergencies(self.dictionary, emit)
        self.nmt = NmtSlave(
            node_id, axis, self._nmt_changed, self._reset, timers, personality.start_lag
        )
        self._sdo = SdoServer(
            self.dictionary,
            functools.partial(emit, 0x580 + node_id),
            states_size=personality.sdo_states_size,
        )
        self._producer = HeartbeatProducer(self.dictionary, timers, self._send_state)
        self._consumer = HeartbeatConsumer(
            self.dictionary, timers, self._lose_heartbeat, self._regain_heartbeat, rewired
        )
        self._guarding = NodeGuarding(
            self.dictionary, timers, self._send_state, self._lose_heartbeat, self._regain_heartbeat
        )
        self.sync_counter = SyncCounter(self.dictionary, self.emergencies, rewired)
        self._rpdos = [Rpdo(self.dictionary, n, rewired, self.emergencies) for n in range(PDOS)]
        self._tpdos = [Tpdo(self.dictionary, n, rewired, emit, timers) for n in range(PDOS)]
        self.dictionary.guard(0x1005, self._check_sync_identifier)
        self.dictionary.react(0x1017, lambda _subindex, _value: rewired())
        self.dictionary.react(0x1005, lambda _subindex, _value: rewired())

    # Services for the bus

    def boot(self) -> None:
        """Begin as after power-on or a reset: boot-up message, then pre-operational."""
        self._consumer.restart()
        self._guarding.restart()
        self._producer.restart()
        self._sdo.reset()
        for pdo in (*self._rpdos, *self._tpdos):
            pdo.configure()
        self._send_state()
        self.nmt.enter(NmtState.PRE_OPERATIONAL)

    def join(self, others: Sequence[CanopenNode]) -> None:
        """Serve further axes of this node, in order, through the SDO server of this axis."""
        axes = (self, *others)
        self._sdo.serve(NodeDictionary([node.dictionary for node in axes]))
        sheet = multi_axis_eds([node._sheet for node in axes])
        self.dictionary.preset(STORE_EDS, 0, sheet.encode("ascii"))
        for node in axes:
            node._axes = axes

    def connect(self, connected: bool) -> None:
        """Connect or disconnect the node; the firmware keeps running."""
        for node in self._axes:
            node._connected = connected
        self._rewired()

    @property
    def sync_identifier(self) -> int:
        """Identifier of the SYNC that this node follows."""
        return self.dictionary.get(0x1005) & IDENTIFIER

    @property
    def is_watching(self) -> bool:
        """True if the loss of a heartbeat named by 1016h would be noticed, or has been."""
        return self._consumer.is_supervising

    def routes(self) -> list[tuple[int, Callable[[bytes], None]]]:
        """Return the identifiers received in the present state, with their handlers."""
        if not self._connected:
            return []
        routes: list[tuple[int, Callable[[bytes], None]]] = [(0, self.nmt.receive)]
        for node in self._consumer.watched:
            hear = functools.partial(self._hear, node)
            routes.append((HEARTBEAT + node, hear))
        if self._speaks and self.nmt.state in (NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL):
            routes.append((0x600 + self.node_id, self._sdo.receive))
        if self._operational:
            routes += [(r.identifier, self._taker(r)) for r in self._rpdos if r.enabled]
        return routes

    def remote_routes(self) -> list[tuple[int, Callable[[], None]]]:
        """Return the identifiers of remote frames answered in the present state, with handlers."""
        tpdos = self._tpdos if self._operational else []
        routes = [(t.identifier, t.answer_remote) for t in tpdos if t.enabled and t.answers_remote]
        if self._connected and self._guarding.available:
            routes.append((HEARTBEAT + self.node_id, self._guarding.request))
        return routes

    def sync_actions(self) -> list[Callable[[], None]]:
        """Return the actions of a SYNC in the present state: TPDOs that may be sent."""
        tpdos = self._tpdos if self._operational else []
        return [
            pdo.act_on_sync
            for pdo in tpdos
            if pdo.enabled and pdo.is_synchronous and not pdo.answers_every_sync
        ]

    def sync_rpdos(self) -> list[Rpdo]:
        """Return the synchronous RPDOs that are enabled in the present state."""
        rpdos = self._rpdos if self._operational else []
        return [rpdo for rpdo in rpdos if rpdo.enabled and rpdo.is_synchronous]

    def sync_reports(self) -> list[Report]:
        """Return the TPDOs sent after every SYNC in the present state."""
        tpdos = self._tpdos if self._operational else []
        return [tpdo.report() for tpdo in tpdos if tpdo.enabled and tpdo.answers_every_sync]

    def event_actions(self) -> list[Callable[[], None]]:
        """Return the checks of event-driven TPDOs, to be called after possible changes of data."""
        tpdos = self._tpdos if self._operational else ()
        return [tpdo.event for tpdo in tpdos if tpdo.enabled and not tpdo.is_synchronous]

    # Hooks for a profile

    def _abort_connection(self, code: ErrorCode) -> None:
        """React to a loss of communication (6007h) with the given cause."""

    def _regain_heartbeat(self) -> None:
        """React to the return of all watched heartbeats."""
        self.emergencies.clear(ErrorCode.HEARTBEAT_LOST)

    def _reset_profile(self) -> None:
        """Reset the profile to its state after power-on."""

    # Internals

    @property
    def _operational(self) -> bool:
        return self._connected and self.nmt.state is NmtState.OPERATIONAL

    def _taker(self, rpdo: Rpdo) -> Callable[[bytes], None]:
        if not (self._rpdo_at_once and rpdo.is_synchronous):
            return rpdo.receive

        def take(data: bytes) -> None:
            rpdo.receive(data)
            rpdo.act_on_sync()

        return take

    def _nmt_changed(self, state: NmtState) -> None:
        self.emergencies.enabled = state in (NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL)
        if state is not NmtState.OPERATIONAL:
            for rpdo in self._rpdos:
                rpdo.stop()
            for tpdo in self._tpdos:
                tpdo.stop()
        if state in (NmtState.STOPPED, NmtState.INITIALISING):
            self._sdo.reset()
            self._abort_connection(ErrorCode.COMMUNICATION)
        self._rewired()

    def _reset(self, whole_node: bool) -> None:
        self.emergencies.reset()
        if whole_node:
            self.dictionary.reset(0x2000, 0x9FFF)
            self._reset_profile()
        self.dictionary.reset(0x1000, 0x1FFF)
        self.boot()

    @property
    def _watched(self) -> bool:
        """True if all watched heartbeats and guarding requests are present."""
        return self._consumer.all_present and self._guarding.present

    def _send_state(self, toggle: int = 0) -> None:
        if self._speaks:
            self._emit(HEARTBEAT + self.node_id, bytes([self.nmt.state | toggle]))

    def _hear(self, node: int, data: bytes) -> None:
        if len(data) == 1:
            self._consumer.hear(node)

    def _lose_heartbeat(self) -> None:
        self.emergencies.raise_error(ErrorCode.HEARTBEAT_LOST)
        self._abort_connection(ErrorCode.HEARTBEAT_LOST)
        after = _STATE_AFTER_LOSS.get(self.dictionary.get(0x1029, 1))
        if self._operational and after is not None:
            self.nmt.enter(after)

    def _check_sync_identifier(self, _subindex: int, value: int) -> None:
        if value & FLAG:  # we produce no SYNC
            raise SdoAbort(AbortCode.INVALID_VALUE)
        check_change(1 << 31, value)
