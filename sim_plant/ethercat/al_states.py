"""Application layer state machine of a slave (ETG.1000.6 clause 6) and its status codes.

States go up one by one and down in one step. A refused request leaves the state unchanged and sets
error flag and code; until the master acknowledges the error, only lower states are accepted.
"""

from __future__ import annotations

import enum
from typing import TYPE_CHECKING

from sim_plant.ethercat import registers as reg

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from sim_plant.ethercat.controller import Controller


class AlState(enum.IntEnum):
    """States as coded in AL control and AL status."""

    INIT = 1
    PREOP = 2
    BOOT = 3
    SAFEOP = 4
    OP = 8


class AlCode(enum.IntEnum):
    """Reason for refusing or leaving a state (ETG.1020)."""

    NONE = 0x0000
    INVALID_CHANGE = 0x0011
    UNKNOWN_STATE = 0x0012
    NO_BOOTSTRAP = 0x0013
    MAILBOX = 0x0016
    WATCHDOG = 0x001B
    OUTPUTS = 0x001D
    INPUTS = 0x001E
    SYNC0_CYCLE = 0x0036


_ACKNOWLEDGE = _ERROR = 0x10
_LADDER = (AlState.INIT, AlState.PREOP, AlState.SAFEOP, AlState.OP)
_KNOWN = {int(state) for state in AlState}


class AlStates:
    """State of a slave.

    Parameters
    ----------
    controller : Controller
        Controller with the registers of the state.
    checks : mapping of AlState to callable
        Conditions for entering a state: return the code of a refusal, or NONE.
    changed : callable
        Called with every new state, and the one before.

    Attributes
    ----------
    state : AlState
    code : int
        Reason for a refused state, NONE without error.
    """

    def __init__(
        self,
        controller: Controller,
        checks: Mapping[AlState, Callable[[], AlCode]],
        changed: Callable[[AlState, AlState], None],
    ) -> None:
        self._controller = controller
        self._checks = checks
        self._changed = changed
        self.state = AlState.INIT
        self.code: int = AlCode.NONE

    def reset(self) -> None:
        """Reset to the state after power-on."""
        self._enter(AlState.INIT, AlCode.NONE)

    def request(self, control: int) -> None:
        """Process a write to AL control."""
        asked = control & 0x0F
        if control & _ACKNOWLEDGE:
            self.code = AlCode.NONE
        if asked not in _KNOWN:
            self._enter(self.state, self.code or AlCode.UNKNOWN_STATE)
        elif asked == AlState.BOOT:
            self._enter(self.state, self.code or AlCode.NO_BOOTSTRAP)
        else:
            self._go(AlState(asked))

    def fall(self, state: AlState, code: int) -> None:
        """Enter a lower state because of an error."""
        self._enter(min(state, self.state), code)

    def _go(self, asked: AlState) -> None:
        step = _LADDER.index(asked) - _LADDER.index(self.state)
        if step < 0:
            self._enter(asked, AlCode.NONE)
        elif self.code or step == 0:
            self._show()
        elif step > 1:
            self._enter(self.state, AlCode.INVALID_CHANGE)
        else:
            check = self._checks.get(asked)
            refusal = check() if check else AlCode.NONE
            self._enter(self.state if refusal else asked, refusal)

    def _enter(self, state: AlState, code: int) -> None:
        before, self.state, self.code = self.state, state, code
        self._show()
        if state is not before:
            self._changed(state, before)

    def _show(self) -> None:
        flag = _ERROR if self.code else 0
        self._controller.put(reg.AL_STATUS, 2, self.state | flag)
        self._controller.put(reg.AL_CODE, 2, self.code)
