"""Load that yields to gravity, unlike a rigid load."""

import numpy as np
import pytest

from sim_plant import build
from sim_plant.physics.giving_load import GivingLoad, gravity_direction
from sim_plant.plant import Plant
from sim_plant.plant_file import Payload, load_plant_file

LOAD = Payload(mass=10.0, centre=(0.0, 0.0, 0.14), Ixx=0.02, Iyy=0.02, Izz=0.04, gives=0.01)
LONG = 100.0


def plant_file(load):
    return load_plant_file("manutec-r15").model_copy(update={"payload": load})


def moment(arm):
    return arm[2][-1][1:4].copy()


@pytest.mark.parametrize("q", [np.zeros(6), np.array([0.3, -0.5, 1.0, 0.7, -1.2, 2.0])])
def test_its_centre_sags_along_gravity_as_far_as_stated(q):
    arm = build.arm(plant_file(LOAD))
    fixed = moment(arm)
    GivingLoad(arm, LOAD).settle(q, LONG)
    way = (moment(arm) - fixed) / LOAD.mass
    assert np.linalg.norm(way) == pytest.approx(0.01)
    np.testing.assert_allclose(way, 0.01 * gravity_direction(arm, q), atol=1e-12)


def test_it_follows_a_change_of_the_pose_by_and_by():
    arm = build.arm(plant_file(LOAD))
    load, q = GivingLoad(arm, LOAD), np.zeros(6)
    load.settle(q, LONG)
    before = moment(arm)
    q[4] = np.pi / 2
    load.settle(q, 0.05)
    shortly_after = moment(arm)
    load.settle(q, LONG)
    whole = np.linalg.norm(moment(arm) - before)
    assert 0.2 < np.linalg.norm(shortly_after - before) / whole < 0.8


def test_gravity_turns_with_the_last_frame():
    arm = build.arm(plant_file(LOAD))
    q = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.4])
    still, turned = gravity_direction(arm, 0 * q), gravity_direction(arm, q)
    assert turned[2] == pytest.approx(still[2])
    c, s = np.cos(0.4), np.sin(0.4)
    np.testing.assert_allclose(
        turned[:2], [c * still[0] + s * still[1], c * still[1] - s * still[0]], atol=1e-12
    )


def test_a_plant_whose_load_is_bolted_on_keeps_it_where_it_is():
    plant = Plant(plant_file(LOAD.model_copy(update={"gives": 0.0})))
    before = plant._arm[2].copy()
    plant.advance(0.1)
    np.testing.assert_array_equal(plant._arm[2], before)
    loose = Plant(plant_file(LOAD))
    loose.advance(0.1)
    assert not np.allclose(loose._arm[2][-1], before[-1])
