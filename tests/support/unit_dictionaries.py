"""Fictitious drives in factory configuration, as regards units and ratings.

Each drive represents a habit of makers: positions in parts of a degree, no encoder resolution, all
factors 1, a rated torque in uN m.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from data_sheets import Place

Objects = dict[tuple[int, int], tuple[str, int] | None]


def words(**values: int) -> Objects:
    """Return objects of 32 bits: ``x608F_1=2000``, ``x60A8=0xFF410000``."""
    places = {tuple(key[1:].split("_")): value for key, value in values.items()}
    return {
        (int(place[0], 16), int(place[1]) if len(place) > 1 else 0): ("u32", value)
        for place, value in places.items()
    }


@dataclass(frozen=True)
class Habit:
    """Objects of a drive, and what draft and check must make of them.

    `drafted` are values of the draft (None: to be stated by the user), `right` is a correct file,
    `wrong` are pairs of a wrong statement and words of its refusal, and `trusted` are the keys that
    `hil drives check` warns about.
    """

    objects: Objects
    drafted: dict[str, Any]
    right: dict[str, Any]
    wrong: list[tuple[dict[str, Any], str]]
    trusted: set[str] = field(default_factory=set)


FACTORY = words(x6091_1=1, x6091_2=1, x6092_1=1, x6092_2=1)
TENTH_DEGREES = {"increments_per_revolution": 3600}

HABITS = {
    "tenths of a degree by feed": Habit(
        words(x608F_1=2000, x608F_2=1, x6091_1=1, x6091_2=1, x6092_1=3600, x6092_2=1)
        | words(x60A9=0x00B44700),
        {"increments_per_revolution": "3600", "velocity_unit": "rpm", "acceleration_unit": None},
        TENTH_DEGREES | {"velocity_unit": "rpm", "acceleration_unit": "rpm/s"},
        [
            ({"increments_per_revolution": 2000}, "3600 counts per motor revolution (feed 6092"),
            ({"increments_per_revolution": 3601}, "states increments_per_revolution: 3601"),
            ({"velocity_unit": "0.1 rpm"}, "(60A9) is rpm (00B44700h), the drives file"),
        ],
    ),
    "tenths of a degree by 60A8": Habit(
        words(x608F_1=2000, x608F_2=1, x60A8=0xFF410000, x60A9=0xFF410300, x60AA=0xFF415700)
        | FACTORY,
        {
            "increments_per_revolution": "3600",
            "velocity_unit": "inc/s",
            "acceleration_unit": "inc/s^2",
        },
        # 0.1 degree is the position unit, so 0.1 deg/s is equivalent
        TENTH_DEGREES | {"velocity_unit": "inc/s", "acceleration_unit": "0.1 deg/s^2"},
        [
            ({"increments_per_revolution": 2000}, "(60A8 says 0.1 deg), the drives file states"),
            ({"acceleration_unit": "rpm/s"}, "(60AA) is inc/s^2 (FF415700h), the drives file"),
        ],
    ),
    "no encoder resolution, rpm": Habit(
        {(0x6075, 0): None, (0x6076, 0): None},
        {"increments_per_revolution": None, "velocity_unit": None, "rated_current": None},
        {"increments_per_revolution": 2000, "velocity_unit": "rpm", "acceleration_unit": "rpm/s"},
        [],
        {"increments_per_revolution", "rated_current", "rated_torque"},
    ),
    "everything 1 as the factory set it": Habit(
        words(x608F_1=1, x608F_2=1, x6090_1=1, x6090_2=1) | FACTORY,
        {"increments_per_revolution": None, "velocity_unit": None, "acceleration_unit": None},
        {"increments_per_revolution": 16_384},
        [],
        {"increments_per_revolution"},
    ),
    "factors of 1 behind an encoder": Habit(
        words(x608F_1=4096, x608F_2=1) | FACTORY,
        {"increments_per_revolution": "4096"},
        {"increments_per_revolution": 4096},
        [({"increments_per_revolution": 1}, "4096 counts per motor revolution (608F = 4096")],
    ),
    "an electronic gear and no feed": Habit(
        words(x608F_1=131_072, x608F_2=1, x6091_1=131_072, x6091_2=10_000),
        {"increments_per_revolution": None},
        {"increments_per_revolution": 10_000},
        [({"increments_per_revolution": 4096}, "131072 counts per motor revolution (608F = 131")],
        {"increments_per_revolution"},
    ),
    "factors of the older edition": Habit(
        words(x608F_1=4096, x608F_2=1, x6093_1=8, x6093_2=1, x6096_1=4096, x6096_2=60)
        | words(x6097_1=1, x6097_2=1),
        {"increments_per_revolution": "512", "velocity_unit": None},
        {"increments_per_revolution": 512, "velocity_unit": "rpm"},
        [({"increments_per_revolution": 4096}, "512 counts per motor revolution (608F = 4096 ov")],
        {"velocity_unit"},
    ),
    "milliradians": Habit(
        words(x608F_1=4096, x608F_2=1, x60A8=0xFD100000, x60A9=0xFD100300) | FACTORY,
        {"increments_per_revolution": "6283.185307", "velocity_unit": "inc/s"},
        {"increments_per_revolution": "6283.185307", "velocity_unit": "0.001 rad/s"},
        [({"increments_per_revolution": 4096}, "60A8 says 0.001 rad")],
    ),
    "millidegrees behind a gear": Habit(
        words(x608F_1=4096, x608F_2=1, x6091_1=100, x6091_2=1, x6092_1=360_000, x6092_2=1)
        | words(x60A8=0xFD410000, x60A9=0x00B44700),
        {"increments_per_revolution": "3600", "velocity_unit": None},
        {"increments_per_revolution": 3600, "velocity_unit": "100 rpm"},
        [
            ({"increments_per_revolution": 360_000}, "(feed 6092 = 360000 over gear 6091 = 100"),
            ({"velocity_unit": "0.1 rpm"}, "SI unit velocity (60A9) is rpm"),
        ],
        {"velocity_unit"},
    ),
    "units that nobody knows": Habit(
        words(x608F_1=2000, x608F_2=1, x60A8=0x00AC0000, x60A9=0x00AC0300) | FACTORY,
        {"increments_per_revolution": None, "velocity_unit": None},
        {"increments_per_revolution": 12_800},
        [],
        {"increments_per_revolution", "velocity_unit"},
    ),
    "an encoder without revolutions": Habit(
        words(x608F_1=4096) | {(0x608F, 2): None},
        {"increments_per_revolution": None},
        {"increments_per_revolution": 4096},
        [({"increments_per_revolution": 2000}, "608F:02 is 0 or not stated, 1 is assumed")],
        {"increments_per_revolution"},
    ),
    "a gear of 0 shaft revolutions": Habit(
        words(x6091_1=100, x6091_2=0, x6092_1=360_000, x6092_2=1) | {(0x608F, 1): None},
        {"increments_per_revolution": None},
        {"increments_per_revolution": 3600},
        [({"increments_per_revolution": 36_000}, "3600 counts per motor revolution (feed 6092")],
        {"increments_per_revolution"},
    ),
    "a feed without shaft revolutions": Habit(
        words(x608F_1=4096, x608F_2=1, x6092_1=3600),
        {"increments_per_revolution": None},
        {"increments_per_revolution": 3600},
        [({"increments_per_revolution": 2000}, "4096 counts per motor revolution (608F = 4096")],
        {"increments_per_revolution"},
    ),
    "increments of the encoder beside tenths of a degree": Habit(
        words(x608F_1=2000, x608F_2=1, x60A8=0xFF410000, x60A9=0x00B50300, x60AA=0x00B55700),
        {
            "increments_per_revolution": "3600",
            "velocity_unit": "1/2000 rps",
            "acceleration_unit": "1/2000 rps/s",
        },
        TENTH_DEGREES | {"velocity_unit": "1/2000 rps", "acceleration_unit": "1/2000 rps/s"},
        [
            ({"velocity_unit": "inc/s"}, "(60A9) is 1/2000 rps (00B50300h), the drives file"),
            ({"acceleration_unit": "inc/s^2"}, "(60AA) is 1/2000 rps/s (00B55700h), the drives"),
        ],
    ),
    "increments of an encoder that is not stated": Habit(
        words(x60A8=0xFF410000, x60A9=0x00B50300) | {(0x608F, 1): None},
        {"increments_per_revolution": "3600", "velocity_unit": None},
        TENTH_DEGREES | {"velocity_unit": "1/2000 rps"},
        [],
        {"velocity_unit"},
    ),
    "a drive that contradicts itself": Habit(
        words(x608F_1=2000, x608F_2=1, x6092_1=3600, x6092_2=1, x60A8=0x00B50000),
        {"increments_per_revolution": None},
        {"increments_per_revolution": 3600},
        [({"increments_per_revolution": 4096}, "2000 counts per motor revolution (608F = 2000")],
        {"increments_per_revolution"},
    ),
    "rated torque in uN m": Habit(
        words(x1018_1=0xFB, x3001_1=2000, x3001_5=513_000, x6076=1_026_000, x60AA=0x00C00300)
        | {(0x6075, 0): None, (0x3158, 2): ("u16", 50)},
        {
            "rated_current": "2",
            "rated_torque": "1.026",
            "rated_torque_unit": "uN m",
            "torque_constant": "0.513",
            "acceleration_unit": "rpm/s",
        },
        {
            "identity": {"vendor": 0xFB, "product": 0x402},
            "rated_torque": 1.026,
            "rated_torque_unit": "uN m",
            "torque_constant": 0.513,
            "velocity_unit": "rpm",
            "acceleration_unit": "rpm/s",
        },
        [
            ({"rated_torque": 1.1}, "motor rated torque (6076) is 1.026 N m, the drives file"),
            (
                {"rated_torque": 1026, "rated_torque_unit": "mN m"},
                "rated torque against rated current is 1.026 N m",
            ),
            ({"rated_torque_unit": "mN m"}, "state rated_torque_unit: uN m if the drive's manual"),
            ({"rated_current": 4.0}, "nominal current (3001) is 2 A, the drives file states"),
            ({"torque_constant": 5.13}, "torque constant (3001:05) is 0.513 N m/A"),
            ({"acceleration_unit": "inc/s^2"}, "SI unit acceleration (60AA) is rpm/s"),
        ],
        {"increments_per_revolution"},
    ),
}


def make_sheet(objects: Objects) -> dict[Place, dict[str, object] | None]:
    """Return objects as the content of a configuration file (DCF)."""
    codes = {"u16": 6, "u32": 7}
    return {
        place: value and {"DataType": codes[value[0]], "ParameterValue": value[1]}
        for place, value in objects.items()
    }
