"""Exchanged node numbers are distinguished from wrong ratings."""

from __future__ import annotations

from typing import Any

import local_drives
import pytest
import stated_axis
from canopen_drive_bus import CanopenDriveBus
from local_bench import axis, never_energised
from probing_bench import Scripted

from drivers.canopen.bus import CanopenBus
from drivers.commissioning.verdict import Grade, Verdict
from drivers.drive_bus import DriveRefused
from drivers.operator_tools.check import check
from drivers.operator_tools.check_powered import SmallMoves

RATED, VENDOR = (0x6075, 0), (0x1018, 1)


def bench(**currents: int) -> Any:
    """Return drives with these rated currents [mA], by node."""
    changes = {int(node[1:]): {RATED: ("u32", value)} for node, value in currents.items()}
    return local_drives.LocalBus(3, changes)


def drives(*ampere: float) -> Any:
    """Return a drives file with these rated currents [A]."""
    entries = (axis(node, rated_current=value) for node, value in enumerate(ampere, start=1))
    return stated_axis.drives(*entries)


def refused(bus: Any, file: Any) -> list[Verdict]:
    verdicts = list(check(CanopenBus(bus), file, SmallMoves(), Scripted(agreed=False)))
    assert never_energised(bus)
    return [each for each in verdicts if each.grade is Grade.REFUSED and each.place != "all axes"]


def test_two_drives_that_fit_each_other_s_entries_are_swapped() -> None:
    with bench(n1=1000, n2=3000, n3=2000) as bus:
        second, third = refused(bus, drives(1.0, 2.0, 3.0))
    assert (second.place, second.found) == ("joint 2 (node 2)", "3 A")
    assert second.remedy == (
        "by identity and ratings this is the drive of joint 3 (node 3): nodes 2 and 3 are swapped,"
        " exchange them in the drives file"
    )
    assert "nodes 2 and 3 are swapped" in third.remedy


def test_a_run_says_so_too_instead_of_correct_rated_current() -> None:
    with bench(n1=1000, n2=3000, n3=2000) as bus:
        with pytest.raises(DriveRefused) as caught:
            CanopenDriveBus(bus, drives(1.0, 2.0, 3.0)).__enter__()
        assert never_energised(bus)
    assert str(caught.value).count("nodes 2 and 3 are swapped") == 2
    assert "correct rated_current" not in str(caught.value)


def test_swapped_drives_that_state_who_they_are_show_by_their_identity() -> None:
    with bench(n1=1000, n2=3000, n3=2000) as bus:
        bus.drives[2].node.set_data(0x1018, 3, (7).to_bytes(4, "little"))
        file = drives(1.0, 2.0, 3.0)
        third = file.axes[2]
        sure = third.identity.model_copy(update={"revision": 7})
        axes = (*file.axes[:2], third.model_copy(update={"identity": sure}))
        found = refused(bus, file.model_copy(update={"axes": axes}))
    assert [each.check for each in found] == ["motor rated current (6075)", "identity (1018)"]
    assert all("nodes 2 and 3 are swapped" in each.remedy for each in found)


def test_a_rating_that_is_stated_wrongly_is_not_taken_for_a_mix_up() -> None:
    with bench(n1=2000, n2=2000, n3=2000) as bus:
        (found,) = refused(bus, drives(2.0, 3.0, 2.0))  # the other node numbers are right
    assert "correct rated_current" in found.remedy


def test_a_drive_under_another_number_than_the_file_s_is_found_by_what_it_is() -> None:
    file = drives(1.0, 2.0, 3.0)
    with bench(n1=1000, n2=2000, n3=3000) as bus:
        second = file.axes[1].model_copy(update={"node": 9})
        axes = (file.axes[0], second, file.axes[2])
        (found,) = refused(bus, file.model_copy(update={"axes": axes}))
    assert found.place == "joint 2 (node 9)"
    assert found.remedy.endswith("state node: 2, or give the drive the number 9")
