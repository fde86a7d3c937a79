"""Cost of one SYNC with six drives, each answering with status, position and current.

The simulated machine does no computation, so the time is that of CANopen and python-can::

    python benchmarks/slave_network.py
"""

from __future__ import annotations

import timeit
from types import SimpleNamespace
from typing import TYPE_CHECKING
from unittest import mock

import can
import canopen
import numpy as np
from figures import Figure, keep

from sim_plant.canopen.eds import EDS_PATH
from sim_plant.drive_settings import DriveSettings
from sim_plant.machine_protocol import AxisEvent, Reading
from sim_plant.serving import plant_channel

if TYPE_CHECKING:
    from collections.abc import Callable

N_AXES = 6
SYNC = can.Message(arbitration_id=0x80, is_extended_id=False)


def idle_machine() -> SimpleNamespace:
    """Return a machine with axes at rest, without computation."""
    reading = Reading(1, 2, 3, 4, 5, 6, int(AxisEvent.DONE | AxisEvent.STANDSTILL))
    readings = np.array(list(reading) * N_AXES)
    drives = [
        DriveSettings(
            f"axis {n}", n, 1, 2, 3, n, 5000, 3000, 3000, 4096, (1, 1), (0, 0), 6000, 9999
        )
        for n in range(1, N_AXES + 1)
    ]
    return SimpleNamespace(
        drives=drives,
        axes=[mock.MagicMock() for _ in drives],
        advance=lambda _duration: None,
        read=lambda: readings,
    )


def configure(channel: str) -> None:
    """Map TPDO1 of every drive and start all nodes."""
    network = canopen.Network()
    network.NOTIFIER_CYCLE = 0.02
    network.connect(interface="sim_plant", channel=channel)
    for n in range(1, N_AXES + 1):
        node = network.add_node(n, str(EDS_PATH))
        node.tpdo.read()
        node.tpdo[1].clear()
        for index in (0x6041, 0x6064, 0x6078):
            node.tpdo[1].add_variable(index)
        node.tpdo[1].trans_type, node.tpdo[1].enabled = 1, True
        node.tpdo[1].save()
    network.nmt.state = "OPERATIONAL"
    network.disconnect()


def best(action: Callable[[], object], number: int = 2000) -> Figure:
    """Return the shortest mean time of one call."""
    times = np.array(timeit.repeat(action, number=number, repeat=15)) / number * 1e6
    return Figure(times.min(), "us", 3, Figure.median(times).scatter)


def main() -> None:
    """Measure, print and keep."""
    machine = idle_machine()
    with (
        mock.patch.object(plant_channel, "load_machine", return_value=machine),
        can.Bus(interface="sim_plant", channel="idle") as bus,
    ):
        configure("idle")
        while bus.recv(0):
            pass

        def one_by_one() -> None:
            bus.send(SYNC)
            for _ in range(N_AXES):
                assert bus.recv(0) is not None

        network = bus._plant._network  # type: ignore[attr-defined]
        slaves, whole = best(lambda: network.receive(0x80, b"")), best(one_by_one)
    print(f"six drives, frames in to frames out: {slaves.value:.1f} us/SYNC")
    print(f"with PlantBus.send and six recv:     {whole.value:.1f} us/SYNC")
    ratio = Figure(whole.value / slaves.value)
    keep(
        "slave-network", {"bus-over-slaves": ratio, "slaves": slaves, "bus": whole},
        depends=("sim_plant/canopen", "sim_plant/serving", "sim_plant/slave_network.py"),
        command="python benchmarks/slave_network.py",
    )  # fmt: skip


if __name__ == "__main__":
    main()
