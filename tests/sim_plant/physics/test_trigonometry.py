"""The plant's own elementary functions against the C library's."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from sim_plant.physics.trigonometry import arc_tangent, sin_cos


@given(st.floats(-1e5, 1e5))
def test_sine_and_cosine_are_good_to_rounding(angle: float) -> None:
    sine, cosine = sin_cos(angle)
    assert abs(sine - math.sin(angle)) <= 3e-16
    assert abs(cosine - math.cos(angle)) <= 3e-16


@given(st.floats(0.0, 1e12))
def test_arc_tangent_is_good_to_rounding(x: float) -> None:
    assert math.isclose(arc_tangent(x), math.atan(x), rel_tol=1e-15)
