"""Process data of drives with wrap-around positions (`drivers.axis.Wrap`), as places of the axes.

Received positions are unwrapped and sent targets are wrapped, only here: other modules see no ends
of a range.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drivers.axis import Axis
    from drivers.cycle_data import ProcessData


def unwrap_positions(process_data: ProcessData, axes: Sequence[Axis]) -> ProcessData:
    """Return process data in places of the axes; unchanged where no positions wrap around."""
    if not any(axis.wrap for axis in axes):
        return process_data
    return cast("ProcessData", _Unwrapped(process_data, axes))


class _Unwrapped:
    """Process data with positions and targets converted, and other members passed on."""

    looks_ahead = False

    def __init__(self, process_data: ProcessData, axes: Sequence[Axis]) -> None:
        self.__dict__.update(_inner=process_data, _wraps=[axis.wrap for axis in axes])

    def __getattr__(self, name: str) -> Any:
        return getattr(self._inner, name)

    def __setattr__(self, name: str, value: object) -> None:
        setattr(self._inner, name, value)

    @property
    def positions(self) -> tuple[int, ...]:
        """Places of the axes [increments]."""
        pairs = zip(self._wraps, self._inner.positions, strict=True)
        return tuple(wrap.unwrap(position) if wrap else position for wrap, position in pairs)

    def command(self, axis: int, target: int, controlword: int) -> None:
        """Send a place [increments] and controlword to an axis."""
        self._inner.command(axis, self._wrap(axis, target), controlword)

    def lead(self, axis: int, target: int) -> None:
        """Send a streamed set-point to an axis [increments]."""
        self._inner.lead(axis, self._wrap(axis, target))

    def _wrap(self, axis: int, target: int) -> int:
        wrap = self._wraps[axis]
        return wrap.wrap(target) if wrap else target
