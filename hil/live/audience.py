"""Processes informed of one or several runs: started, written to, and ended together.

The module imports neither numerics nor the bus, so that a page is there before these are loaded.
"""

from __future__ import annotations

from contextlib import contextmanager
from functools import partial
from queue import Empty
from typing import TYPE_CHECKING

import typer

from hil.live.listener import ANSWERS, encode
from hil.terminal.console import say
from hil.terminal.keys import STATUS, interrupt_main

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from rich.console import Console

    from hil.live.listener import Listener


class Audience:
    """Listening processes of a command.

    Parameters
    ----------
    listeners : sequence of Listener
        Listeners, to be started.

    Attributes
    ----------
    is_open : bool
        True between start and end of the listeners.
    answered : bool
        True while lines from listeners are forwarded to the others.
    """

    def __init__(self, listeners: Sequence[Listener]) -> None:
        self.listeners = listeners
        self.is_open = False
        self.answered = True
        self._missed: set[str] = set()
        self._say: Callable[[str], None] = lambda _: None

    @contextmanager
    def open(self, console: Console) -> Iterator[Sequence[str]]:
        """Start the listeners; yield the start messages; end the listeners afterwards.

        Raises
        ------
        ListenerFailed
            A listener cannot serve.
        """
        self._say = partial(say, console=console)
        stated = []
        try:
            for listener in self.listeners:
                listener.launch(interrupt_main)
            for listener in self.listeners:
                stated.append(listener.start(interrupt_main))
                if stated[-1]:
                    self._say(stated[-1])
            self.is_open = True
            with self._publish_end():
                yield stated
        finally:
            self.is_open = False
            for listener in self.listeners:
                listener.close()

    @contextmanager
    def _publish_end(self) -> Iterator[None]:
        try:
            yield
        except BaseException as error:
            self.pass_on()  # the last line ends the output
            by_operator = isinstance(error, typer.Exit) and error.exit_code == STATUS
            how, text = "failed", str(error) or type(error).__name__
            if isinstance(error, KeyboardInterrupt) or by_operator:
                how, text = "stopped", "stopped by the operator"
            # rich raises SystemExit for a broken pipe
            elif isinstance(error, (BrokenPipeError, SystemExit)):
                how, text = "stopped", "the output of the terminal was closed"
            self.publish("end", {"how": how, "text": text})
            raise
        else:
            # end listeners with pending answers, and forward the answers
            self._name_missed()
            for listener in self.listeners:
                if listener.answers and not listener.gone:
                    self._missed.add(listener.what)
                    listener.close(ANSWERS)
            self.pass_on()
            self.publish("end", {"how": "finished", "text": ""})
        finally:
            self._name_missed()

    def publish(self, kind: str, values: Mapping[str, object], *, droppable: bool = False) -> None:
        """Publish a line of `hil.live.lines`, or skip a `droppable` one for slow readers."""
        line = encode(kind, **values)
        for listener in self.listeners:
            listener.write(line, droppable=droppable)

    def pass_on(self) -> None:
        """Forward lines between listeners, and report ended ones."""
        for listener in self.listeners:
            try:
                while True:
                    said = listener.said.get_nowait()
                    if self.answered:
                        self.publish(said.pop("kind"), said)
            except Empty:
                continue
        self._name_missed()

    def _name_missed(self) -> None:
        """Report every ended process once."""
        for listener in self.listeners:
            if listener.gone and listener.what not in self._missed:
                self._missed.add(listener.what)
                self._say(f"{listener.what} has ended; the run continues without it")
