"""Separate terminal for a program under test."""

import os
import pty
import threading


class Terminal:
    """Output of a program on a separate terminal."""

    def __init__(self) -> None:
        self._ours, self.theirs = pty.openpty()
        self.shown = ""
        self._reader = threading.Thread(target=self._read, daemon=True)

    def _read(self) -> None:
        while True:
            try:
                text = os.read(self._ours, 65536)
            except OSError:  # Linux reports this error at the end
                return
            if not text:
                return
            self.shown += text.decode(errors="replace")

    def begin(self) -> None:
        """Start reading; the program has the other end."""
        os.close(self.theirs)
        self._reader.start()

    def close(self) -> None:
        """Read the remaining output."""
        self._reader.join(timeout=10)
        os.close(self._ours)
