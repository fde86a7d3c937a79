"""Charts: positions of values, marks along axes, and attributes of SVG elements."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.show.charts.chart import Chart, Line, Panel, Points, Rule
from hil.show.charts.svg import Scale, file, panels

POINTS = Points([0.0, 1.0], [2.0, 3.0], label="measured <&>", error=[0.1, 0.1], ids=["g01", "g02"])


@pytest.mark.parametrize(
    ("low", "high", "written"),
    [
        (-0.09, 0.09, ["−0.05", "0.00", "0.05"]),
        (0.0, 10.0, ["0", "5", "10"]),
        (47.9, 52.2, ["48", "50", "52"]),
    ],
)
def test_marks_are_round_values_within_the_range(low: float, high: float, written: str) -> None:
    assert list(Scale(low, high, 0.0, 100.0).marks(3).values()) == written


@given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e6), st.integers(2, 12))
def test_there_are_never_more_marks_than_there_is_room_for(
    low: float, width: float, most: int
) -> None:
    marks = Scale(low, low + width, 0.0, 1.0).marks(most)
    assert len(marks) <= most
    slack = 1e-6 * width + 1e-9 * abs(low)
    assert all(low - slack <= value <= low + width + slack for value in marks)


def test_decades_are_marked_by_powers_and_by_fives_where_they_are_few() -> None:
    assert list(Scale(0.02, 1.0, 0.0, 1.0, decades=True).marks(5).values()) == ["0.1", "1"]
    assert list(Scale(0.1, 1.0, 0.0, 1.0, decades=True).marks(5).values()) == [
        "0.1", "0.2", "0.5", "1",
    ]  # fmt: skip


def test_a_value_stands_by_its_share_of_the_range() -> None:
    np.testing.assert_allclose(Scale(-1.0, 1.0, 10.0, 30.0).place([-1.0, 0.0, 1.0]), [10, 20, 30])
    np.testing.assert_allclose(Scale(1.0, 100.0, 0.0, 2.0, decades=True).place([10.0]), [1.0])


def test_points_carry_the_ids_of_their_measurements() -> None:
    chart = Chart((Panel((POINTS,), x_label="time [s]"),))
    (panel,) = panels(chart)
    assert re.findall(r'data-m="([^"]+)"', panel) == ["g01", "g02"]
    assert chart.ids == {"g01", "g02"}


def test_a_line_is_interrupted_where_there_is_no_number() -> None:
    (panel,) = panels(Chart((Panel((Line([0, 1, 2, 3, 4], [0, 1, np.nan, 1, 0]),)),)))
    (line,) = re.findall(r'class="model"[^>]* d="([^"]+)"', panel)
    assert (line.count("M"), line.count("L")) == (2, 2)


def test_a_file_is_a_whole_picture_of_escaped_text_with_its_legend() -> None:
    strip = Panel((Rule(0.0),), y_label="Δ", height=40.0)
    text = file(Chart((Panel((POINTS,), title="$g_{1}$ <b>", below=strip),)))
    root = ElementTree.fromstring(text)  # noqa: S314 - our own
    words = ["".join(each.itertext()) for each in root.iter("{http://www.w3.org/2000/svg}text")]
    assert "measured <&>" in words
    assert any(each.startswith("g1") and each.endswith(" <b>") for each in words)


@pytest.mark.parametrize("values", [[], [np.nan], [5.0], [0.0]])
def test_nothing_one_value_and_no_number_are_drawn(values: list[float]) -> None:
    (panel,) = panels(Chart((Panel((Points(values, values),)),)))
    assert "inf" not in panel
