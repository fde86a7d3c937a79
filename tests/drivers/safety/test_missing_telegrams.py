"""Missing process data: a gap is filled, ten SYNCs in a row end the session."""

from __future__ import annotations

import pytest
from fake_fieldbus import axes_of
from local_bench import drives_file

from drivers.drive_bus import DriveError, SampleFlag
from drivers.safety.trips import MissingTelegrams

HERE, GONE = 0, int(SampleFlag.MISSING)
ALL_HERE, SECOND_GONE = (HERE, HERE, HERE), (HERE, GONE, HERE)


class Watched:
    """Counter over three axes, and number of collections of late telegrams."""

    def __init__(self) -> None:
        self.collected = 0
        self.telegrams = MissingTelegrams(
            axes_of(drives_file().axes),
            self._collect,
            0.004,
            silence="no TPDO for {} SYNCs in a row",
            wiring="",
            doubling="two telegrams for each of {} SYNCs in a row; give each node its own",
        )

    def _collect(self) -> None:
        self.collected += 1

    def look(self, *samples: tuple[int, ...]) -> list[DriveError]:
        """Count the flags of samples; return the resulting messages."""
        shown = [self.telegrams.look(flags, {}) for flags in samples]
        return [error for error in shown if error is not None]


def test_with_the_tenth_sync_in_a_row_an_axis_is_silent() -> None:
    watched = Watched()
    assert watched.look(*[SECOND_GONE] * 9) == []
    (error,) = watched.look(SECOND_GONE)
    assert str(error).startswith("axis 2: no TPDO for 10 SYNCs in a row;")


def test_one_telegram_in_between_begins_the_count_anew() -> None:
    watched = Watched()
    assert watched.look(*[SECOND_GONE] * 9, ALL_HERE, *[SECOND_GONE] * 9) == []


def test_gaps_of_different_axes_do_not_add_up() -> None:
    watched = Watched()
    assert watched.look(*[SECOND_GONE, (GONE, HERE, HERE)] * 9) == []


def test_all_axes_that_are_silent_are_named() -> None:
    watched = Watched()
    (error,) = watched.look(*[(GONE, HERE, GONE)] * 10)
    assert str(error).startswith("axis 1, axis 3: no TPDO")


def test_late_telegrams_are_collected_after_a_gap_and_only_then() -> None:
    watched = Watched()
    seen = []
    for flags in (ALL_HERE, SECOND_GONE, ALL_HERE):
        watched.look(flags)
        seen.append((watched.telegrams.open, watched.collected))
    assert seen == [(False, 0), (True, 1), (False, 1)]


@pytest.mark.parametrize(
    "flag",
    sorted(set(SampleFlag) - {SampleFlag.MISSING, SampleFlag.DOUBLED}),
    ids=lambda flag: flag.name,
)
def test_a_telegram_with_another_flag_is_not_missing(flag: SampleFlag) -> None:
    watched = Watched()
    assert watched.look(*[(HERE, int(flag), HERE)] * 20) == []
    assert watched.collected == 0


def test_ten_doubled_telegrams_in_a_row_are_two_nodes_of_one_number() -> None:
    watched, doubled = Watched(), (HERE, int(SampleFlag.DOUBLED), HERE)
    assert watched.look(*[doubled] * 9, ALL_HERE, *[doubled] * 9) == []
    (error,) = watched.look(doubled)
    assert str(error).startswith("axis 2: two telegrams for each of 10 SYNCs in a row;")
    assert watched.collected == 0
