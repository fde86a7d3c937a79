"""Drive personalities: the same campaign on each, or a reason for refusal.

The plant of the campaign has no drift and no ripple, and sensor noise of some 1.5 counts (per mille
of rated current). So two drives differ only in how they round: a reading is off by at most half a
count, so two readings of the same torque by one count. No torque that the identified models predict
may differ by more; averaged over thousands of samples it differs by far less. A count is 0.03 % of
the peak torque of joint 1.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import can
import numpy as np
import pytest
import yaml
from canopen_drive_bus import CanopenDriveBus
from personalities import FIT, UNFIT, drives_for, plant_file

from drivers.drive_bus import DriveRefused
from hil.estimation.identify import estimate
from hil.measuring.campaign import limited
from hil.measuring.sequencer import Recorded, measure
from hil.model.dynamics import inverse_dynamics
from hil.planning.design.by_counts import design
from sim_plant.switch_on import load_machine

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from hil.estimation.estimate import Estimate
    from hil.model.robot import Robot
    from hil.planning.measurement import Measurement
    from hil.runs.recording import Recording

    Recorded_ = list[tuple[Measurement, Recording]]

COUNTS = {"gravity": 3, "inertia": 14, "coupling": 1}
"""Smallest numbers of measurements that identify the 14 base parameters."""
CYCLES = {"gravity": 2, "inertia": 5, "coupling": 2}
"""Cycles of each element: with 2 of inertia, noise alone makes two drives differ by a count."""
ALIKE = (
    "event-rpdo",
    "event-tpdo",
    "fixed-identifiers",
    "fixed-pair",
    "life-guarding",
    "moved-emergency",
    "other-order",
    "sizeless",
    "sync-counter",
    "two-entries",
    "wide-range",
)
"""Personalities that differ from a plain drive in communication alone, so parameters are equal."""
CLEAN = {"drift": False, "symmetric": True, "noise": {"torque": 5e-4, "ripple": 0.0}}


@pytest.fixture(scope="module")
def campaign(
    manutec: Robot, tmp_path_factory: pytest.TempPathFactory
) -> Callable[[str], Recorded_]:
    """Run the short campaign on drives of a personality, once each."""
    folder = tmp_path_factory.mktemp("plants")
    plan = design(manutec, COUNTS)
    quick = tuple(m.model_copy(update={"cycles": CYCLES[m.kind]}) for m in plan.measurements)
    plan = plan.model_copy(update={"travel": 0.9, "measurements": quick})
    runs: dict[str, Recorded_] = {}

    def run(name: str) -> Recorded_:
        if name not in runs:
            with bus_of(folder, name) as bus, CanopenDriveBus(bus, drives_for(name)) as drive_bus:
                robot = limited(manutec, drive_bus.axes)
                events = [e for e in measure(plan, robot, drive_bus) if isinstance(e, Recorded)]
            assert [f for event in events for f in event.findings] == []
            runs[name] = [(event.measurement, event.recording) for event in events]
        return runs[name]

    return run


@pytest.fixture(scope="module")
def plain(campaign: Callable[[str], Recorded_], manutec: Robot) -> Estimate:
    return estimate(manutec, campaign("plain"))


def bus_of(folder: Path, name: str) -> can.BusABC:
    channel = plant_file(folder, name, **CLEAN)
    return can.Bus(channel, "sim_plant", ignore_config=True)


def counts() -> np.ndarray:
    """Return joint torque of a per mille of rated current [N m]."""
    return np.array([
        axis.gear_ratio * axis.torque_constant * axis.rated_current / 1000
        for axis in drives_for("plain").axes
    ])  # fmt: skip


def predicted(robot: Robot, p: np.ndarray) -> np.ndarray:
    """Return torques at random configurations with accelerations as in the campaign [N m]."""
    rng = np.random.default_rng(1)
    q = rng.uniform(robot.q_min, robot.q_max, (300, 6))
    qdd = rng.uniform(-0.4, 0.4, (300, 6)) * robot.acceleration_limit
    return inverse_dynamics(robot, p, q, np.zeros_like(q), qdd)


@pytest.mark.long
@pytest.mark.parametrize("name", [name for name in FIT if name not in ALIKE])
def test_the_same_campaign_gives_the_same_parameters_on_every_personality(
    name: str, campaign: Callable[[str], Recorded_], plain: Estimate, manutec: Robot
) -> None:
    found = estimate(manutec, campaign(name))
    difference = predicted(manutec, found.values) - predicted(manutec, plain.values)
    assert np.all(np.abs(difference).max(axis=0) < counts())


@pytest.mark.long
@pytest.mark.parametrize("name", ALIKE)
def test_drives_that_differ_in_communication_alone_give_the_same_samples(
    name: str, campaign: Callable[[str], Recorded_]
) -> None:
    for (_, one), (_, other) in zip(campaign("plain"), campaign(name), strict=True):
        assert np.array_equal(one.time, other.time)
        assert np.array_equal(one.q, other.q)
        assert np.array_equal(one.tau, other.tau)


@pytest.mark.long
def test_drives_that_differ_in_the_unit_of_current_differ_by_rounding_alone(
    campaign: Callable[[str], Recorded_],
) -> None:
    milliampere = counts() / [1000 * axis.rated_current / 1000 for axis in drives_for("plain").axes]
    most = 0.5 * (counts() + milliampere)
    for (_, one), (_, other) in zip(campaign("plain"), campaign("milliampere"), strict=True):
        assert np.array_equal(one.q, other.q)
        assert np.all(np.abs(one.tau - other.tau) <= most * (1 + 1e-9))


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("no-current", ["6078:00", "torques cannot be measured without it", "drives file"]),
        ("no-watchdog", ["1016:01", "keeps moving after a crash", "allow_no_heartbeat"]),
        ("wrong-pdos", ["1A00:02", "is fixed at 60610008h, 60640020h is needed"]),
    ],
)
def test_drives_that_cannot_serve_are_refused_with_the_reason(
    name: str, words: list[str], tmp_path: Path
) -> None:
    assert name in UNFIT
    with bus_of(tmp_path, name) as bus, pytest.raises(DriveRefused) as caught:
        CanopenDriveBus(bus, drives_for(name)).__enter__()
    assert all(word in str(caught.value) for word in words)
    assert "joint 6 (node 6)" in str(caught.value)


def notes(folder: Path, name: str) -> list[str]:
    """Return the driver's notes about the first axis on entering; the axes rest and are switched
    off.
    """
    with bus_of(folder, name) as bus, CanopenDriveBus(bus, drives_for(name)) as drive_bus:
        assert drive_bus.sample().reached
    return [note for note in drive_bus.notes if note.startswith("joint 1 ")]


@pytest.mark.parametrize(
    ("name", "noted"),
    [
        ("plain", []),
        ("fixed-pdos", []),
        ("milliampere", []),
        ("slow", ["6 instead of 2 in object 605A:00"]),
        ("int32-current", ["0 instead of 50 in object 6066:00", "no object 6075:00"]),
        ("tenth-rpm", ["no object 6084:00", "no object 6085:00", "no object 6065:00"]),
        ("sizeless", []),
        ("other-order", ["state tpdos: [[0x60780010, 0x60640020, 0x60410010]] in the drives file"]),
        ("fixed-pair", ["[[0x60610008, 0x60640020, 0x60410010], [0x60770010, 0x60780010]]"]),
        ("moved-emergency", []),
        ("two-entries", ["state tpdos: [[0x60410010, 0x60640020], [0x60780010]]"]),
        (
            "event-tpdo",
            ["TPDO 2 cannot be switched off: still sent under 281h on event"],
        ),
        ("wide-range", ["(607D) are fixed at [-29219, 29219] rad, those of the drives file are"]),
        ("sync-counter", []),
        ("held-acknowledge", []),
        (
            "life-guarding",
            ["no heartbeats both ways", "node guarding is used", "after 0.5 s without"],
        ),
        ("rounding", ["128 instead of 100 in object 1017:00", "(2.9999 rad/s instead of 3 rad/s)"]),
        ("clipping", ["2500 instead of 3422 in object 6065:00", "(0.036523 rad instead of 0.0"]),
    ],
)
def test_what_a_drive_keeps_or_lacks_is_noted(name: str, noted: list[str], tmp_path: Path) -> None:
    found = notes(tmp_path, name)
    assert bool(found) == bool(noted)
    assert all(any(words in note for note in found) for words in noted)


def test_a_velocity_unit_that_the_drive_contradicts_is_refused(tmp_path: Path) -> None:
    drives = drives_for("tenth-rpm", velocity_unit="rpm")
    with (
        bus_of(tmp_path, "tenth-rpm") as bus,
        pytest.raises(
            DriveRefused, match=r"\(60A9\) is 0.1 rpm \(FFB44700h\), the drives file states .*rpm"
        ),
    ):
        CanopenDriveBus(bus, drives).__enter__()


def test_a_mode_that_cannot_be_changed_while_halted_is_taken_all_the_same(tmp_path: Path) -> None:
    halt = can.Message(
        arbitration_id=0x601, data=b"\x2b\x40\x60\x00\x00\x01\x00\x00", is_extended_id=False
    )
    with bus_of(tmp_path, "slow") as bus:
        bus.send(halt)
        with CanopenDriveBus(bus, drives_for("slow")) as drive_bus:
            assert drive_bus.sample().reached


def test_axes_of_one_plant_may_have_different_personalities(tmp_path: Path) -> None:
    path = plant_file(tmp_path, "plain", **CLEAN)
    data = yaml.safe_load((tmp_path / "plain.yaml").read_text())
    data["axes"][1]["drive"]["personality"] = "milliampere"
    (tmp_path / "plain.yaml").write_text(yaml.safe_dump(data))
    mixed = drives_for("plain").axes[:1] + drives_for("milliampere").axes[1:2]
    drives = drives_for("plain").model_copy(update={"axes": mixed + drives_for("plain").axes[2:]})
    with (
        can.Bus(path, "sim_plant", ignore_config=True) as bus,
        CanopenDriveBus(bus, drives) as drive_bus,
    ):
        assert drive_bus.sample().reached
        assert [drive.personality.name for drive in load_machine(path).drives[:2]] == [
            "plain",
            "milliampere",
        ]


@pytest.mark.parametrize(
    ("index", "default", "words"),
    [(0x6007, 0, "6007:00"), (0x605A, 0, "605A:00"), (0x607F, 0x7FFFFFFF, "607F:00")],
)
def test_a_fixed_value_that_is_not_safe_is_refused(
    index: int, default: int, words: str, tmp_path: Path
) -> None:
    personality = tmp_path / "stubborn.yaml"
    change = {"index": index, "access": "ro", "default": default}
    personality.write_text(yaml.safe_dump({"name": "stubborn", "objects": [change]}))
    channel = plant_file(tmp_path, "plain", **CLEAN)
    plant = yaml.safe_load((tmp_path / "plain.yaml").read_text())
    plant["axes"][3]["drive"]["personality"] = "stubborn.yaml"
    (tmp_path / "plain.yaml").write_text(yaml.safe_dump(plant))
    with (
        can.Bus(channel, "sim_plant", ignore_config=True) as bus,
        pytest.raises(DriveRefused, match=rf"^joint 4 .*{words}.*commissioning tool$"),
    ):
        CanopenDriveBus(bus, drives_for("plain")).__enter__()
