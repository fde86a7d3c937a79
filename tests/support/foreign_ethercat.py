"""Independent EtherCAT masters, in separate processes, on a cable of two interfaces.

`python foreign_ethercat.py MASTER INTERFACE`, with one of `MASTERS`, brings all slaves on the
interface to OP, moves the axes and prints the observations as JSON. `session` runs this command
with the plant in a network namespace.
"""

from __future__ import annotations

import asyncio
import contextlib
import datetime
import functools
import importlib.util
import json
import os
import shutil
import struct
import subprocess
import sys
import time
from typing import Any

import pytest

OURS, THEIRS = "plant0", "master0"
TRAVEL, SHORT = 20_000, 1_000
"""Distances of every axis [increments]."""
_PATIENCE = 0.05
"""Time-out of KickCAT for each frame [s], instead of 2 ms: a busy machine answers late."""
_TRIES = 5
"""Attempts to write a register by pysoem, which waits 4 ms: a busy machine answers late."""
OUT = struct.Struct("<Hiih")
_SCRIPT = """
ip link set lo up
ip link add {ours} type veth peer name {theirs}
ip link set {ours} up
ip link set {theirs} up
until ip link show {theirs} | grep -q "state UP"; do sleep 0.02; done
plant="{python} -u -m sim_plant --interface ethercat --channel {ours} {options}"
coproc PLANT {{ exec $plant 2>&1; }}
read -r line <&${{PLANT[0]}} && read -r line <&${{PLANT[0]}}
export PLANT_PID
{python} {master}
status=$?
kill $PLANT_PID
exit $status
"""


def needs(module: str | None = None) -> pytest.MarkDecorator:
    """Skip the test if a master or the rights for a network namespace are missing."""
    if module is not None and importlib.util.find_spec(module) is None:
        reason = f"{module} is not installed: pip install {module}"
    elif not hasattr(os, "geteuid") or os.geteuid() != 0:
        reason = "only root may make a network namespace"
    elif shutil.which("unshare") is None or shutil.which("ip") is None:
        reason = "no unshare or no ip here"
    else:
        probe = subprocess.run(  # noqa: S603 - fixed arguments
            ["unshare", "-n", "ip", "link", "add", OURS, "type", "veth", "peer", "name", THEIRS],  # noqa: S607
            capture_output=True,
            check=False,
        )
        reason = "" if probe.returncode == 0 else "this kernel has no veth"
    return pytest.mark.skipif(bool(reason), reason=reason)


def session(master: str) -> dict[str, Any]:
    """Return the observations of a master on the plant."""
    seen: dict[str, Any] = json.loads(carried_out(__file__, master, THEIRS).splitlines()[-1])
    return seen


