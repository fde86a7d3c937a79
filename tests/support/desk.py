"""Master without bus and threads, for the plant's CANopen side."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from sim_plant.canopen.abort_codes import AbortCode, SdoAbort
from sim_plant.canopen.eds import drive_entries, key

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ideal_machine import IdealMachine

    from sim_plant.slave_network import SlaveNetwork


class Desk:
    """Master without bus and threads: SDO, SYNC and NMT directly with the slave network."""

    def __init__(self, network: SlaveNetwork, machine: IdealMachine) -> None:
        self.network = network
        self.machine = machine
        self.log: list[tuple[float, int, bytes]] = []
        """All frames sent by the drives."""

    def send(self, identifier: int, data: bytes = b"") -> list[tuple[int, bytes]]:
        frames = self.network.receive(identifier, data)
        self.log += frames
        return [(number, payload) for _, number, payload in frames]

    def sync(self, count: int = 1) -> list[tuple[int, bytes]]:
        return [frame for _ in range(count) for frame in self.send(0x80)]

    def nmt(self, command: int, node: int = 0) -> list[tuple[int, bytes]]:
        return self.send(0, bytes([command, node]))

    def request(self, node: int, *data: int) -> bytes:
        """Return the response to one SDO frame."""
        frames = self.send(0x600 + node, bytes(data).ljust(8, b"\0"))
        return next(payload for number, payload in frames if number == 0x580 + node)

    def write(self, index: int, value: int, subindex: int = 0, node: int = 1) -> None:
        """Write by expedited SDO; raise `SdoAbort` on refusal."""
        data = struct.pack("<" + drive_entries()[key(index, subindex)].code, value)
        command = 0x23 | (4 - len(data)) << 2
        self._checked(node, command, *struct.pack("<HB", index, subindex), *data)

    def read(self, index: int, subindex: int = 0, node: int = 1) -> int:
        """Read by expedited SDO; raise `SdoAbort` on refusal."""
        response = self._checked(node, 0x40, *struct.pack("<HB", index, subindex))
        code = drive_entries()[key(index, subindex)].code
        return int(struct.unpack_from("<" + code, response, 4)[0])

    def _checked(self, node: int, *data: int) -> bytes:
        response = self.request(node, *data)
        if response[0] == 0x80:
            raise SdoAbort(AbortCode(struct.unpack_from("<I", response, 4)[0]))
        return response

    def map_tpdo(self, transmission: int, *objects: int, number: int = 0, node: int = 1) -> None:
        """Map objects (index << 16 | sub-index << 8 | bits) into a TPDO and switch it on."""
        self._map(0x1800 + number, 0x180 + 0x100 * number, transmission, objects, node)

    def map_rpdo(self, transmission: int, *objects: int, number: int = 0, node: int = 1) -> None:
        """Map objects into an RPDO and switch it on."""
        self._map(0x1400 + number, 0x200 + 0x100 * number, transmission, objects, node)

    def _map(
        self, record: int, identifier: int, kind: int, objects: Sequence[int], node: int
    ) -> None:
        self.write(record, 1 << 31 | identifier + node, 1, node)
        self.write(record, kind, 2, node)
        self.write(record + 0x200, 0, 0, node)
        for subindex, entry in enumerate(objects, start=1):
            self.write(record + 0x200, entry, subindex, node)
        self.write(record + 0x200, len(objects), 0, node)
        self.write(record, identifier + node, 1, node)

    def enable(self, node: int = 1) -> None:
        """Bring a drive to OPERATION ENABLED."""
        for controlword in (0x06, 0x07, 0x0F):
            self.write(0x6040, controlword, node=node)

    def status(self, node: int = 1) -> int:
        return self.read(0x6041, node=node)
