"""Operator with a script, and plants and buses with defects, for tests of probing."""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import can

from drivers.drives_file import DrivesFile, load_drives
from hil.model.robot import ROBOTS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

DRIVES = ROBOTS / "manutec-r15.drives.yaml"
PLANT = Path(__file__).parents[2] / "sim_plant" / "plants" / "manutec-r15.yaml"


class Scripted:
    """Operator with fixed consent, who presses keys after a number of looks at the keyboard."""

    def __init__(self, *, agreed: bool = True, present: bool = False, **keys: int) -> None:
        self.present = present
        self.shown: list[str] = []
        self._agreed = agreed
        self._keys = {key: int(look) for key, look in keys.items()}
        self._looks = 0

    def agrees(self, intent: str) -> bool:
        self.shown.append(intent)
        return self._agreed

    def show(self, text: str) -> None:
        self.shown.append(text)

    def pressed(self) -> str:
        self._looks += 1
        return "".join(key for key, look in self._keys.items() if look == self._looks)


class Answering(Scripted):
    """Operator who answers every question with one key."""

    def __init__(self, key: str) -> None:
        super().__init__(present=True)
        self._key = key

    def pressed(self) -> str:
        return self._key


class AlteredBus(can.BusABC):
    """The plant's bus with altered frames; it also records whether a motor had power."""

    lock_step = True

    def __init__(self, inner: can.BusABC, alter: Callable[[can.Message], None]) -> None:
        self._inner, self._alter = inner, alter
        self.channel_info = inner.channel_info
        self.controlwords: list[int] = []
        super().__init__("altered")

    @property
    def powered(self) -> bool:
        """True if operation was ever enabled."""
        return 0x0F in {word & 0x0F for word in self.controlwords}

    @property
    def left_off(self) -> bool:
        """True if the last command to the drives removes power."""
        return not self.controlwords or not self.controlwords[-1] & 0x02

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        can_id, data = msg.arbitration_id, bytes(msg.data)
        if can_id & 0x780 == 0x200 or (can_id & 0x780 == 0x600 and data[:3] == b"\x2b\x40\x60"):
            self.controlwords.append(int.from_bytes(data[4:6], "little"))
        self._inner.send(msg, timeout)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        frame = self._inner.recv(timeout)
        if frame is not None:
            self._alter(frame)
        return frame

    def _recv_internal(self, timeout: float | None) -> Any:
        return self.recv(timeout), True


def unaltered(_frame: can.Message) -> None:
    """Return a frame unchanged."""


@contextmanager
def bench(
    plant: Path | str = "manutec-r15", alter: Callable[[can.Message], None] = unaltered
) -> Iterator[AlteredBus]:
    """Return a plant's bus with altered frames."""
    with (
        can.Bus(str(plant), "sim_plant", ignore_config=True) as inner,
        AlteredBus(inner, alter) as bus,
    ):
        yield bus


def drives_of(*axes: int, **changes: Any) -> DrivesFile:
    """Return the drives file of the manutec with these joints alone (from 1), each changed."""
    whole = load_drives(DRIVES)
    some = tuple(
        whole.axes[axis - 1].model_validate(whole.axes[axis - 1].model_dump() | changes)
        for axis in axes
    )
    return whole.model_copy(update={"axes": some})


def spoilt_plant(folder: Path, *changes: tuple[str, str]) -> Path:
    """Write a plant file with some text replaced, each once; return its path."""
    text = PLANT.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    path = folder / "spoilt.yaml"
    path.write_text(text)
    return path