def carried_out(
    script_of_master: str, *arguments: str, options: str = "", timeout: float = 120
) -> str:
    """Return the output of a script in a network namespace with the plant.

    PLANT_PID in the script's environment is the plant's process; `options` are those of the plant.
    """
    script = _SCRIPT.format(
        ours=OURS,
        theirs=THEIRS,
        python=sys.executable,
        options=options,
        master=" ".join((script_of_master, *arguments)),
    )
    done = subprocess.run(  # noqa: S603 - our own script
        ["unshare", "-n", "bash", "-c", script],  # noqa: S607
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def soem(interface: str, *, clock: bool) -> dict[str, Any]:
    """Use every service of a slave by pysoem."""
    import pysoem  # type: ignore[import-not-found]

    seen: dict[str, Any] = {}
    master = pysoem.Master()
    master.open(interface)
    seen["slaves"] = master.config_init()
    slaves = master.slaves
    first = slaves[0]
    seen["identity"] = [(s.name, s.man, s.id, s.rev) for s in slaves]
    seen["name"] = first.sdo_read(0x1008, 0).decode()
    first.sdo_write(0x6081, 0, struct.pack("<I", 40_000))
    seen["written"] = struct.unpack("<I", first.sdo_read(0x6081, 0))[0]
    seen["complete"] = first.sdo_read(0x1018, 0, ca=True).hex()
    seen["aborts"] = []
    for index in (0x2FFF, 0x6502):
        try:
            first.sdo_write(index, 0, bytes(4))
        except pysoem.SdoError as error:
            seen["aborts"].append(error.abort_code)

    def reassign(_position: int) -> None:
        slave = slaves[1]
        slave.sdo_write(0x1C13, 0, b"\0")
        slave.sdo_write(0x1A01, 0, b"\0")
        for n, entry in enumerate((0x6041_0010, 0x6064_0020, 0x6077_0010), start=1):
            slave.sdo_write(0x1A01, n, struct.pack("<I", entry))
        slave.sdo_write(0x1A01, 0, b"\3")
        slave.sdo_write(0x1C13, 1, struct.pack("<H", 0x1A01))
        slave.sdo_write(0x1C13, 0, b"\1")

    slaves[1].config_func = reassign
    master.config_map()
    seen["sizes"] = [(len(s.output), len(s.input)) for s in slaves]
    seen["clocks"] = bool(master.config_dc())
    for slave in slaves if clock else ():
        slave.dc_sync(True, 4_000_000)
    seen["safeop"] = master.state_check(pysoem.SAFEOP_STATE, 500_000)
    for slave in slaves:
        for again in reversed(range(_TRIES)):
            try:
                slave.set_watchdog("processdata", 500)
                break
            except pysoem.WkcError:
                if again == 0:
                    raise

    def cycle(count: int) -> None:
        for _ in range(count):
            master.send_processdata()
            if master.receive_processdata(100_000) != master.expected_wkc:
                seen["missed"] = seen.get("missed", 0) + 1

    cycle(2)
    master.state = pysoem.OP_STATE
    master.write_state()
    cycle(60)  # SYNC0 begins 100 ms after the request
    seen["op"] = master.state_check(pysoem.OP_STATE, 500_000)
    seen["objects"] = len(first.od)

    def inputs() -> list[tuple[int, int]]:
        return [struct.unpack_from("<Hi", s.input) for s in slaves]

    def command(word: int, targets: list[int], count: int) -> None:
        for slave, target in zip(slaves, targets, strict=True):
            slave.output = OUT.pack(word, target, 0, 0)
        cycle(count)

    start = [position for _, position in inputs()]
    targets = [position + TRAVEL for position in start]
    for word in (6, 7, 15):
        command(word, start, 4)
    seen["enabled"] = [word & 0x6F for word, _ in inputs()]
    command(0x1F, targets, 4)
    command(0x0F, targets, 1500)
    seen["moved"] = [b - a for (_, b), a in zip(inputs(), start, strict=True)]
    command(6, targets, 50)
    seen["off"] = [word & 0x6F for word, _ in inputs()]
    began = time.perf_counter()
    cycle(500)
    seen["us per cycle"] = round((time.perf_counter() - began) / 500 * 1e6)
    master.state = pysoem.INIT_STATE
    master.write_state()
    master.close()
    return seen


def kickcat(interface: str) -> dict[str, Any]:
    """Bring slaves to OP and move them by KickCAT."""
    import kickcat as kc  # type: ignore[import-not-found]

    seen: dict[str, Any] = {}
    link = kc.create_link(interface, "")
    link.set_timeout(datetime.timedelta(seconds=_PATIENCE))
    bus = kc.Bus(link)
    bus.init(0.1)
    slaves = list(bus.slaves())
    seen["slaves"] = len(slaves)
    seen["type"] = bytes(bus.read_sdo(slaves[0], 0x1000, 0, kc.Access.PARTIAL, 4, 1.0)).hex()
    seen["complete"] = bytes(bus.read_sdo(slaves[0], 0x1018, 0, kc.Access.COMPLETE, 18, 1.0)).hex()
    bus.create_mapping()
    bus.request_state(kc.State.SAFE_OP)
    bus.wait_for_state(kc.State.SAFE_OP, 1.0)

    def command(word: int, targets: list[int], count: int) -> None:
        for slave, target in zip(slaves, targets, strict=True):
            slave.set_output_bytes(OUT.pack(word, target, 0, 0))
        for _ in range(count):
            bus.process_data_no_check()

    def inputs() -> list[tuple[int, int]]:
        return [struct.unpack_from("<Hi", bytes(s.input_data)) for s in slaves]

    command(0, [0] * len(slaves), 3)
    start = [position for _, position in inputs()]
    bus.request_state(kc.State.OPERATIONAL)
    bus.wait_for_state(kc.State.OPERATIONAL, 1.0, bus.process_data_no_check)
    for word in (6, 7, 15):
        command(word, start, 4)
    seen["enabled"] = [word & 0x6F for word, _ in inputs()]
    targets = [position + SHORT for position in start]
    command(0x1F, targets, 4)
    command(0x0F, targets, 120)
    seen["moved"] = [b - a for (_, b), a in zip(inputs(), start, strict=True)]
    return seen


def ebpfcat(interface: str) -> dict[str, Any]:
    """Use every service of a slave by ebpfcat, which has no distributed clock."""
    return asyncio.run(_ebpfcat(interface))


async def _ebpfcat(interface: str) -> dict[str, Any]:
    from ebpfcat.ethercat import (  # type: ignore[import-not-found]
        ECCmd,
        EtherCat,
        EtherCatError,
        MachineState,
        Terminal,
    )

    seen: dict[str, Any] = {"aborts": 0}
    master = EtherCat(interface)
    await master.connect()
    seen["slaves"] = await master.count()
    slaves = [Terminal(master) for _ in range(seen["slaves"])]
    for n, slave in enumerate(slaves):
        await slave.initialize(-n, 0x1001 + n)
        await slave.to_operational(MachineState.PRE_OPERATIONAL)
    first, second, *_ = slaves
    seen["identity"] = [(s.vendorId, s.productCode, s.revisionNo) for s in slaves]
    seen["name"] = (await first.sdo_read(0x1008, 0)).decode()
    for entry, fmt, value in (
        ((0x6060, 0), "b", 1),
        ((0x6007, 0), "<h", 3),
        ((0x6081, 0), "<I", 40_000),
    ):
        await first.sdo_write(struct.pack(fmt, value), *entry)
        seen[f"{entry[0]:04X}"] = (await first.sdo_read_format(fmt, *entry))[0] == value
    seen["complete"] = (await first.sdo_read(0x1018)).hex()
    for index in (0x2FFF, 0x6502):
        try:
            await first.sdo_write(bytes(4), index, 0)
        except EtherCatError:
            seen["aborts"] += 1
    objects = await first.read_ODlist()
    seen["objects"] = len(objects)
    seen["described"] = [objects[0x6040].name, objects[0x1018].entries[2].name]
    await second.sdo_write(b"\0", 0x1C13, 0)
    await second.sdo_write(b"\0", 0x1A01, 0)
    for n, word in enumerate((0x6041_0010, 0x6064_0020, 0x6077_0010), start=1):
        await second.sdo_write(struct.pack("<I", word), 0x1A01, n)
    await second.sdo_write(b"\3", 0x1A01, 0)
    await second.sdo_write(struct.pack("<H", 0x1A01), 0x1C13, 1)
    await second.sdo_write(b"\1", 0x1C13, 0)
    seen["sizes"] = []
    async with contextlib.AsyncExitStack() as mapped:
        for n, slave in enumerate(slaves):
            bits = await slave.parse_pdos()
            slave.pdo_out_sz, slave.pdo_in_sz = (each // 8 for each in bits)
            seen["sizes"].append((slave.pdo_out_sz, slave.pdo_in_sz))
            await slave.write_pdo_sm()
            await slave.write(0x420, "H", 5000)
            for write, place in ((True, 16 * n), (False, 0x400 + 16 * n)):
                await mapped.enter_async_context(slave.map_fmmu(place, write=write))

        async def cycle(word: int, targets: list[int], count: int) -> list[tuple[int, int]]:
            out = b"".join(OUT.pack(word, each, 0, 0).ljust(16, b"\0") for each in targets)
            for _ in range(count):
                found, _ = await asyncio.gather(
                    master.roundtrip(ECCmd.LRD, 0x400, 0, data=len(out)),
                    master.roundtrip(ECCmd.LWR, 0, 0, data=out),
                )
            return [struct.unpack_from("<Hi", found, 16 * n) for n in range(len(targets))]

        for slave in slaves:
            await slave.to_operational(MachineState.SAFE_OPERATIONAL)
        start = [position for _, position in await cycle(0, [0] * len(slaves), 3)]
        for slave in slaves:
            await slave.to_operational(MachineState.OPERATIONAL)
        seen["op"] = [(await slave.get_state())[0].value for slave in slaves]
        for word in (6, 7, 15):
            shown = await cycle(word, start, 4)
        seen["enabled"] = [word & 0x6F for word, _ in shown]
        targets = [position + SHORT for position in start]
        await cycle(0x1F, targets, 4)
        shown = await cycle(0x0F, targets, 400)
        seen["moved"] = [b - a for (_, b), a in zip(shown, start, strict=True)]
        seen["off"] = [word & 0x6F for word, _ in await cycle(6, targets, 50)]
        for slave in slaves:
            await slave.set_state(MachineState.INIT)
    return seen


MASTERS = {
    "soem": functools.partial(soem, clock=False),
    "soem-dc": functools.partial(soem, clock=True),
    "kickcat": kickcat,
    "ebpfcat": ebpfcat,
}

if __name__ == "__main__":
    which, wire = sys.argv[1:3]
    found = MASTERS[which](wire)
    print(json.dumps(found))  # noqa: T201 - read by who asked
