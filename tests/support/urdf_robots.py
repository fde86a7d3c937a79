"""URDFs of robots of two to seven axes and of trees: type, xyz, rpy and axis of each joint."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np

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


TREES: dict[str, tuple[Joints, tuple[int, ...]]] = {
    "two arms": (
        [
            (REVOLUTE, "0 0 1", "0 0 0", "0 0 1"),
            (REVOLUTE, "0 0.2 0.4", f"-{H} 0 0", "0 0 1"),
            (REVOLUTE, "0 0 0.1", "0 0 0", "0 1 0"),
            (REVOLUTE, "0.3 0 0", "0 0 0", "0 1 0"),
            (REVOLUTE, "0 -0.2 0.4", f"{H} 0 0", "0 0 1"),
            (REVOLUTE, "0 0 0.1", "0 0 0", "0 1 0"),
            (REVOLUTE, "0.3 0 0", "0 0 0", "0 1 0"),
        ],
        (0, 1, 2, 3, 1, 5, 6),
    ),
    "hand": (
        [
            (PRISMATIC, "0 0 0.1", "0 0 0", "0 0 1"),
            (REVOLUTE, "0.1 0 0", "0 0 0", "0 1 0"),
            (REVOLUTE, "0 0 0.1", "0 0 0", "0 1 0"),
            (REVOLUTE, "0 0.1 0", "0 0 0.3", "0 1 0"),
            (REVOLUTE, "0 0 0.1", "0 0 0", "0 1 0"),
            (REVOLUTE, "0.1 0 0.05", "0 0.2 -0.3", "0 1 0"),
            (PRISMATIC, "0 0 0.1", "0 0 0", "0 1 0"),
        ],
        (0, 1, 2, 1, 4, 1, 6),
    ),
    "two legs on a stand": (
        [
            (REVOLUTE, "0 0.1 1", "0 0 0", "1 0 0"),
            (REVOLUTE, "0 0 -0.1", "0 0 0", "0 1 0"),
            (REVOLUTE, "0 -0.1 1", "0 0 0", "1 0 0"),
            (REVOLUTE, "0 0 -0.1", "0 0 0", "0 1 0"),
        ],
        (0, 1, 0, 3),
    ),
}
"""Trees: joints, and the number of the joint that carries each, 0 for the base."""


def random_tree(rng: np.random.Generator) -> tuple[Joints, tuple[int, ...]]:
    """Return a random tree of two to eight joints, many parallel or perpendicular."""

    def words(choices: tuple[float, ...]) -> str:
        return " ".join(repr(float(x)) for x in rng.choice(choices, 3))

    n = int(rng.integers(2, 9))
    kinds = rng.choice([REVOLUTE, REVOLUTE, PRISMATIC], n).tolist()
    axes = rng.choice(["1 0 0", "0 1 0", "0 0 1", "0 0 -1", "0.3 1 -0.2"], n).tolist()
    angles = 0.0, 0.0, float(H), -float(H), 0.4
    joints = [
        (k, words((0.0, 0.1, -0.2)), words(angles), a) for k, a in zip(kinds, axes, strict=True)
    ]
    return joints, tuple(int(rng.integers(max(0, k - 2), k + 1)) for k in range(n))


def urdf(
    name: str, joints: Joints, parents: Sequence[int] | None = None, *, rigid_link: bool = False
) -> str:
    """Return a URDF of these joints: type, xyz, rpy, axis; links have arbitrary inertias."""
    lines = [f'<robot name="{name}">', '<link name="base"/>']
    parent = "base"
    for k, (kind, xyz, rpy, axis) in enumerate(joints, start=1):
        if parents is not None:
            parent = f"link{parents[k - 1]}" if parents[k - 1] else "base"
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
