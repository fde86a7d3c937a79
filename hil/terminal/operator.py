"""The operator in front of the robot, by terminal: agrees to motion, stops it, answers.

Keys are read singly while axes are powered (`hil.terminal.keys`). Where there is no terminal, an
answer may come down a pipe; where none comes, nothing is powered on.
"""

from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

    from hil.terminal.keys import Keys

LOOK = 0.05
"""How often the keyboard is looked at while nothing is powered [s]."""
HINT = "space, q or Esc stops all axes"


class TerminalOperator:
    """Whoever sits at the terminal.

    Parameters
    ----------
    console : Console
        Where questions are shown.
    keys : Keys
        Entered; where answers come from.
    agreed : bool
        Nobody is to be asked anything: all is agreed to beforehand.
    """

    def __init__(self, console: Console, keys: Keys, *, agreed: bool) -> None:
        self._console = console
        self._keys = keys
        self._agreed = agreed

    @property
    def present(self) -> bool:
        """Whether somebody can be asked."""
        return self._keys.listening and not self._agreed

    def agrees(self, intent: str) -> bool:
        """Ask before anything is powered; without a terminal a line of standard input counts."""
        if self._agreed:
            return True
        self.show(f"{intent} [y/N]")
        key = self._wait() if self._keys.listening else sys.stdin.readline()[:1]
        if key.lower() == "y" and self._keys.listening:
            self.show(HINT)
        return key.lower() == "y"

    def show(self, text: str) -> None:
        """Show a line."""
        self._console.print(text, highlight=False, markup=False, soft_wrap=True)

    def pressed(self) -> str:
        """Return the keys pressed since the last call, without waiting."""
        return self._keys.pressed()

    def _wait(self) -> str:
        while not (typed := self._keys.pressed()) and self._keys.listening:
            time.sleep(LOOK)
        return typed[:1]
