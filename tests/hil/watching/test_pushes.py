"""Alarms of several axes, and of an axis that springs back, are one push."""

from __future__ import annotations

from hil.results.watch import Alarm, pushes


def alarm(axis: int, time: float, lasted: float = 0.2) -> Alarm:
    return Alarm(axis=axis, time=time, torque=9, threshold=5, window=0.02, peak=9, lasted=lasted)


def test_alarms_that_overlap_or_follow_within_a_second_are_one_push() -> None:
    drag = alarm(2, 1.0, lasted=3.0), alarm(3, 1.1), alarm(1, 4.9)  # 0.9 s after the drag has ended
    later = alarm(2, 6.2)
    assert pushes([*drag, later]) == [list(drag), [later]]


def test_without_an_alarm_there_is_no_push() -> None:
    assert pushes([]) == []
