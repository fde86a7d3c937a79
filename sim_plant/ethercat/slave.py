"""EtherCAT slave with a drive: controller, states, mailbox, process data, clock.

The slave processes each frame twice: while it passes (`serve`), and after it has passed (`work`),
when its consequences are executed. With SYNC0 activated, outputs act and inputs are latched at each
SYNC0; otherwise when the frame with the outputs has passed. In both cases a master reads inputs
latched before its frame came.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from sim_plant.canopen.emcy import Emergencies, ErrorCode
from sim_plant.canopen.object_dictionary import ObjectDictionary
from sim_plant.drive.cia402_drive import Cia402Drive
from sim_plant.ethercat import eeprom
from sim_plant.ethercat import registers as reg
from sim_plant.ethercat.al_states import AlCode, AlState, AlStates
from sim_plant.ethercat.clock import Clock
from sim_plant.ethercat.coe import CoeServer
from sim_plant.ethercat.controller import Controller
from sim_plant.ethercat.mailbox import HEADER, IN, OUT, Mailbox
from sim_plant.ethercat.objects import (
    BY_SYNC0,
    CYCLE_MAX,
    MIN_CYCLE,
    SYNC_IN,
    SYNC_OUT,
    coe_entries,
    drive_objects,
    strip_can,
)
from sim_plant.ethercat.process_data import SIZE_MAX, ProcessData

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from sim_plant.canopen.timers import Timers
    from sim_plant.drive.process_image import AxisImage
    from sim_plant.drive_settings import DriveSettings
    from sim_plant.ethercat.controller import SyncManager
    from sim_plant.ethercat.frame import Datagram
    from sim_plant.machine_protocol import Axis

OUTPUTS, INPUTS = 2, 3
"""Sync managers of process data."""
_MAILBOX_MIN = HEADER.size + 16
"""Minimum size of a mailbox for the supported services [bytes]."""
_TICK = 40e-9
"""Unit of the watchdog's divider [s]."""
_OP, _SAFEOP = AlState.OP, AlState.SAFEOP
"""Local names, since all slaves use them in every cycle."""
_ROUNDING = 1e-9
"""Rounding error of sums of instants [s]."""


