"""Feed-forward of the plant's drives: the master's offsets, and the velocity of their demand."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from sim_plant.physics import servo
from sim_plant.physics import state as st
from sim_plant.plant import load_plant

if TYPE_CHECKING:
    from desk import Desk
    from ideal_machine import IdealMachine

HALT = 0x10F


def fed(ideal_machine: IdealMachine) -> list[tuple[object, ...]]:
    """Return the drive's feed-forward to its loops, in order."""
    return [call[1:] for call in ideal_machine.axes[0].calls if call[0] == "feed forward"]


def test_offsets_count_in_cyclic_synchronous_position_alone(
    desk: Desk, ideal_machine: IdealMachine
) -> None:
    desk.enable()
    desk.write(0x60B1, -5000)
    desk.write(0x60B2, 120)
    assert fed(ideal_machine) == []
    desk.write(0x6060, 8)
    assert fed(ideal_machine) == [(-5000, 120)]
    desk.write(0x6060, 1)
    assert fed(ideal_machine)[-1] == (0, 0)


def test_offsets_come_by_process_data_and_count_until_the_next(
    desk: Desk, ideal_machine: IdealMachine
) -> None:
    desk.map_rpdo(255, 0x60B10020, 0x60B20010, number=1)
    desk.nmt(1)
    desk.write(0x6060, 8)
    desk.enable()
    for data, offsets in ((b"\x10\x00\x00\x00\xff\xff", (16, -1)), (bytes(6), (0, 0))):
        desk.send(0x301, data)
        assert fed(ideal_machine)[-1] == offsets


@pytest.mark.parametrize("leave", ["quick stop", "power off"])
def test_a_drive_that_leaves_operation_forgets_them_and_a_halt_does_not(
    leave: str, desk: Desk, ideal_machine: IdealMachine
) -> None:
    desk.write(0x6060, 8)
    desk.enable()
    desk.write(0x60B2, 120)
    desk.write(0x6040, HALT)
    assert fed(ideal_machine)[-1] == (0, 120)
    desk.write(0x6040, {"quick stop": 0x02, "power off": 0x00}[leave])
    assert fed(ideal_machine)[-1] == (0, 0)


def test_how_much_a_drive_feeds_forward_by_itself_is_2010h(
    desk: Desk, ideal_machine: IdealMachine
) -> None:
    assert desk.read(0x2010) == 1000
    for per_mille, withheld in ((250, 0.75), (0, 1.0), (1000, 0.0)):
        desk.write(0x2010, per_mille)
        assert ideal_machine.axes[0].calls[-1] == ("withhold", withheld)


def loops(**profile: float) -> tuple[float, float]:
    """Return the torque commanded by the loops of axis 3 at rest, and its limit [N m]."""
    plant = load_plant("manutec-r15")
    plant.state[2, st.ENABLED] = 1.0
    plant.state[2, st.TORQUE_LIMIT] = 540.0
    for column, value in profile.items():
        plant.profile[2, getattr(st, column)] = value
    return float(servo.command(plant.const, plant.state, plant.profile, 2, 0.0)), 540.0


def test_a_torque_offset_adds_to_the_torque_command_and_the_limit_holds_for_both() -> None:
    rest, limit = loops()
    assert loops(TORQUE_OFFSET=100.0)[0] == pytest.approx(rest + 100.0)
    assert loops(TORQUE_OFFSET=2 * limit)[0] == limit
    assert loops(TORQUE_OFFSET=-2 * limit)[0] == -limit


def test_a_velocity_offset_takes_the_place_of_what_the_drive_withholds() -> None:
    by_itself = loops(DEMAND_V=0.3)[0]
    assert loops(DEMAND_V=0.3, WITHHELD=1.0, VELOCITY_OFFSET=0.3)[0] == pytest.approx(by_itself)
    assert loops(DEMAND_V=0.3, WITHHELD=1.0)[0] == pytest.approx(loops()[0])


def test_the_motor_s_direction_is_that_of_the_offsets() -> None:
    plant = load_plant("manutec-r15")
    plant.axes[2].feed_forward(1000.0, 10.0)
    scale = plant.const[2, st.COUNTS_PER_RAD]
    assert scale < 0
    assert plant.profile[2, st.VELOCITY_OFFSET] == pytest.approx(1000.0 / scale)
    assert np.sign(plant.profile[2, st.TORQUE_OFFSET]) == -1
