"""URDFs of robots of two to seven axes: type, xyz, rpy and axis of each joint."""

Joints = list[tuple[str, str, str, str]]
H = "1.5707963267948966"
REVOLUTE, PRISMATIC, CONTINUOUS = "revolute", "prismatic", "continuous"
ROBOTS: dict[str, Joints] = {
    "pan-tilt": [(REVOLUTE, "0 0 0.1", "0 0 0", "0 0 1"), (REVOLUTE, "0 0 0.2", "0 0 0", "0 1 0")],
    "SCARA": [
        (REVOLUTE, "0 0 0.3", "0 0 0", "0 0 1"),
        (REVOLUTE, "0.4 0 0", "0 0 0", "0 0 1"),
        (PRISMATIC, "0.3 0 0", "3.14159 0 0", "0 0 1"),
        (CONTINUOUS, "0 0 0.1", "0 0 0", "0 0 1"),
    ],
    "Cartesian": [
        (PRISMATIC, "0 0 0.3", "0 0 0", "1 0 0"),
        (PRISMATIC, "0.4 0 0", "0 0 0", "0 1 0"),
        (PRISMATIC, "0.3 0 0", "0 0 0", "0 0 -1"),
    ],
    "UR10e": [
        (REVOLUTE, "0 0 0.1807", "0 0 0", "0 0 1"),
        (REVOLUTE, "0 0 0", "1.570796327 0 0", "0 0 1"),
        (REVOLUTE, "-0.6127 0 0", "0 0 0", "0 0 1"),
        (REVOLUTE, "-0.57155 0 0.17415", "0 0 0", "0 0 1"),
        (REVOLUTE, "0 -0.11985 0", "1.570796327 0 0", "0 0 1"),
        (REVOLUTE, "0 0.11655 0", "1.570796327 3.141592654 3.141592654", "0 0 1"),
    ],
    "Panda": [
        (REVOLUTE, "0 0 0.333", "0 0 0", "0 0 1"),
        (REVOLUTE, "0 0 0", f"-{H} 0 0", "0 0 1"),
        (REVOLUTE, "0 -0.316 0", f"{H} 0 0", "0 0 1"),
        (REVOLUTE, "0.0825 0 0", f"{H} 0 0", "0 0 1"),
        (REVOLUTE, "-0.0825 0.384 0", f"-{H} 0 0", "0 0 1"),
        (REVOLUTE, "0 0 0", f"{H} 0 0", "0 0 1"),
        (REVOLUTE, "0.088 0 0", f"{H} 0 0", "0 0 1"),
    ],
    "askew": [
        (REVOLUTE, "0.1 0.2 0.3", "0.3 0.4 0.5", "0.3 1 0.2"),
        (PRISMATIC, "0.1 0 0.3", "0.3 -0.4 0.5", "1 1 0.2"),
        (REVOLUTE, "0.1 0.2 0.3", "-0.3 0.4 0.5", "0.3 1 -1.2"),
        (REVOLUTE, "0 0 0.3", "0 0 0", "0.3 1 -1.2"),
    ],
}


def urdf(name: str, joints: Joints, *, rigid_link: bool = False) -> str:
    """Return a URDF of these joints: type, xyz, rpy, axis; links have arbitrary inertias."""
    lines = [f'<robot name="{name}">', '<link name="base"/>']
    parent = "base"
    for k, (kind, xyz, rpy, axis) in enumerate(joints, start=1):
        place = f'<origin xyz="{xyz}" rpy="{rpy}"/>'
        if rigid_link and k == 2:
            lines += [
                '<link name="flange"/><joint name="weld" type="fixed">'
                f'<parent link="{parent}"/><child link="flange"/>{place}</joint>'
            ]
            parent, place = "flange", ""
        lines += [
            f'<link name="link{k}"><inertial><origin xyz="0.0{k} 0.02 -0.03" rpy="0.1 0.2 0.3"/>'
            f'<mass value="{k}"/><inertia ixx="0.2" iyy="0.3" izz="0.25" ixy="0.01" ixz="0.02"'
            ' iyz="0.03"/></inertial></link>',
            f'<joint name="joint{k}" type="{kind}"><parent link="{parent}"/>'
            f'<child link="link{k}"/>{place}<axis xyz="{axis}"/>'
            f'<limit lower="-1.{k}" upper="2.{k}" effort="5{k}" velocity="1.{k}"/></joint>',
        ]
        parent = f"link{k}"
    return "\n".join([*lines, "</robot>"])
