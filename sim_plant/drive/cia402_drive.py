"""Servo drive on any bus: the power state machine of CiA 402 and one axis.

Commands come in through the controlword, by SDO or PDO. A command that ends OPERATION ENABLED stops
the axis as its option code states; the state ends at standstill, or at once with option 0. A fault
leads through FAULT REACTION ACTIVE (605Eh) to FAULT, which a rising edge of bit 7 ends once the
cause is gone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim_plant.canopen.abort_codes import AbortCode, SdoAbort
from sim_plant.canopen.emcy import ErrorCode
from sim_plant.drive.cia402_states import (
    POWERED,
    TRANSITIONS,
    Command,
    Control,
    Input,
    State,
    Status,
    decode_command,
)
from sim_plant.drive.cyclic_position import CyclicPosition
from sim_plant.drive.disobedience import OBEDIENT
from sim_plant.drive.drive_objects import declare, present
from sim_plant.drive.homing import Homing
from sim_plant.drive.lagging_bit import LaggingBit
from sim_plant.drive.mode import CYCLIC_POSITION, HOMING, ModeOfOperation
from sim_plant.drive.motion import Motion, Ramp
from sim_plant.drive.profile_position import ProfilePosition, StatusLags
from sim_plant.drive.target_window import TargetWindow
from sim_plant.machine_protocol import AxisEvent

if TYPE_CHECKING:
    from collections.abc import Callable

    from sim_plant.canopen.emcy import Emergencies
    from sim_plant.canopen.object_dictionary import ObjectDictionary
    from sim_plant.canopen.timers import Timers
    from sim_plant.drive.process_image import AxisImage
    from sim_plant.drive_settings import DriveSettings
    from sim_plant.machine_protocol import Axis
    from sim_plant.personality import Personality

_SATURATED, _FOLLOWING = int(AxisEvent.SATURATED), int(AxisEvent.FOLLOWING_ERROR)
_OPTION_OF_EXIT = {State.READY: 0x605B, State.SWITCHED_ON: 0x605C}
_STAYS_STOPPED = 4
"""Highest quick stop option without QUICK STOP ACTIVE; higher options, less 4, give the ramp."""


class Cia402Drive:
    """Drive of the plant, without its bus.

    Parameters
    ----------
    settings : DriveSettings
    axis : Axis
    image : AxisImage
        Process image of the axis.
    timers : Timers
    dictionary : ObjectDictionary
    emergencies : Emergencies
    is_supervised : callable
        Returns True if the bus supervises a present master; required for resetting a fault.

    Attributes
    ----------
    node_id : int
    state : State
    disobedience : Disobedience
        Ignored commands.
    """

    def __init__(
        self,
        settings: DriveSettings,
        axis: Axis,
        image: AxisImage,
        timers: Timers,
        dictionary: ObjectDictionary,
        emergencies: Emergencies,
        is_supervised: Callable[[], bool],
    ) -> None:
        personality = settings.personality
        self.node_id = settings.node_id
        self.dictionary = dictionary
        self.emergencies = emergencies
        self._is_supervised = is_supervised
        self.state = State.NOT_READY
        self.disobedience = OBEDIENT
        self._image = image
        self._timers = timers
        self._controlword = 0
        self._next_state: State | None = None
        self._voltage: int = Status.VOLTAGE_ENABLED
        self._locked = False
        self._motion = Motion(self.dictionary, axis, settings, image)
        self._window = TargetWindow(self.dictionary, timers, image, self._refresh)
        self._position = ProfilePosition(
            self.dictionary,
            self._motion,
            self._window,
            self.emergencies,
            self._lags(personality),
            until_reached=personality.acknowledge_until_reached,
        )
        self._homing = Homing(self.dictionary, self._motion, settings, image)
        self._cyclic = CyclicPosition(self.dictionary, self._motion)
        self._follower: ProfilePosition | Homing | CyclicPosition = self._position
        self._mode = ModeOfOperation(self.dictionary, timers, personality, self._change_mode)
        declare(self.dictionary, settings)
        present(self.dictionary, image, settings)
        self._connect_objects()
        self.reset()

    # Reports of the axis

    def attend(self) -> None:
        """Process the readings latched at a SYNC after a change."""
        reading = self._image.reading
        self._take_events(reading.events)
        if self._follows_set_points:
            self._follower.observe(reading)
        self._refresh()

    def handle_events(self, events: int) -> None:
        """Process axis events at the instant of their change."""
        self._take_events(events)
        self._refresh()

    def _take_events(self, events: int) -> None:
        self._motion.events = events
        if events & _FOLLOWING and self.state in POWERED:
            self.fail(ErrorCode.FOLLOWING_ERROR)
        self._leave_at_rest()
        if self._follows_set_points:
            self._follower.progress()

    # External events

    def fail(self, code: int) -> None:
        """Enter FAULT with error `code`, after the fault reaction (605Eh)."""
        self.emergencies.raise_error(code)
        if self.state in (State.FAULT, State.FAULT_REACTION_ACTIVE):
            return
        self.state = State.FAULT_REACTION_ACTIVE
        self._slow_down(Ramp(self.dictionary.get(0x605E)), State.FAULT)
        self._refresh()

    def lose_voltage(self) -> None:
        """Enter FAULT at once: without a DC link there is no power to slow down."""
        self._voltage = 0
        self.emergencies.raise_error(ErrorCode.UNDER_VOLTAGE)
        self._enter(State.FAULT)
        self._refresh()

    def regain_voltage(self) -> None:
        """Restore the DC link; the fault remains until its reset."""
        self._voltage = Status.VOLTAGE_ENABLED
        self._refresh()

    def lock(self) -> None:
        """Activate safe torque off: no torque, no voltage, switching on refused."""
        self._locked, self._voltage = True, 0
        if self.state not in (State.FAULT, State.NOT_READY):
            self._enter(State.SWITCH_ON_DISABLED)
        self._refresh()

    def unlock(self) -> None:
        """Release safe torque off; the drive stays switched off."""
        self._locked, self._voltage = False, Status.VOLTAGE_ENABLED
        self._refresh()

    def connect(self, connected: bool) -> None:
        """Connect the drive to the bus, or disconnect it; the firmware keeps running."""
        raise NotImplementedError

    def restart(self) -> None:
        """Restart as after power-on, like a drive reset by its own watchdog."""
        raise NotImplementedError

    # Commands

    def _control(self, _subindex: int, controlword: int) -> None:
        if controlword == self._controlword and self._follows_set_points:
            return  # no effect, as with every further set-point of a stream
        risen = controlword & ~self._controlword
        self._controlword = controlword
        if self.state is State.FAULT:
            healthy = self._is_supervised() and self._voltage
            if risen & Control.FAULT_RESET and healthy:
                self.emergencies.clear_all()
                self._enter(State.SWITCH_ON_DISABLED)
        elif self.state is not State.FAULT_REACTION_ACTIVE:
            command = decode_command(controlword)
            if not (command in self.disobedience.ignored and self.state in POWERED):
                self._command(command)
            if self._follows_set_points:
                self._follower.control(controlword)
        self._refresh()

    def _command(self, command: Command) -> None:
        target = None if self._locked else TRANSITIONS.get((self.state, command))
        if self._next_state is not None and command is Command.ENABLE_OPERATION:
            self._resume()
        elif target is State.QUICK_STOP_ACTIVE:
            self._quick_stop()
        elif target in _OPTION_OF_EXIT and self.state is State.OPERATION_ENABLED:
            self._slow_down(Ramp(self.dictionary.get(_OPTION_OF_EXIT[target])), target)
        elif self.state is State.QUICK_STOP_ACTIVE and target is State.OPERATION_ENABLED:
            self._resume()
        elif target is not None:
            self._enter(target)

    def _take_target(self, _subindex: int, target: int) -> None:
        if self._follower is self._cyclic and self._follows_set_points:
            shown = self._cyclic.show()
            self._cyclic.follow(target)
            if self._cyclic.show() != shown:
                self._refresh()

    def _change_mode(self) -> None:
        """Abandon the command of the old mode; a moving axis comes to rest."""
        others: dict[int, Homing | CyclicPosition] = {
            HOMING: self._homing,
            CYCLIC_POSITION: self._cyclic,
        }
        following = others.get(self.dictionary.get(0x6060), self._position)
        if following is self._follower:
            return
        self._follower.abandon()
        self._follower = following
        if self._follows_set_points:
            self._motion.stop(Ramp.PROFILE)
            self._follower.start(self._image.reading.demand, self._controlword)
            self._refresh()

    def _quick_stop(self) -> None:
        option, defect = self.dictionary.get(0x605A), self.disobedience
        stays = option > _STAYS_STOPPED
        then = None if stays or defect.keeps_voltage else State.SWITCH_ON_DISABLED
        self.state = State.QUICK_STOP_ACTIVE
        if defect.runs_on:
            self._next_state = then
            self._leave_at_rest()
        else:
            self._slow_down(Ramp(option - _STAYS_STOPPED if stays else option), then)

    def _resume(self) -> None:
        """Cancel a stop: hold the axis where it is or comes to rest."""
        quick = self.state is State.QUICK_STOP_ACTIVE
        if quick and self.dictionary.get(0x605A) <= _STAYS_STOPPED:
            return
        self._next_state = None
        self.state = State.OPERATION_ENABLED
        self._follower.start(self._image.reading.demand, self._controlword)

    # States

    def waits_for_news(self) -> bool:
        """Return True if rewriting the present controlword and target changes nothing."""
        # same condition as `_follows_set_points`, repeated here to save a call per slave and cycle
        return (
            self.state is State.OPERATION_ENABLED
            and self._next_state is None
            and self._follower is not self._cyclic
        )

    @property
    def _follows_set_points(self) -> bool:
        return self.state is State.OPERATION_ENABLED and self._next_state is None

    def _enter(self, state: State) -> None:
        was_powered = self.state in POWERED
        self.state, self._next_state = state, None
        if was_powered and state not in POWERED:
            self._follower.abandon()
            self._motion.disable()
        elif not was_powered and state in POWERED:
            self._motion.apply_torque_limit()
            self._motion.apply_following_window()
            self._motion.enable()
            position = self._image.reading.position
            self._follower.start(position, self._controlword)

    def _slow_down(self, ramp: Ramp, then: State | None) -> None:
        """Stop, and enter state `then` at rest."""
        self._follower.abandon()
        if ramp is Ramp.NONE and then is not None:
            self._enter(then)
        else:
            self._next_state = then
            self._motion.stop(ramp)
            self._leave_at_rest()

    def _leave_at_rest(self) -> None:
        if self._next_state is not None and self._motion.is_at_rest:
            self._enter(self._next_state)

    def _refresh(self) -> None:
        status = self.state | self._voltage | Status.REMOTE
        events = self._motion.events
        if self.state in POWERED:
            if self._follows_set_points:
                status |= self._follower.show()
            elif self._motion.is_at_rest:
                status |= Status.TARGET_REACHED
            if events & _SATURATED:
                status |= Status.INTERNAL_LIMIT
        if events & _FOLLOWING:
            status |= Status.FOLLOWING_ERROR
        self._image.statusword = status

    # Communication

    def lose_connection(self, code: ErrorCode) -> None:
        """React to a loss of communication with cause `code`, as configured in 6007h."""
        if self.state not in POWERED:
            return
        option = self.dictionary.get(0x6007)
        if option == 1 or (option in (2, 3) and self.disobedience is not OBEDIENT):
            self.fail(code)
        elif option in (2, 3) and self.state is not State.FAULT_REACTION_ACTIVE:
            self._command(Command.DISABLE_VOLTAGE if option == 2 else Command.QUICK_STOP)
        self._refresh()

    def reset(self) -> None:
        """Reset to the state after power-on."""
        self._enter(State.SWITCH_ON_DISABLED)
        self._change_mode()
        self._controlword = 0
        self._motion.apply_torque_limit()
        self._motion.apply_following_window()
        self._motion.apply_own_feed_forward()
        self._refresh()

    def _lags(self, personality: Personality) -> StatusLags:
        timers, late = self._timers, personality.acknowledge_lag
        owner = self.dictionary.owner
        return StatusLags(
            LaggingBit(
                timers, (owner, "reached"), 0.0, personality.target_reached_lag, self._refresh
            ),
            LaggingBit(timers, (owner, "acknowledge"), late, late, self._refresh),
        )

    def _connect_objects(self) -> None:
        dictionary, motion = self.dictionary, self._motion
        dictionary.react(0x6040, self._control)
        dictionary.react(0x607A, self._take_target)
        dictionary.source(0x60FD, 0, lambda: Input.INTERLOCK if self._locked else 0)
        for index in (0x6065, 0x6066):
            dictionary.react(index, lambda _subindex, _value: motion.apply_following_window())
        for index in (0x6072, 0x6073):
            dictionary.react(index, lambda _subindex, _value: motion.apply_torque_limit())
        dictionary.react(0x2010, lambda _subindex, _value: motion.apply_own_feed_forward())
        for index in (0x6073, 0x6080):
            dictionary.guard(index, self._only_without_power)

    def _only_without_power(self, _subindex: int, _value: int) -> None:
        if self.state in POWERED:
            raise SdoAbort(AbortCode.DEVICE_STATE)
