"""Rows of numbers from joint states: at once where many have one layout, else one by one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from hil.imports.readers.joint_state_layout import PARTS, OtherLayout, layout_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from hil.arrays import Array, Integers, Mask
    from hil.imports.readers.joint_state_layout import MessageLayout

    Places = dict[str, tuple[Integers, Integers]]

LAYOUTS = 32
"""Layouts of messages that are looked for in one recording; more are read one by one."""


class Rows:
    """Rows of the columns asked for; where joints stand in a message is looked up once a list.

    Parameters
    ----------
    wanted : sequence of (str, str)
        Of each column the part of a message, and the joint; no joint for times.
    general : callable
        Reads any message.
    cdr : bool
        Whether messages are in CDR, whose layouts are known.
    """

    def __init__(
        self, wanted: Sequence[tuple[str, str]], general: Callable[[bytes], Any], *, cdr: bool
    ) -> None:
        self._wanted = wanted
        self._times = {part: column for column, (part, joint) in enumerate(wanted) if not joint}
        self._general, self._cdr = general, cdr
        self._places: dict[tuple[str, ...], Places] = {}
        self._layouts: list[MessageLayout] = []

    def of(self, messages: Sequence[bytes], received: Array) -> Array:
        """Rows of messages, without those that have none of the joints.

        Parameters
        ----------
        messages : sequence of bytes
        received : array (n_messages,)
            Stamps of the bag [ns].
        """
        rows = np.full((len(messages), len(self._wanted)), np.nan)
        self._put(rows, slice(None), "received", received)
        present = np.zeros(len(messages), dtype=bool)
        every = np.arange(len(messages))
        for number in self._fill_alike(messages, rows, present) if self._cdr else every:
            message = self._general(messages[number])
            values = {part: np.asarray(getattr(message, part))[np.newaxis] for part in PARTS}
            stamp = message.header.stamp
            stamps = np.array([float(stamp.sec)]), np.array([float(stamp.nanosec)])
            this = np.array([number])
            present[number] = self._fill(rows, this, tuple(message.name), values, stamps)
        return rows[present]

    def _fill_alike(self, messages: Sequence[bytes], rows: Array, present: Mask) -> Integers:
        """Fill the rows of all messages that share a layout; return the numbers of the others."""
        sizes, left = np.array([len(message) for message in messages]), np.arange(len(messages))
        odd: list[int] = []
        tried = 0
        while len(left) and (tried < len(self._layouts) or len(self._layouts) < LAYOUTS):
            if tried == len(self._layouts) and not self._learn(messages[left[0]]):
                odd.append(int(left[0]))
                left = left[1:]
                continue
            layout, tried = self._layouts[tried], tried + 1
            these = left[sizes[left] == layout.size]
            joined = b"".join([messages[number] for number in these])
            alike = np.frombuffer(joined, np.uint8).reshape(-1, layout.size)
            fits = layout.fits(alike)
            these, alike = these[fits], alike[fits]
            values = {part: layout.part(alike, part) for part in PARTS}
            present[these] = self._fill(rows, these, layout.names, values, layout.stamps(alike))
            left = np.setdiff1d(left, these, assume_unique=True)
        return np.concatenate([np.array(odd, dtype=np.int64), left])

    def _learn(self, message: bytes) -> bool:
        """Note the layout of a message, if it has one."""
        try:
            self._layouts.append(layout_of(message))
        except OtherLayout:
            return False
        return True

    def _fill(
        self,
        rows: Array,
        these: Integers,
        names: tuple[str, ...],
        values: dict[str, Array],
        stamps: tuple[Array, Array],
    ) -> bool:
        """Fill the rows of messages with the same names; return whether any joint is wanted."""
        if names not in self._places:
            self._places[names] = self._find(names)
        places = self._places[names]
        for part, (columns, joints) in places.items():
            if values[part].shape[1] == len(names):
                rows[these[:, np.newaxis], columns] = values[part][:, joints]
        seconds, nanoseconds = stamps
        self._put(rows, these, "sec", seconds)
        self._put(rows, these, "nanosec", nanoseconds)
        self._put(rows, these, "time", seconds * 1e9 + nanoseconds)
        return bool(places)

    def _put(self, rows: Array, these: Integers | slice, name: str, times: Array) -> None:
        if name in self._times:
            rows[these, self._times[name]] = times

    def _find(self, names: tuple[str, ...]) -> Places:
        """Of each part the columns that a message with these joints fills, and from where."""
        found: dict[str, list[tuple[int, int]]] = {}
        for column, (part, joint) in enumerate(self._wanted):
            if joint and joint in names:
                found.setdefault(part, []).append((column, names.index(joint)))
        return {
            part: (np.array([c for c, _ in pairs]), np.array([j for _, j in pairs]))
            for part, pairs in found.items()
        }
