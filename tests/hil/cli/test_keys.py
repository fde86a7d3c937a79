"""Single keys from a terminal, and none without a terminal."""

import io
import os
import termios
from collections.abc import Iterator

import pytest

from hil.terminal.keys import Keys


@pytest.fixture
def terminal() -> Iterator[tuple[io.FileIO, io.TextIOWrapper]]:
    """Pseudo terminal: its writing end, and the reader under test."""
    keyboard, screen = os.openpty()
    with io.FileIO(keyboard, "r+") as typing, io.TextIOWrapper(io.FileIO(screen)) as stream:
        yield typing, stream


def mode(stream: io.TextIOWrapper) -> int:
    return int(termios.tcgetattr(stream.fileno())[3])


def test_a_key_counts_at_once_and_without_enter(terminal) -> None:
    keyboard, stream = terminal
    with Keys(stream) as keys:
        assert keys.listening
        assert keys.pressed() == ""
        keyboard.write(b"p")
        assert keys.pressed() == "p"
        assert keys.pressed() == ""


def test_keys_come_in_the_order_in_which_they_were_typed(terminal) -> None:
    keyboard, stream = terminal
    with Keys(stream) as keys:
        keyboard.write(b"p q" * 30)
        assert keys.pressed() == "p q" * 30


def test_keys_are_not_echoed_while_ctrl_c_stays_an_interrupt(terminal) -> None:
    _, stream = terminal
    with Keys(stream):
        assert not mode(stream) & (termios.ECHO | termios.ICANON)
        assert mode(stream) & termios.ISIG


def test_the_terminal_is_left_as_it_was_found_also_after_an_error(terminal) -> None:
    _, stream = terminal
    before = mode(stream)
    with pytest.raises(RuntimeError), Keys(stream):
        raise RuntimeError
    assert mode(stream) == before


def test_a_terminal_that_goes_away_is_no_more_than_silence(terminal) -> None:
    keyboard, stream = terminal
    with Keys(stream) as keys:
        keyboard.close()
        assert keys.pressed() == ""


@pytest.mark.parametrize("stream", [io.StringIO("q"), open(os.devnull)])  # noqa: PTH123, SIM115
def test_where_there_is_no_terminal_nothing_is_pressed(stream) -> None:
    with stream, Keys(stream) as keys:
        assert not keys.listening
        assert keys.pressed() == ""
