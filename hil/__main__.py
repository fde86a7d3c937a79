"""The program `hil`, which also leaves quietly on a Ctrl-C while it is still loading."""

from __future__ import annotations

import sys


def main() -> None:
    """Entry point of ``hil`` and ``python -m hil``."""
    try:
        from hil.cli import main as command_line  # noqa: PLC0415 - takes a while, see above

        command_line()
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()
