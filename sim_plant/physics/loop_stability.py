"""Stability of the drives' control loops all over the workspace.

A velocity loop is tuned for one inertia and drives another: that of the present configuration, with
the other axes moving or not. Tuned for a far larger inertia it oscillates from step to step, for a
far smaller one the position loop is too fast for it. Both look like a blocked or overloaded axis,
so such gains are refused when the plant is built.

For small motions about a configuration, with the loops of `servo.command` and the integration of
`machine_step`, the state (q, qd, integral, previous torque) of all axes is mapped to the next state
by a matrix. The loops are stable if its eigenvalues are within a circle of radius 1 - SLOWEST h.
Friction, which damps, is neglected; a closed brake is the stiffest spring and has a separate bound
(derived in `gear_modes`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from sim_plant.physics import state as st

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from sim_plant.physics.reflected_inertia import ReflectedInertia

    Array = NDArray[np.float64]

SLOWEST = 1.0
"""Minimum decay rate of a disturbance [1/s]."""
FOLLOWED = 0.8
"""Maximum share of the stiffness limit of a step that a closed brake may take."""
_WIDEST = 1e6
"""Largest factor between two inertias."""


@dataclass(frozen=True, slots=True, eq=False)
class Loops:
    """Gains of all axes.

    Attributes
    ----------
    motors, loads : ndarray, shape (n,)
        Inertias that the velocity loops were tuned for: motor's and arm's [kg m^2 or kg].
    position, velocity, integral : float
        Bandwidths [1/s].
    step : float
        Integration step [s].
    """

    motors: Array
    loads: Array
    position: float
    velocity: float
    integral: float
    step: float

    def replace_load(self, axis: int, load: float) -> Loops:
        """Return a copy with another load inertia of an axis."""
        loads = self.loads.copy()
        loads[axis] = load
        return replace(self, loads=loads)

    def tune(self, inertia: ReflectedInertia) -> Loops:
        """Return a copy tuned for the inertias at the motors."""
        return replace(self, loads=best_loads(inertia, self.motors))


class Unstable(ValueError):
    """Gains of unstable control loops.

    Attributes
    ----------
    place : tuple
        Key of the plant file that is wrong.
    """

    def __init__(self, place: tuple[str | int, ...], message: str) -> None:
        self.place = place
        super().__init__(message)


def best_loads(inertia: ReflectedInertia, motors: Array) -> Array:
    """Return the load inertias for the best tuning of the loops, shape (n,) [kg m^2 or kg]."""
    best: Array = np.maximum(inertia.middle - motors, 0.01 * inertia.middle)
    return best


def is_stable(loops: Loops, inertia: ReflectedInertia) -> bool:
    """Return True if the loops are stable all over the workspace."""
    radius = np.abs(np.linalg.eigvals(_transition(loops, inertia.masses))).max()
    return bool(radius < 1 - SLOWEST * loops.step)


def refuse_unstable(loops: Loops, inertia: ReflectedInertia) -> None:
    """Check that the loops are stable all over the workspace.

    Raises
    ------
    Unstable
        Message with the bounds of stable gains.
    """
    if is_stable(loops, inertia):
        return
    tuned = loops.tune(inertia)
    if not is_stable(tuned, inertia):
        halves = (loops.velocity / 2**k for k in range(1, 16))
        slower = next((x for x in halves if is_stable(replace(tuned, velocity=x), inertia)), None)
        raise Unstable(
            ("loops", "velocity"),
            f"{loops.velocity:g} 1/s makes the loops unstable in steps of {1e3 * loops.step:g} "
            "ms for any load_inertia; "
            + (f"{slower:.3g} 1/s is stable" if slower else "reduce all three gains"),
        )
    for axis, stated in enumerate(loops.loads):
        if not is_stable(tuned.replace_load(axis, stated), inertia):
            message = _bound(tuned, inertia, axis, float(stated))
            raise Unstable(("axes", axis, "drive", "load_inertia"), message)
    worst = int(np.abs(np.log(loops.loads / tuned.loads)).argmax())
    best = tuned.loads[worst]
    raise Unstable(
        ("axes", worst, "drive", "load_inertia"),
        f"{loops.loads[worst]:g} makes the loops unstable together with those of the other axes;"
        f" {best:.3g} suits this arm",
    )


def _bound(tuned: Loops, inertia: ReflectedInertia, axis: int, stated: float) -> str:
    best = float(tuned.loads[axis])

    def holds(load: float) -> bool:
        return is_stable(tuned.replace_load(axis, load), inertia)

    much = stated > best
    edge = _edge(holds, best, _WIDEST if much else 1 / _WIDEST)
    bound = f"at most {0.99 * edge:.3g}" if much else f"at least {1.01 * edge:.3g}"
    return (
        f"{stated:g} makes the velocity loop unstable; it must be {bound}, and {best:.3g} suits"
        " this arm"
    )


def _edge(holds: Callable[[float], bool], start: float, factor: float) -> float:
    """Return the last stable value between `start` (stable) and `factor` times it (unstable)."""
    near, far = start, start * factor
    for _ in range(20):
        middle = float(np.sqrt(near * far))
        near, far = (middle, far) if holds(middle) else (near, middle)
    return near


def _transition(loops: Loops, masses: Array) -> Array:
    """Return the state transition matrices of a step, shape (m, 4 n, 4 n)."""
    n, h = len(loops.motors), loops.step
    eye, none = np.eye(n), np.zeros((n, n))
    gain = np.diag((loops.motors + loops.loads) * loops.velocity)
    error = np.hstack([-loops.position * eye, -eye, none, none])
    command = gain @ error + np.hstack([none, none, eye, none])
    torque = (command + np.hstack([none, none, none, eye])) / 2
    faster = h * np.linalg.solve(masses, np.broadcast_to(torque, (len(masses), n, 4 * n)))
    state = np.eye(4 * n)
    q, v, integral = state[:n], state[n : 2 * n], state[2 * n : 3 * n]
    velocity = v + faster
    rest = np.vstack([integral + h * loops.integral * gain @ error, command])
    return np.concatenate(
        [q + h * (v + velocity) / 2, velocity, np.broadcast_to(rest, (len(masses), *rest.shape))],
        axis=1,
    )


def refuse_hard_brakes(const: Array, inertia: ReflectedInertia, step: float) -> None:
    """Check that the integration step can follow the spring of a closed brake.

    Parameters
    ----------
    const : ndarray, shape (n, N_CONST)
    inertia : ReflectedInertia
    step : float
        Integration step [s].

    Raises
    ------
    Unstable
    """
    closed = const[:, st.F_COULOMB] + const[:, st.BRAKE]
    spring = closed * const[:, st.PER_BRISTLE] * step**2 / 4
    share = (spring + const[:, st.BRISTLE_DAMPING] * step) / inertia.least
    axis = int(share.argmax())
    if share[axis] > FOLLOWED:
        present = 1 / const[axis, st.PER_BRISTLE]
        raise Unstable(
            ("axes", axis, "friction", "presliding"),
            f"{present:g} makes the closed brake too stiff for steps of {1e3 * step:g} ms with an "
            f"inertia of {inertia.least[axis]:.3g}; must be at least "
            f"{present * (share[axis] / FOLLOWED) ** 2:.2g}",
        )
