"""Small data sheets (EDS, DCF) of fictitious drives, with the habits of real ones."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

CODES = {"i8": 2, "i16": 3, "i32": 4, "u8": 5, "u16": 6, "u32": 7, "f32": 8, "text": 9}

Place = tuple[int, int]
Spec = dict[str, object]


def _var(kind: str, access: str = "rw", mappable: int = 0, **more: object) -> Spec:
    return {
        "DataType": f"0x{CODES[kind]:04X}",
        "AccessType": access,
        "PDOMapping": mappable,
        **more,
    }


OBJECTS: dict[Place, Spec] = {
    (0x1000, 0): _var("u32", "ro", DefaultValue="0x00020192"),
    (0x1006, 0): _var("u32"),
    (0x1016, 1): _var("u32"),
    (0x1017, 0): _var("u16"),
    (0x1018, 1): _var("u32", "ro", DefaultValue="0x4D2"),
    (0x1018, 2): _var("u32", "ro", DefaultValue="0x402"),
    (0x1400, 1): _var("u32", DefaultValue="$NODEID+0x200"),
    (0x1401, 2): _var("u8"),
    (0x1600, 0): _var("u8", HighLimit=8),
    **{(0x1600, sub): _var("u32") for sub in range(1, 9)},
    (0x1800, 1): _var("u32", DefaultValue="$NODEID+0x180"),
    (0x1A00, 0): _var("u8", HighLimit=8),
    **{(0x1A00, sub): _var("u32") for sub in range(1, 9)},
    (0x1801, 1): _var("u32", DefaultValue="$NODEID+0x280"),
    (0x1A01, 0): _var("u8", HighLimit=8),
    **{(0x1A01, sub): _var("u32") for sub in range(1, 9)},
    (0x6007, 0): _var("i16"),
    (0x603F, 0): _var("u16", "ro"),
    (0x6040, 0): _var("u16", "rww", 1),
    (0x6041, 0): _var("u16", "ro", 1),
    (0x605A, 0): _var("i16"),
    (0x605D, 0): _var("i16"),
    (0x6060, 0): _var("i8"),
    (0x6061, 0): _var("i8", "ro"),
    (0x6064, 0): _var("i32", "ro", 1),
    (0x6065, 0): _var("u32"),
    (0x6066, 0): _var("u16"),
    (0x6067, 0): _var("u32"),
    (0x6068, 0): _var("u16"),
    (0x6072, 0): _var("u16"),
    (0x6075, 0): _var("u32", DefaultValue=5000),
    (0x6076, 0): _var("u32"),
    (0x6078, 0): _var("i16", "ro", 1, ParameterName="Current actual value"),
    (0x607A, 0): _var("i32", "rww", 1),
    (0x607D, 1): _var("i32"),
    (0x607D, 2): _var("i32"),
    (0x607F, 0): _var("u32"),
    (0x6080, 0): _var("u32"),
    (0x6081, 0): _var("u32"),
    (0x6083, 0): _var("u32"),
    (0x6084, 0): _var("u32"),
    (0x6085, 0): _var("u32"),
    (0x6086, 0): _var("i16"),
    (0x60C5, 0): _var("u32"),
    (0x60C6, 0): _var("u32"),
    (0x608F, 1): _var("u32", DefaultValue=1),
    (0x608F, 2): _var("u32", DefaultValue=1),
    (0x6502, 0): _var("u32", "ro", DefaultValue="0x21"),
}
"""Objects of a drive, exactly those that are necessary for measuring."""

TORQUE: Spec = _var("i16", "ro", 1, ParameterName="Torque actual value")
MAKERS_CURRENT: Spec = _var("i32", "ro", 1, ParameterName="Motor current actual value")

GENERAL = """[FileInfo]
FileName=drive.eds

[DeviceInfo]
VendorName=Nobody & Co
VendorNumber=0x4D2
ProductName=Drive of nowhere
ProductNumber=0x402
BaudRate_500=1
BaudRate_1000=1
"""


def sheet(
    changes: Mapping[Place, Spec | None] | None = None, general: str = GENERAL, node: int = 0
) -> str:
    """Return a data sheet; `changes` adds objects, changes their keys, or removes them (None).

    A `node` gives the configuration file (DCF) of that node.
    """
    objects = {place: dict(spec) for place, spec in OBJECTS.items()}
    for place, spec in (changes or {}).items():
        if spec is None:
            objects.pop(place, None)
        else:
            objects[place] = {**objects.get(place, _var("u32")), **spec}
    commissioning = f"[DeviceComissioning]\nNodeID=0x{node:X}\nBaudrate=500\n\n" if node else ""
    return general + "\n" + commissioning + "\n".join(_sections(objects))


def _sections(objects: Mapping[Place, Spec]) -> list[str]:
    members = {index for index, subindex in objects if subindex}
    lines = []
    for index, subindex in sorted(objects):
        if index in members and (index, subindex) == min(p for p in objects if p[0] == index):
            lines += [f"[{index:04X}]", f"ParameterName=Object {index:04X}", "ObjectType=0x9", ""]
        name = f"{index:04X}sub{subindex:X}" if index in members else f"{index:04X}"
        spec = {"ParameterName": f"Entry {name}", "ObjectType": "0x7", **objects[index, subindex]}
        lines += [f"[{name}]", *(f"{key}={value}" for key, value in spec.items()), ""]
    return lines
