"""Signal handling in tests equals that in a terminal, independent of the caller."""

from __future__ import annotations

import signal
import subprocess
import sys

WITH_SIGNALS_IGNORED = "trap '' INT HUP TERM; exec \"$@\""
OF_A_STARTED_PROGRAM = """
import signal
numbers = signal.SIGINT, signal.SIGHUP, signal.SIGTERM
raise SystemExit(any(signal.getsignal(number) is signal.SIG_IGN for number in numbers))
"""


def test_signals_are_as_by_default_here_and_in_programs_that_a_test_starts() -> None:
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert signal.getsignal(signal.SIGHUP) is signal.SIG_DFL
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    subprocess.run((sys.executable, "-c", OF_A_STARTED_PROGRAM), check=True)  # noqa: S603 - our own


def test_so_they_are_where_a_script_or_nohup_started_the_tests_with_signals_ignored() -> None:
    this = test_signals_are_as_by_default_here_and_in_programs_that_a_test_starts.__name__
    pytest = (sys.executable, "-m", "pytest", "-n", "1", "-p", "no:cacheprovider")
    subprocess.run(  # noqa: S603 - our own tests
        ("/bin/sh", "-c", WITH_SIGNALS_IGNORED, "sh", *pytest, f"{__file__}::{this}"),
        check=True,
        stdin=subprocess.DEVNULL,
        start_new_session=True,
    )
