"""Position unit of object 6064 by the drive's own objects, and
refusal of a different drives file.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from stated_axis import axis, drives

from drivers.axis import AxisScale
from drivers.cia402 import objects
from drivers.commissioning.consistency import compare_positions
from drivers.commissioning.position_units import PositionFactors, position_readings
from drivers.commissioning.unit_codes import acceleration_of, position_of, velocity_of
from drivers.commissioning.verdict import Grade
from drivers.rate_units import acceleration_unit, velocity_unit

if TYPE_CHECKING:
    from drivers.drives_file import AxisDrive
    from drivers.fieldbus import Entry

TENTH_DEGREE, MILLI_DEGREE, INCREMENTS = 0xFF410000, 0xFD410000, 0x00B50000
Says = dict[tuple[int, int], int]


def factors(says: Says) -> PositionFactors:
    def read(entry: Entry) -> int | None:
        return says.get((entry.index, entry.subindex))

    return PositionFactors.read(read)


def encoder(increments: int, revolutions: int = 1) -> Says:
    return {(0x608F, 1): increments, (0x608F, 2): revolutions}


def gear(motor: int, shaft: int = 1) -> Says:
    return {(0x6091, 1): motor, (0x6091, 2): shaft}


def feed(counts: int, shaft: int = 1) -> Says:
    return {(0x6092, 1): counts, (0x6092, 2): shaft}


def unit(word: int) -> Says:
    return {(0x60A8, 0): word}


FACTORY = gear(1) | feed(1)


def readings(says: Says) -> list[str]:
    return [str(reading.per_revolution) for reading in position_readings(factors(says))]


@pytest.mark.parametrize(
    ("says", "counts"),
    [
        # 0.1 degree by feed, independent of the encoder
        (encoder(2000) | gear(1) | feed(3600), ["3600"]),
        (encoder(2000) | gear(1) | feed(3600) | unit(TENTH_DEGREE), ["3600"]),
        # 0.1 degree by 60A8 alone; feed and gear have factory values
        (encoder(2000) | FACTORY | unit(TENTH_DEGREE), ["3600"]),
        (encoder(2000) | unit(0xFDB40000), ["1000"]),
        # factory value 1/1: nothing is configured
        (encoder(4096) | FACTORY, ["4096"]),
        (encoder(4096) | FACTORY | unit(INCREMENTS), ["4096"]),
        (encoder(4096) | FACTORY | unit(0), ["4096"]),
        (encoder(4096), ["4096"]),
        (encoder(8193, 2), ["8193/2"]),
        # behind a gear
        (encoder(4096) | gear(101) | feed(360_000) | unit(MILLI_DEGREE), ["360000/101"]),
        (encoder(4096) | gear(101) | feed(1) | unit(MILLI_DEGREE), ["360000/101"]),
        (encoder(4096) | gear(105) | feed(430_080), ["4096"]),
        (encoder(4096) | gear(105) | feed(430_080) | unit(INCREMENTS), ["4096"]),
        # position factor of the older edition
        (encoder(4096) | {(0x6093, 1): 8, (0x6093, 2): 1}, ["512"]),
        # a gear without feed: position before or after the gear
        (encoder(4096) | gear(105), ["4096", "4096/105"]),
        (encoder(131_072) | gear(131_072, 10_000) | feed(1), ["131072", "10000"]),
        # missing divisor or 0: 1, or the whole ratio is meaningless
        ({(0x608F, 1): 4096}, ["4096"]),
        (encoder(4096, 0), ["4096"]),
        ({(0x6091, 1): 100} | feed(360_000), ["3600", "360000"]),
        ({(0x6092, 1): 3600}, ["3600"]),
        (encoder(4096) | feed(3600, 0), ["3600", "4096"]),
        # the drive's objects contradict each other
        (encoder(2000) | gear(1) | feed(3600) | unit(INCREMENTS), ["3600", "2000"]),
        (encoder(2000) | gear(1) | feed(2000) | unit(TENTH_DEGREE), ["2000", "3600"]),
        # no conclusion is possible
        ({}, []),
        (encoder(1) | FACTORY, []),
        (encoder(2000) | FACTORY | unit(0x00AC0000), []),
        (encoder(2000) | FACTORY | unit(0xFA010000), []),
        # no position can be controlled in units of whole revolutions
        (encoder(2000) | unit(0x00B40000), []),
        (encoder(2000) | gear(1000) | feed(360), []),
        (gear(1, 0) | feed(0) | encoder(0, 0), []),
    ],
)
def test_what_a_drive_says_leads_to_these_counts_per_motor_revolution(
    says: Says, counts: list[str]
) -> None:
    assert readings(says) == counts


def test_a_radian_is_no_ratio_and_meets_its_ten_digits_all_the_same() -> None:
    stated = one_axis(increments_per_revolution="6283.185307")
    found = compare_positions(factors(encoder(2000) | unit(0xFD100000)), stated)
    assert found.grade is Grade.OK


def one_axis(**changes: Any) -> AxisDrive:
    return drives(axis(**changes)).axes[0]


PREFIXES = st.integers(-6, 0)
UNITS = {0xB4: Fraction(1), 0x41: Fraction(360)}


@st.composite
def configurations(draw: st.DrawFn) -> tuple[Says, Fraction, Fraction]:
    """Draw objects of a drive; return increments and counts per motor revolution with them."""
    resolution = Fraction(draw(st.integers(2, 1 << 24)), draw(st.integers(1, 3)))
    motor, shaft = draw(st.integers(1, 200)), draw(st.integers(1, 30))
    says = encoder(resolution.numerator, resolution.denominator) | gear(motor, shaft)
    style = draw(st.sampled_from(["plain", "feed", "unit", "both"]))
    if style == "plain":
        says |= gear(1) | draw(st.sampled_from([{}, feed(1), unit(INCREMENTS), unit(0)]))
        return says, resolution, resolution
    power, code = draw(PREFIXES), draw(st.sampled_from(sorted(UNITS)))
    per_output = UNITS[code] / Fraction(10) ** power
    if style == "feed":
        per_output = Fraction(draw(st.integers(2, 1 << 30)), draw(st.integers(1, 7)))
        assume(per_output != 1)
    if style in {"feed", "both"}:
        says |= feed(per_output.numerator, per_output.denominator)
    if style in {"unit", "both"}:
        says |= unit((power & 0xFF) << 24 | code << 16)
    return says, resolution, per_output * shaft / motor


def can_be_stated(counts: Fraction) -> bool:
    """Return True if the drives file accepts a ratio of this many digits."""
    return max(counts.numerator, counts.denominator) < 10**12


@given(configurations(), st.integers(1, 1 << 30))
def test_the_scale_that_follows_from_a_drive_s_objects_is_that_of_its_motor(
    configuration: tuple[Says, Fraction, Fraction], turned: int
) -> None:
    says, resolution, expected = configuration
    assume(resolution > 1 and 1 < expected < 1 << 26 and can_be_stated(expected))
    (reading,) = position_readings(factors(says))
    assert reading.per_revolution == expected
    scale = AxisScale.derive(one_axis(increments_per_revolution=expected, gear_ratio=50.0, zero=0))
    count = turned / resolution * expected  # value of 6064 after this many encoder increments
    angle = 2 * math.pi * float(turned / resolution) / 50
    assert scale.position_from_counts(float(count)) == pytest.approx(angle, rel=1e-12)


@given(configurations(), st.fractions(Fraction(1, 1000), 1000, max_denominator=1000))
def test_a_file_that_differs_is_refused_with_both_numbers_and_the_objects(
    configuration: tuple[Says, Fraction, Fraction], factor: Fraction
) -> None:
    says, resolution, expected = configuration
    assume(resolution > 1 and 1 < expected * factor < 1 << 30 and 1 < expected < 1 << 30)
    assume(can_be_stated(expected) and can_be_stated(expected * factor))
    right = compare_positions(
        factors(says), one_axis(increments_per_revolution=expected, gear_ratio=1e-3)
    )
    assert right.grade is Grade.OK
    assume(factor != 1)
    wrong = one_axis(increments_per_revolution=expected * factor, gear_ratio=1e-3)
    found = compare_positions(factors(says), wrong)
    assert found.grade is Grade.REFUSED
    assert any(index in found.found for index in ("608F", "6092", "60A8"))
    assert found.stated
    assert found.stated not in found.found.split()


def test_a_drive_that_contradicts_itself_leaves_the_choice_to_the_file() -> None:
    says = factors(encoder(2000) | gear(1) | feed(3600) | unit(INCREMENTS))
    for stated, agreement in (
        (3600, Grade.WARNING),
        (2000, Grade.WARNING),
        (4096, Grade.REFUSED),
    ):
        found = compare_positions(says, one_axis(increments_per_revolution=stated))
        assert found.grade is agreement
        assert "3600 counts" in found.found
        assert "2000 counts" in found.found


@pytest.mark.parametrize("says", [encoder(4096, 0), encoder(4096) | feed(3600, 0)])
def test_a_divisor_that_is_not_stated_leaves_the_right_file_on_trust(says: Says) -> None:
    found = compare_positions(factors(says), one_axis(increments_per_revolution=4096))
    assert found.grade is Grade.WARNING
    assert ":02 is 0 or not stated, 1 is assumed" in found.found
    other = compare_positions(factors(says), one_axis(increments_per_revolution=2000))
    assert other.grade is Grade.REFUSED


def test_an_encoder_resolution_that_leads_to_no_unit_is_not_called_missing() -> None:
    found = compare_positions(factors(encoder(2000) | unit(0x00AC0000)), one_axis())
    assert found.grade is Grade.WARNING
    assert found.found == "608F = 2000, and 60A8 says 00AC0000h, an unknown unit"


@pytest.mark.parametrize(
    ("word", "name"),
    [
        (0x00B44700, "rpm"),
        (0xFFB44700, "0.1 rpm"),
        (0xFDB44700, "0.001 rpm"),
        (0x01B44700, "10 rpm"),
        (0x00B50300, "inc/s"),
        (0xFAB40300, "0.000001 rps"),
        (0xFF410300, "0.1 deg/s"),
        (0xFD100300, "0.001 rad/s"),
        (0xFD010300, "0.001 m/s"),
        (0x80B44700, None),
        (0x00AC0300, None),
        (0x00B44703, None),
    ],
)
def test_codes_of_velocity_units_are_those_that_the_file_can_state(
    word: int, name: str | None
) -> None:
    assert velocity_of(word) == name
    assert name is None or velocity_unit(name).size > 0


@pytest.mark.parametrize(
    ("word", "name"),
    [
        (0x00C00300, "rpm/s"),
        (0xFFC00300, "0.1 rpm/s"),
        (0x00B55700, "inc/s^2"),
        (0xFAB45700, "0.000001 rps/s"),
        (0x00B44703, "rpm/s"),
        (0xFF415700, "0.1 deg/s^2"),
        (0xFF410303, "0.1 deg/s^2"),
        (0xFD015700, "0.001 m/s^2"),
        (0x00C04700, None),
    ],
)
def test_codes_of_acceleration_units_are_those_that_the_file_can_state(
    word: int, name: str | None
) -> None:
    assert acceleration_of(word) == name
    assert name is None or acceleration_unit(name).size > 0


@pytest.mark.parametrize(
    ("position", "resolution", "velocity", "acceleration"),
    [
        (INCREMENTS, 2000, "inc/s", "inc/s^2"),
        (None, 2000, "inc/s", "inc/s^2"),
        (0, 2000, "inc/s", "inc/s^2"),
        (TENTH_DEGREE, 2000, "1/2000 rps", "1/2000 rps/s"),
        (TENTH_DEGREE, Fraction(8193, 2), "2/8193 rps", "2/8193 rps/s"),
        (TENTH_DEGREE, None, None, None),
        (0x00AC0000, 2000, None, None),
    ],
)
def test_increments_beside_positions_in_another_unit_are_those_of_the_encoder(
    position: int | None, resolution: Fraction | None, velocity: str, acceleration: str
) -> None:
    assert velocity_of(0x00B50300, position, resolution) == velocity
    assert acceleration_of(0x00B55700, position, resolution) == acceleration
    for name, unit_of in ((velocity, velocity_unit), (acceleration, acceleration_unit)):
        assert name is None or unit_of(name).size > 0


def test_a_power_of_ten_of_increments_of_the_encoder_is_kept() -> None:
    assert velocity_of(0xFFB50300, TENTH_DEGREE, Fraction(2000)) == "1/20000 rps"
    assert velocity_of(0x03B50300, TENTH_DEGREE, Fraction(2000)) == "1/2 rps"


def test_a_position_code_with_a_denominator_is_unknown() -> None:
    assert position_of(0xFF410000) == "0.1 deg"
    assert position_of(0xFF410300) is None


@given(
    st.sampled_from(["", "0.1 ", "0.001 ", "1/101 ", "7 "]),
    st.sampled_from(["inc/s", "rpm", "mrpm", "rps", "deg/s", "rad/s"]),
    st.fractions(2, 1 << 20, max_denominator=1000),
    st.floats(1, 300),
)
def test_a_velocity_of_one_unit_is_that_unit_at_the_joint(
    factor: str, symbol: str, counts: Fraction, gear_ratio: float
) -> None:
    stated = one_axis(
        increments_per_revolution=counts, gear_ratio=gear_ratio, velocity_unit=factor + symbol
    )
    over, _, under = (factor.strip() or "1").partition("/")
    motor = {
        "inc/s": 2 * math.pi / float(counts),
        "rpm": 2 * math.pi / 60,
        "mrpm": 2 * math.pi / 60_000,
        "rps": 2 * math.pi,
        "deg/s": math.pi / 180,
        "rad/s": 1.0,
    }[symbol]
    expected = motor * float(over) / float(under or 1) / gear_ratio
    assert AxisScale.derive(stated).velocity == pytest.approx(expected, rel=1e-12)


def test_lengths_are_those_of_the_prismatic_axis_whatever_its_spindle() -> None:
    stated = one_axis(
        joint="prismatic", gear_ratio=628.3, velocity_unit="mm/s", acceleration_unit="m/s^2"
    )
    assert AxisScale.derive(stated).velocity == pytest.approx(1e-3)
    assert AxisScale.derive(stated).acceleration == pytest.approx(1.0)


def test_every_object_that_decides_is_asked_for() -> None:
    asked: list[Entry] = []
    PositionFactors.read(asked.append)  # type: ignore[func-returns-value]
    assert {entry.index for entry in asked} >= {0x608F, 0x6091, 0x6092, 0x6093, 0x60A8}
    assert objects.FEED in asked
