"""Simulation of a model by MuJoCo, from the file of `hil export --to mjcf`.

Friction is Coulomb's and viscous, as MuJoCo has it, and an offset is the bias of an actuator. Joint
limits are left out, since the recorded motion stays within them. MuJoCo's scheme is of first order
in the step.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from checked_files.yaml_file import FileError
from hil.export.mjcf_file import IMPEDANCE, STEP, write_mjcf
from hil.optional_packages import needed_for
from hil.results.consistency import find_consistent_robot

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from hil.arrays import Array
    from hil.results.model import Model
    from hil.simulation.arm import Drive, Start


OLDEST = (3, 7)
"""First MuJoCo that reads a polynomial of damping."""


class MujocoArm:
    """Nearest physically consistent robot of a model, in MuJoCo.

    Raises
    ------
    FileError
        MuJoCo is not installed, or older than `OLDEST`.
    """

    def __init__(self, model: Model, step: float = STEP) -> None:
        with needed_for("the simulator mujoco", "mujoco"):
            import mujoco  # noqa: PLC0415 - optional, and slow to load
        if tuple(map(int, mujoco.__version__.split(".")[:2])) < OLDEST:
            raise FileError(
                f"the simulator mujoco: version {mujoco.__version__} must be at least "
                f"{'.'.join(map(str, OLDEST))}: pip install -U mujoco"
            )
        self._mujoco, self._step = mujoco, step
        bodies = model if model.consistent is not None else find_consistent_robot(model)
        (text,) = write_mjcf(bodies, ()).files.values()
        self._model = mujoco.MjModel.from_xml_string(text)
        self._model.jnt_limited[:] = 0
        names = (f"joint{number}" for number in range(1, model.robot.n_joints + 1))
        # MuJoCo goes through a tree branch by branch
        self._order = np.array([self._model.joint(name).qposadr[0] for name in names])

    def run(self, starts: Sequence[Start], drive: Drive) -> list[Array]:
        """Simulate like `hil.simulation.arm.Arm.run`."""
        return [self._run(drive, *each) for each in starts]

    def _run(
        self, drive: Drive, q: Array, qd: Array, time: Array, lost: Callable[[int, Array], bool]
    ) -> Array:
        mujoco, model = self._mujoco, self._model
        data, order = mujoco.MjData(model), self._order
        data.qpos[order], data.qvel[order] = q, qd
        found = np.full((len(time), len(q)), np.nan)
        found[0] = q
        for k, (begin, period) in enumerate(zip(time, np.diff(time), strict=False), start=1):
            n = max(1, int(np.ceil(period / self._step - 1e-6)))
            model.opt.timestep = h = float(period / n)
            model.dof_solref[:, 1] = -IMPEDANCE / h
            for part in range(n):
                middle = np.array([begin + (part + 0.5) * h])
                now = data.qpos[None, order], data.qvel[None, order]
                data.qfrc_applied[order] = drive(middle, *now)[0]
                mujoco.mj_step(model, data)
            if not np.isfinite(data.qpos).all() or lost(k, data.qpos[order]):
                break
            found[k] = data.qpos[order]
        return found