class EthercatSlave(Cia402Drive):
    """Drive of the plant on EtherCAT.

    Parameters
    ----------
    settings, axis, image, timers
        As in `Cia402Drive`.
    latch : callable
        Latches all axes at the present instant; returns the process image.

    Attributes
    ----------
    controller : Controller
    clock : Clock
    states : AlStates
    mailbox : Mailbox
    coe : CoeServer
    eeprom : Eeprom
    is_connected : bool
        False while the slave has no supply and no frames pass.
    """

    def __init__(
        self,
        settings: DriveSettings,
        axis: Axis,
        image: AxisImage,
        timers: Timers,
        latch: Callable[[], Sequence[int]],
    ) -> None:
        personality = strip_can(settings.personality)
        settings = replace(settings, personality=personality)
        dictionary = ObjectDictionary(settings.node_id, personality, coe_entries)
        objects = drive_objects(personality)
        identity = settings.vendor_id, settings.product_code, settings.revision, settings.serial
        self.is_connected = True
        self.controller = Controller()
        self.clock = Clock(self.controller)
        self.eeprom = eeprom.Eeprom(eeprom.sii(objects, identity, settings.name))
        self.mailbox = Mailbox(self.controller, self._serve_mailbox)
        self.coe = CoeServer(
            dictionary, objects, self.mailbox, states_size=personality.sdo_states_size
        )
        emergencies = Emergencies(dictionary, lambda _identifier, data: self.coe.emergency(data))
        self.states = AlStates(
            self.controller,
            {
                AlState.PREOP: self._check_mailboxes,
                AlState.SAFEOP: self._check_process_data,
                AlState.OP: self._check_clock,
            },
            self._change_state,
        )
        dictionary.limit(SYNC_OUT, 2, 0, CYCLE_MAX)
        for index in (SYNC_OUT, SYNC_IN):
            dictionary.limit(index, 1, 0, BY_SYNC0)
        self.process_data = ProcessData(
            dictionary, emergencies, lambda: self.states.state is not AlState.PREOP
        )
        self._latch_axes = latch
        self._known: list[SyncManager] | None = None
        self._watchdog_timer = settings.node_id, "watchdog"
        self._fed = 0.0
        self._new_outputs = False
        super().__init__(settings, axis, image, timers, dictionary, emergencies, lambda: True)

    # Power

    def boot(self) -> None:
        """Start as after power-on."""
        self._timers.stop(self._watchdog_timer)
        self._timers.stop((self.node_id, "SYNC0"))
        self.controller.reset()
        self.eeprom.load(self.controller)
        self.clock.reset(self._timers.now)
        self.mailbox.reset()
        self.states.reset()

    def restart(self) -> None:
        """Restart slave, drive and objects as after power-on."""
        self.emergencies.reset()
        self.dictionary.reset(0x1000, 0x9FFF)
        self.reset()
        self.boot()

    def connect(self, connected: bool) -> None:
        """Pass frames, or block them (no supply)."""
        self.is_connected = connected
        self.controller.set_up = None  # earlier `CyclicFrame`s no longer fit

    # Frames

    def serve(self, datagram: Datagram, *, reads: bool, writes: bool, delay: int) -> None:
        """Process a datagram for this slave, passing `delay` [ns] after now."""
        low, high = datagram.offset, datagram.offset + datagram.size
        times = low < reg.TIME_OFFSET and high > reg.RECEIVE_TIMES
        if times and reads:
            self.clock.show(self._timers.now, delay)
        if times and writes and low <= reg.SYSTEM_TIME and high >= reg.SYSTEM_TIME + 4:
            self.take_time(datagram.data[reg.SYSTEM_TIME - low :][:8], delay)
        self.controller.serve(datagram, reads=reads, writes=writes)

    def time(self, delay: int) -> bytes:
        """Return the system time of a frame passing `delay` [ns] after now."""
        return self.clock.passing(self._timers.now, delay).to_bytes(8, "little")

    def take_time(self, received: bytes, delay: int) -> None:
        """Compare the time of the reference clock with the time of the passing frame."""
        self.clock.compare(int.from_bytes(received, "little"), self._timers.now, delay)

    def is_addressed(self, datagram: Datagram) -> bool:
        """Return True if a datagram has the address of this slave, or its alias."""
        position, by_alias = datagram.position, self.controller.memory[reg.DL_CONTROL + 3] & 1
        return position == self.controller.word(reg.STATION) or bool(
            by_alias and position == self.controller.word(reg.ALIAS)
        )

    def take_outputs(self) -> None:
        """Note the arrival of outputs, without other events."""
        self._new_outputs = True
        if self._known is not self.controller.set_up:
            self._look_up()
        if self._is_feeding:
            self._feed()
        if self.controller.is_full(OUT):
            self.process_data.is_taken = False
            self.mailbox.work()

    def _look_up(self) -> None:
        """Read the configuration of the sync managers of process data."""
        self._known = self.controller.managers
        outputs, inputs = self._known[OUTPUTS], self._known[INPUTS]
        self._is_feeding, self._outputs = outputs.feeds_watchdog, outputs[:2]
        self._inputs = inputs.start, inputs.start + inputs.size * inputs.is_active

    def work(self, forward: int, back: int | None) -> bool:
        """Execute the consequences of a frame; return True if its outputs have come.

        Parameters
        ----------
        forward, back : int
            Delays at which the frame arrived, and came back from the next slave if any [ns].
        """
        events = self.controller.take_events()
        if not events:
            self.mailbox.work()
            return False
        if reg.RECEIVE_TIMES in events:
            self.clock.latch(self._timers.now, forward, back)
        if reg.EEPROM_CONTROL + 1 in events:
            self.eeprom.execute(self.controller)
        if reg.ACTIVATION in events:
            self._start_sync0()
        if not events.isdisjoint((reg.WATCHDOG_DIVIDER, reg.WATCHDOG_TIME)):
            self._restart_watchdog()
        if reg.AL_CONTROL in events:
            self.states.request(self.controller.word(reg.AL_CONTROL))
        self.mailbox.work()
        return self._take_outputs(events)

    def _serve_mailbox(self, service: bytes) -> None:
        self.coe.receive(service)

    @property
    def exchanges(self) -> bool:
        """True if the slave exchanges process data."""
        state = self.states.state
        return state is _OP or state is _SAFEOP

    def _take_outputs(self, events: set[int]) -> bool:
        """Return True if outputs were exchanged, or inputs of a slave without outputs."""
        managers = self.controller.managers
        outputs, inputs = managers[OUTPUTS], managers[INPUTS]
        written = outputs.is_active and outputs.start in events
        if written:
            self._new_outputs = True
            if outputs.feeds_watchdog:
                self._feed()
        return written or (not outputs.is_active and inputs.is_active and inputs.start in events)

    def exchange(self, image: Sequence[int], *, repeated: bool = False) -> None:
        """Latch inputs and apply outputs.

        Parameters
        ----------
        image : sequence of int
            Process image of all axes, as latched.
        repeated : bool
            True if the outputs equal those of the previous frame.
        """
        controller = self.controller
        data, memory = self.process_data.latch(image), controller.memory
        if self._known is not controller.set_up:
            self._look_up()
        start, end = self._inputs
        if end - start == len(data):
            memory[start:end] = data
        if self._new_outputs and self.states.state is _OP:
            self._new_outputs = False
            if not (repeated and self.process_data.is_taken and self.waits_for_news()):
                self.process_data.act(memory, *self._outputs)

    # Watchdog and SYNC0

    @property
    def _watchdog(self) -> float:
        """Time-out of the watchdog of process data [s], 0 if it is off."""
        if not self.controller.managers[OUTPUTS].feeds_watchdog:
            return 0.0
        unit = (self.controller.word(reg.WATCHDOG_DIVIDER) + 2) * _TICK
        return unit * self.controller.word(reg.WATCHDOG_TIME)

    def _feed(self) -> None:
        self._fed = self._timers.now
        self.controller.memory[reg.WATCHDOG_STATUS] = 1
        if not self._timers.runs(self._watchdog_timer) and self._watchdog:
            self._timers.start(self._watchdog_timer, self._watchdog, self._look_at_watchdog)

    def _restart_watchdog(self) -> None:
        if self._timers.runs(self._watchdog_timer):
            self._timers.stop(self._watchdog_timer)
            self._feed()

    def _look_at_watchdog(self) -> None:
        left = self._fed + self._watchdog - self._timers.now
        if left > _ROUNDING:
            self._timers.start(self._watchdog_timer, left, self._look_at_watchdog)
        elif self._watchdog:
            memory = self.controller.memory
            memory[reg.WATCHDOG_STATUS] = 0
            memory[reg.WATCHDOG_COUNTER] = min(memory[reg.WATCHDOG_COUNTER] + 1, 0xFF)
            if self.states.state is AlState.OP:
                self.states.fall(AlState.SAFEOP, AlCode.WATCHDOG)

    def _start_sync0(self, least: int = 0) -> None:
        """Wait for the first SYNC0 further ahead than `least` [ns]."""
        name = self.node_id, "SYNC0"
        self._timers.stop(name)
        if MIN_CYCLE <= self.clock.cycle <= CYCLE_MAX:
            ahead = self.clock.until_sync0(self._timers.now, least)
            self._timers.start(name, ahead, self._sync0)

    def _sync0(self) -> None:
        self._start_sync0(self.clock.cycle // 2)
        if self.exchanges:
            self.exchange(self._latch_axes())

    # States

    def _check_mailboxes(self) -> AlCode:
        managers = self.controller.managers
        fits = all(
            managers[number].is_active
            and managers[number].is_mailbox
            and managers[number].is_written == written
            and managers[number].start >= reg.PROCESS_MEMORY
            and managers[number].start + managers[number].size <= reg.MEMORY_SIZE
            and managers[number].size >= _MAILBOX_MIN
            for number, written in ((OUT, True), (IN, False))
        )
        return AlCode.NONE if fits else AlCode.MAILBOX

    def _check_process_data(self) -> AlCode:
        managers = self.controller.managers
        for number, size, code in zip(
            (OUTPUTS, INPUTS), self.process_data.sizes, (AlCode.OUTPUTS, AlCode.INPUTS), strict=True
        ):
            manager = managers[number]
            active, wanted = manager.size if manager.is_active else 0, number == OUTPUTS
            if active != size or size > SIZE_MAX:
                return code
            if size and (manager.is_mailbox or manager.is_written != wanted):
                return code
            if size and not reg.PROCESS_MEMORY <= manager.start <= reg.MEMORY_SIZE - size:
                return code
        self.process_data.compile()
        return AlCode.NONE

    def _check_clock(self) -> AlCode:
        fits = not self.clock.is_cyclic or MIN_CYCLE <= self.clock.cycle <= CYCLE_MAX
        return AlCode.NONE if fits else AlCode.SYNC0_CYCLE

    def _change_state(self, state: AlState, before: AlState) -> None:
        self.emergencies.enabled = state is not AlState.INIT
        if state is AlState.INIT:
            self.mailbox.reset()
            self.coe.reset()
        if state is AlState.OP:
            self.process_data.forget()
            self._new_outputs = False
            self._feed()
        elif before is AlState.OP:
            self.lose_connection(ErrorCode.COMMUNICATION)
