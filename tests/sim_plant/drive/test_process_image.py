"""Process image of all axes: drives with and without news at a SYNC."""

from __future__ import annotations

import numpy as np
import pytest

from sim_plant.drive.process_image import AxisImage, Field, FrameBlock, ProcessImage
from sim_plant.machine_protocol import Reading

N_AXES = 3
AT_REST = Reading(0, 0, 0, 0, 0, 0, 0)


def readings(*axes: Reading) -> np.ndarray:
    return np.array(axes, dtype=np.int64).ravel()


@pytest.fixture(params=["by itself", "with frames"])
def latched(request: pytest.FixtureRequest) -> tuple[ProcessImage, ProcessImage | FrameBlock]:
    """Return an image, and the function that latches readings."""
    image = ProcessImage(N_AXES)
    if request.param == "by itself":
        return image, image
    return image, FrameBlock(image, [(0x181, [Field(0, 4, -(2**31), 2**31 - 1)])])


@pytest.mark.parametrize("axes", [(), (0,), (2,), (0, 1), (0, 1, 2)])
def test_the_axes_whose_events_changed_have_news(
    latched: tuple[ProcessImage, ProcessImage | FrameBlock], axes: tuple[int, ...]
) -> None:
    shown = [AT_REST._replace(events=4 if i in axes else 0) for i in range(N_AXES)]
    assert latched[1].latch(readings(*shown)) == sum(1 << i for i in axes)


@pytest.mark.parametrize("axes", [(), (1,), (0, 2)])
def test_the_axes_outside_of_where_they_are_expected_have_news(
    latched: tuple[ProcessImage, ProcessImage | FrameBlock], axes: tuple[int, ...]
) -> None:
    image, latching = latched
    for i in range(N_AXES):
        AxisImage(image, i).expect_within(-10, 10)
    shown = [AT_REST._replace(position=11 if i in axes else 10) for i in range(N_AXES)]
    assert latching.latch(readings(*shown)) == sum(1 << i for i in axes)
    shown = [AT_REST._replace(position=-11 if i in axes else -10) for i in range(N_AXES)]
    assert latching.latch(readings(*shown)) == sum(1 << i for i in axes)


def test_what_a_drive_knows_is_no_news() -> None:
    image = ProcessImage(N_AXES)
    AxisImage(image, 1).events = 4
    shown = AT_REST, AT_REST._replace(events=4), AT_REST
    assert image.latch(readings(*shown)) == 0
