"""Picture of excluded causes: a dot for each cause and axis on a scale of torque."""

from __future__ import annotations

from hil.estimation.excluded.result import Excluded, Limit
from hil.report.sections.parameters import dots
from hil.show.charts.chart import Points


def limit(cause: str, axis: int, size: float | None, torque: float = 0.01) -> Limit:
    return Limit(cause=cause, axis=axis, part="", unit="", size=size, torque=torque)


def drawn(*limits: Limit) -> list[Points]:
    (panel,) = dots(Excluded(found=(), limits=limits, tests=1), 2)
    return [item for item in panel.items if isinstance(item, Points)]


def test_a_dot_stands_at_the_torque_beyond_which_the_cause_would_be_found() -> None:
    (dot,) = drawn(limit("joint offset", 1, 0.3))
    assert (list(dot.x), dot.mark) == ([0.3], "o")  # .3 degrees, each 1 % of the torque
    assert dot.label == "axis 1"


def test_a_ring_stands_for_what_never_shows_in_the_size_that_is_usual() -> None:
    (ring,) = drawn(limit("joint offset", 2, None))
    assert (list(ring.x), ring.mark) == ([0.5], "ring")  # half a degree
    assert ring.label == "invisible"


def test_what_makes_no_torque_is_not_drawn() -> None:
    assert not drawn(limit("joint offset", 1, None, torque=1e-15), limit("load", 0, None))


def test_each_cause_has_a_row_in_the_order_of_the_table() -> None:
    limits = limit("joint offset", 1, 0.3), limit("spring", 1, 0.3), limit("joint offset", 2, 0.1)
    (panel,) = dots(Excluded(found=(), limits=limits, tests=1), 2)
    assert panel.rows == {2.0: "joint offset", 1.0: "spring"}
    assert [item.label for item in drawn(*limits)] == ["axis 1", "axis 1", "axis 2"]
