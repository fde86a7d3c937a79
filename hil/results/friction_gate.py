"""The gate before a campaign: friction must have been found symmetric, or nothing moves."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.errors import AsymmetricFriction, Mismatch
from hil.results.friction_file import NAME, load_friction

if TYPE_CHECKING:
    from hil.model.robot import Robot
    from hil.runs.run import Run


def refuse_asymmetric(run: Run, robot: Robot) -> list[str]:
    """Gate before a campaign: refuse a robot whose friction was found to be asymmetric.

    Returns
    -------
    list of str
        Axes that the test could not judge, one sentence.

    Raises
    ------
    AsymmetricFriction
        An axis failed, or nothing was tested.
    Mismatch
        The run is of another robot.
    FileError
        Its friction was not evaluated yet.
    """
    found = load_friction(run)
    source = f"{run.path}/{NAME}"
    if found.robot_digest != robot.digest:
        raise Mismatch(f"{source}: is about {found.robot}, not about this {robot.name}")
    tested = {record.axis: record.symmetry for record in found.axes if record.symmetry}
    failed = [(axis, test) for axis, test in tested.items() if not test.passed]
    if failed:
        asymmetries = ", ".join(
            f"axis {axis}: {100 * test.asymmetry:+.1f} % (p = {test.p_bound:.1g})"
            for axis, test in failed
        )
        raise AsymmetricFriction(
            f"{source}: friction differs by direction by more than {100 * failed[0][1].bound:g} %:"
            f" {asymmetries}; look for a current sensor's offset or a worn gear, or go on without"
            " the gate"
        )
    if not tested:
        raise AsymmetricFriction(
            f"{source}: symmetry of no axis was tested; give hil friction fit an identified model"
            " with --model"
        )
    untested = [str(k) for k in range(1, robot.n_joints + 1) if k not in tested]
    return [f"symmetry of axis {', '.join(untested)} was not tested"] if untested else []
