"""Files written during motion: an interrupt at any instruction leaves no lock."""

from __future__ import annotations

import sys
import threading
from typing import TYPE_CHECKING

import pytest

from checked_files.yaml_file import FileError
from hil.measuring.campaign import Background

if TYPE_CHECKING:
    from types import FrameType


class Interrupting:
    """Trace that raises an interrupt at the n-th instruction of a call."""

    def __init__(self, number: int) -> None:
        self.left = number

    def __call__(self, frame: FrameType, event: str, arg: object) -> Interrupting:
        frame.f_trace_opcodes = True
        if event in {"opcode", "return"}:
            self.left -= 1
            if self.left == 0:
                raise KeyboardInterrupt
        return self


def interrupted_at(number: int) -> bool:
    """Interrupt the queueing of a task; return True if the interrupt occurred."""
    done = threading.Event()
    with Background() as background:
        before = sys.gettrace()
        sys.settrace(Interrupting(number))
        try:
            background.do(done.set)
        except KeyboardInterrupt:
            return True
        finally:
            sys.settrace(before)
    assert done.is_set()
    return False


def test_an_interrupt_while_a_task_is_handed_over_blocks_nothing() -> None:
    reached: list[int] = []

    def sweep() -> None:
        number = 1
        while interrupted_at(number):
            number += 1
        reached.append(number)

    thread = threading.Thread(target=sweep, daemon=True)
    thread.start()
    thread.join(30.0)
    assert reached, "an interrupt left the queue locked"
    assert reached[0] > 10


def test_what_is_handed_over_is_done_in_order_and_waited_for() -> None:
    written: list[int] = []
    with Background(waiting_max=2) as background:
        for number in range(20):
            background.do(lambda number=number: written.append(number))
    assert written == list(range(20))


@pytest.mark.parametrize("waiting", [1, 3])
def test_no_more_tasks_wait_than_may(waiting: int) -> None:
    hold, most = threading.Event(), []
    with Background(waiting_max=waiting, patience=0.05) as background:
        background.do(lambda: hold.wait(10.0))

        def fill() -> None:
            for number in range(10):
                background.do(lambda: None)
                most.append(number)

        try:
            with pytest.raises(FileError, match=f"with {waiting} waiting"):
                fill()
        finally:
            hold.set()
    assert waiting <= len(most) <= waiting + 1
