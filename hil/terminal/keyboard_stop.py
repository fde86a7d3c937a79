"""The keyboard during a run: s or space stops all axes and ends it, p pauses.

A thread waits for keys and costs nothing while there are none. A stop is an interrupt like Ctrl-C,
sent to the main thread: it counts between two steps of the interpreter, wherever that is in the
sample loop, and its way through the drives' quick stop and off is the one that is tested most. A
pause lasts from the end of the present measurement until any key is pressed; the axes stay powered
and are sampled, since drives that hear nothing from us would switch off.
"""

from __future__ import annotations

import signal
import threading
import time
from typing import TYPE_CHECKING

from hil.terminal.keys import Keys

if TYPE_CHECKING:
    from types import TracebackType
    from typing import Self

STOPS = frozenset("sS ")
PAUSES = frozenset("pP")
HINT = "s or space: stop all axes and end; p: pause after the present measurement"

_PATIENCE = 0.1
"""How long the thread waits for a key before it looks whether it is still wanted [s]."""
_BREATH = 0.001
"""Between two samples of a pause, which in lock-step would take a processor otherwise [s]."""


class KeyboardStop:
    """Listens to the keyboard for as long as it is entered.

    Parameters
    ----------
    keys : Keys, optional
        Where keys come from; the terminal unless given.

    Attributes
    ----------
    listening : bool
        Whether there is a keyboard at all.
    """

    def __init__(self, keys: Keys | None = None) -> None:
        self._keys = Keys() if keys is None else keys
        self._paused = False
        self._wanted = self._started = False
        self._thread = threading.Thread(target=self._listen, name="keyboard", daemon=True)

    @property
    def listening(self) -> bool:
        """Whether there is a keyboard at all."""
        return self._keys.listening

    def __enter__(self) -> Self:
        """Begin to listen, where there is a terminal."""
        self._keys.__enter__()
        if self.listening:
            self._before = signal.getsignal(signal.SIGINT)
            if self._before is signal.SIG_IGN:
                # As a shell may start a job in the background; a stop must work all the same.
                signal.signal(signal.SIGINT, signal.default_int_handler)
            self._wanted = self._started = True
            self._thread.start()
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Stop listening and leave the terminal as it was found."""
        self._wanted = False
        if self._started:
            self._thread.join()
            signal.signal(signal.SIGINT, self._before)
        self._keys.__exit__(exc_type, exc, traceback)

    def pause(self) -> bool:
        """Whether the operator wants a pause; takes a breath while that is so."""
        if self._paused:
            time.sleep(_BREATH)
        return self._paused

    def take(self, key: str) -> None:
        """Do what a key says."""
        if key in STOPS:
            self._wanted = False
            main = threading.main_thread().ident
            assert main is not None  # noqa: S101 - it runs
            signal.pthread_kill(main, signal.SIGINT)
        else:
            self._paused = key in PAUSES and not self._paused

    def _listen(self) -> None:
        while self._wanted and self._keys.listening:
            for key in self._keys.awaited(_PATIENCE):
                self.take(key)
