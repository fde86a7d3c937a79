"""Impossible inertials of a URDF are named by file, line, link and condition."""

import re

import pytest
from urdf_robots import ROBOTS, urdf

from hil.export.urdf_file import bodies_of, given_urdf, inertial_faults
from hil.model.robot import Robot

INERTIA = 'ixx="0.2" iyy="0.3" izz="0.25" ixy="0.01" ixz="0.02" iyz="0.03"'
DUMMY = (
    '<link name="tool">{inertial}</link><joint name="bolt" type="fixed">'
    '<parent link="link2"/><child link="tool"/></joint></robot>'
)
EMPTY = f'<inertial><mass value="0"/>{re.sub("[0-9.]+", "0", f"<inertia {INERTIA}/>")}</inertial>'


def read(folder, text):
    path = folder / "head.urdf"
    path.write_text(text)
    robot = Robot.load(path)
    given = given_urdf(path, robot)
    return [each.removeprefix(f"{folder}/") for each in inertial_faults(given, robot)], given, robot


def head(*changes):
    """Return a pan-tilt head with changed inertials of its links, from link 1 on."""
    lines = urdf("head", ROBOTS["pan-tilt"]).splitlines()
    links = [number for number, line in enumerate(lines) if "<inertial>" in line]
    for number, (old, new) in zip(links, changes, strict=False):
        assert old in lines[number]
        lines[number] = lines[number].replace(old, new)
    return "\n".join(lines)


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ('ixx="0.2"', 'ixx="-0.2"', "principal moments of inertia -0.20., 0.2.., 0.3.. kg m2 must"),
        ('ixx="0.2"', 'ixx="0.7"', "the greatest of the principal moments .* .triangle inequal"),
        (
            INERTIA,
            'ixx="2e5" iyy="2e5" izz="2e5"',
            r"give a radius of gyration of 548 m.* g mm2",
        ),
        ('<mass value="1"/>', '<mass value="-1"/>', "mass -1 kg must be positive"),
        ('<mass value="1"/>', '<mass value="0"/>', "mass 0 kg must be positive"),
        ('<mass value="1"/>', '<mass value="1500"/>', "mass 1500 kg must be at most 1000 kg; .* g"),
        (
            '<mass value="1"/>',
            '<mass value=""/>',
            "value '' must be 1 finite numbers .link 'link1'",
        ),
        ('<mass value="1"/>', "", "its inertial has no <mass>; add it"),
        (f"<inertia {INERTIA}/>", "", "its inertial has no <inertia>; add it"),
        ('iyz="0.03"', 'iyz="0,03"', "iyz '0,03' must be 1 finite numbers"),
    ],
)
def test_an_inertial_that_no_body_has_is_named_with_line_link_and_condition(
    tmp_path, old, new, why
):
    (fault,), given, robot = read(tmp_path, head((old, new)))
    assert re.match(rf"head.urdf:3: .*{why}", fault)
    assert "link1" in fault
    assert bodies_of(given, robot) is None


def test_all_links_at_fault_are_named_at_once(tmp_path):
    text = head(('ixx="0.2"', 'ixx="-1"'), ('<mass value="2"/>', '<mass value="0"/>'))
    first, second = read(tmp_path, text)[0]
    assert first.startswith("head.urdf:3: link 'link1': principal moments")
    assert second.startswith("head.urdf:5: link 'link2': mass 0 kg")


def test_a_link_without_an_inertial_is_named_and_so_is_what_is_fixed_to_it(tmp_path):
    text = re.sub(r'(<link name="link2">)<inertial>.*</inertial>', r"\1", head())
    assert read(tmp_path, text)[0] == [
        "head.urdf:5: link 'link2' has no <inertial> with a mass: add mass and inertia from CAD"
    ]
    (fault,), *_ = read(tmp_path, text.replace("</robot>", DUMMY.format(inertial=EMPTY)))
    assert "link 'link2' and tool (fixed to it) have no <inertial> with a mass" in fault


def test_a_wrong_inertial_of_a_fixed_link_is_named_by_that_link(tmp_path):
    wrong = f'<inertial><mass value="-2"/><inertia {INERTIA}/></inertial>'
    (fault,), *_ = read(tmp_path, head().replace("</robot>", DUMMY.format(inertial=wrong)))
    assert "link 'tool': mass -2 kg must be positive" in fault


def test_frames_without_mass_and_plates_of_no_thickness_on_a_body_are_no_fault(tmp_path):
    plate = '<inertial><mass value="1"/><inertia ixx="0.00133" iyy="0.00133" izz="0.002660001"'
    plate += ' ixy="0" ixz="0" iyz="0"/></inertial>'
    for inertial in ("", EMPTY, plate):
        text = head().replace("</robot>", DUMMY.format(inertial=inertial))
        faults, given, robot = read(tmp_path, text)
        assert faults == []
        assert bodies_of(given, robot).shape == (2, 10)
