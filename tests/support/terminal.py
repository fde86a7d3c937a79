"""A terminal of its own for a program under test."""

import os
import pty
import threading


class Terminal:
    """What a program shows on a terminal of its own."""

    def __init__(self) -> None:
        self._ours, self.theirs = pty.openpty()
        self.shown = ""
        self._reader = threading.Thread(target=self._read, daemon=True)

    def _read(self) -> None:
        while True:
            try:
                text = os.read(self._ours, 65536)
            except OSError:  # Linux says so at the end
                return
            if not text:
                return
            self.shown += text.decode(errors="replace")

    def begin(self) -> None:
        """Read from now on; the program holds the other end."""
        os.close(self.theirs)
        self._reader.start()

    def close(self) -> None:
        """Read what is left."""
        self._reader.join(timeout=10)
        os.close(self._ours)
