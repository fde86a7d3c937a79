"""Real-time privileges: requested, granted, and given back completely."""

from __future__ import annotations

import errno
import os
import re
import threading
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from hil.cli import doctor
from hil.cli.doctor import PRIORITY, SLICE, Linux, real_time, short_slices

if TYPE_CHECKING:
    from collections.abc import Callable


class Machine(Linux):
    """System with the given privileges; it records all calls."""

    def __init__(self, *granted: str, isolated: set[int] | None = None) -> None:
        self.log: list[str] = []
        self._granted = granted
        self._isolated = isolated or set()

    def schedule(self, priority: int) -> Callable[[], None]:
        return self._ask("scheduling", f"FIFO {priority}")

    def slice(self, duration: int) -> Callable[[], None]:
        return self._ask("slice", f"slice {duration}")

    def lock_memory(self) -> Callable[[], None]:
        return self._ask("memory", "lock")

    def pin(self, core: int) -> Callable[[], None]:
        return self._ask("core", f"pin {core}")

    def stay_awake(self) -> Callable[[], None]:
        return self._ask("idle states", "awake")

    def cores(self) -> set[int]:
        return {0, 1}

    def isolated(self) -> set[int]:
        return self._isolated

    def _ask(self, name: str, done: str) -> Callable[[], None]:
        if name not in self._granted:
            raise OSError(errno.EPERM, os.strerror(errno.EPERM))
        self.log.append(done)
        return lambda: self.log.append(f"undo {done}")


ALL = ("scheduling", "memory", "core", "idle states")


def name_measures(measures: tuple[str, ...]) -> dict[str, str]:
    return {measure.partition(":")[0]: measure for measure in measures}


def granted(measure: str) -> bool:
    """Return True if all requests were granted."""
    return ";" not in measure


def test_what_is_granted_is_used_and_given_back_in_reverse_order() -> None:
    machine = Machine(*ALL, isolated={2, 3})
    with real_time(machine) as measures:
        assert all(map(granted, measures))
        taken = list(machine.log)
    assert taken == ["lock", "awake", "pin 3", f"FIFO {PRIORITY}"]
    assert machine.log[4:] == [f"undo {done}" for done in reversed(taken)]


def test_all_is_given_back_after_an_interrupt_too() -> None:
    machine = Machine(*ALL, isolated={2})
    with pytest.raises(KeyboardInterrupt), real_time(machine):
        raise KeyboardInterrupt
    assert len(machine.log) == 8


@pytest.mark.parametrize("missing", ALL)
def test_what_is_refused_is_stated_with_the_reason_and_the_remedy(missing: str) -> None:
    machine = Machine(*(set(ALL) - {missing}), isolated={1})
    with real_time(machine) as measures:
        found = name_measures(measures)
    assert f"{missing}: not granted (Operation not permitted); " in found[missing]
    remedies = {
        "scheduling": "rtprio",
        "memory": "memlock",
        "core": "isolcpus",
        "idle states": "cpu_dma_latency",
    }
    assert remedies[missing] in found[missing]
    assert all(granted(found[name]) for name in ALL if name != missing)


def test_a_shared_core_is_never_occupied() -> None:
    machine = Machine(*ALL)
    with real_time(machine) as measures:
        core = name_measures(measures)["core"]
    assert not any(done.startswith("pin") for done in machine.log)
    assert core == (
        "core: all 2 are shared with other programs; reserve a core with the kernel parameter"
        " isolcpus=N"
    )


def test_a_system_without_these_calls_grants_nothing_and_runs_all_the_same(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in ("sched_setscheduler", "sched_getscheduler", "sched_getaffinity"):
        monkeypatch.delattr(os, name)
    monkeypatch.setattr(doctor.ctypes, "CDLL", lambda *_a, **_k: object())
    monkeypatch.setattr(doctor, "_AWAKE", Path("/nowhere"))
    monkeypatch.setattr(doctor, "_ISOLATED", Path("/nowhere"))
    with real_time() as measures:
        assert not any(map(granted, measures))


@pytest.mark.skipif(not hasattr(os, "sched_setscheduler"), reason="this system has no such calls")
def test_a_user_with_the_right_to_rtprio_alone_gets_a_normal_thread_back(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Linux permits threads to inherit the class again only with CAP_SYS_NICE."""
    policies = [os.SCHED_OTHER]

    def put(_pid: int, policy: int, _parameters: os.sched_param) -> None:
        if policies[-1] & ~policy & os.SCHED_RESET_ON_FORK:
            raise PermissionError(errno.EPERM, os.strerror(errno.EPERM))
        policies.append(policy)

    monkeypatch.setattr(os, "sched_setscheduler", put)
    monkeypatch.setattr(os, "sched_getscheduler", lambda _pid: policies[-1])
    give_back = Linux().schedule(PRIORITY)
    assert policies[-1] == os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
    give_back()
    assert policies[-1] == os.SCHED_OTHER | os.SCHED_RESET_ON_FORK


def test_a_short_slice_is_given_back_and_missed_by_nobody() -> None:
    machine = Machine("slice")
    with short_slices(machine):
        assert machine.log == [f"slice {SLICE}"]
    assert machine.log[1:] == [f"undo slice {SLICE}"]
    with short_slices(Machine()):  # a system that refuses all requests
        pass


def test_a_processor_whose_calls_are_not_known_is_asked_for_no_slice(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(doctor.platform, "machine", lambda: "z80")
    with short_slices():
        pass


def slice_of_this_thread() -> int | None:
    """Return the time slice from the kernel [ns], or None."""
    scheduling = Path("/proc/self/sched")
    if not scheduling.exists():
        return None
    found = re.search(r"se.slice +: +(\d+)", scheduling.read_text(encoding="ascii"))
    return int(found[1]) if found else None


@pytest.mark.skipif(slice_of_this_thread() is None, reason="this kernel shows no slices")
def test_this_machine_gives_short_slices_to_users_without_rights() -> None:
    before = slice_of_this_thread()
    nice = os.getpriority(os.PRIO_PROCESS, 0)
    with short_slices():
        asked = slice_of_this_thread()
    assert asked in {SLICE, before}  # the latter before Linux 6.12
    assert slice_of_this_thread() == before
    assert os.getpriority(os.PRIO_PROCESS, 0) == nice


@pytest.mark.parametrize(
    ("text", "cores"), [("\n", set()), ("3\n", {3}), ("2-4,7\n", {2, 3, 4, 7})]
)
def test_isolated_cores_are_read_as_the_kernel_lists_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, cores: set[int]
) -> None:
    path = tmp_path / "isolated"
    path.write_text(text)
    monkeypatch.setattr(doctor, "_ISOLATED", path)
    assert Linux().isolated() == cores


@pytest.mark.skipif(not hasattr(os, "sched_setscheduler"), reason="this system has no such calls")
def test_this_machine_has_what_is_said_and_everything_is_as_before_afterwards() -> None:
    def state() -> tuple[object, ...]:
        return os.sched_getscheduler(0), os.sched_getparam(0).sched_priority, locked()

    before = state()
    inherited: list[int] = []
    with real_time() as measures:
        found = name_measures(measures)
        policy = os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK
        assert (policy == os.SCHED_FIFO) is granted(found["scheduling"])
        assert (locked() > 0) is granted(found["memory"])
        other = threading.Thread(target=lambda: inherited.append(os.sched_getscheduler(0)))
        other.start()
        other.join()
    assert inherited == [os.SCHED_OTHER]
    assert state() == before


def locked() -> int:
    """Return the locked memory of this process [kB]."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmLck"))
