"""A load from two runs that were imported, and the gains of all axes by its known mass."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import Mismatch
from hil.estimation.free_motion.gathering import gather
from hil.estimation.free_motion.load import fit_load
from hil.estimation.free_motion.scaling import Scaling
from hil.estimation.free_motion.variants import DEFAULT, VARIANTS
from hil.estimation.free_motion_methods import estimate_from
from hil.estimation.load_columns import load_columns, payload_names
from hil.estimation.payload import ABSENT, no_load, refuse_negative
from hil.estimation.payload_figures import CONTRADICTS, MASS, Payload
from hil.estimation.torque_constants import Gains
from hil.results.naming import named
from hil.runs.pooling import Pooled

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.estimation.estimate import Estimate
    from hil.estimation.free_motion.gathering import Gathered
    from hil.estimation.free_motion.load import LoadFit
    from hil.runs.run import Run

    Array = NDArray[np.float64]

NOTABLE = 2.0
"""Standard errors from which a gain explains a contradiction."""


class LoadOfFreeMotions:
    """What two runs give of a load.

    Parameters
    ----------
    without, loaded : Run
    mass : float, optional
        Of the load, if it is known: held [kg].
    gains : bool
        Whether the gains of all axes are found by it.

    Attributes
    ----------
    estimates : tuple of Estimate
        Of each run by itself, with the gains that were found.
    own : Estimate or None
        Of the loaded run by itself as its map states it; None where its scale is open.
    payload : Payload
    gains : Gains or None

    Raises
    ------
    Mismatch
        Runs of which different gains are unknown, or a stated mass that contradicts what is found.
    NotIdentifiable, NotEnoughData
        Recordings that do not suffice.
    NoLoad
        No load that stands out of its error, or a robot file without anything that it changes.
    """

    def __init__(self, without: Run, loaded: Run, mass: float | None, *, gains: bool) -> None:
        self._robot = without.robot
        self._runs = [_gathered(run, open_scale=gains) for run in (without, loaded)]
        bare, carrying = (run.found.unknown_gains for run in self._runs)
        if bare != carrying:
            raise Mismatch(
                f"{loaded.path}: gains are unknown of other axes than in {without.path}; an axis"
                " has one gain: state it in the maps of both runs or of neither"
            )
        self._is_open = any(run.scaling.unknown != bare for run in self._runs)
        with named(loaded):
            self._fit = self._checked(mass, gains=gains)
        self.estimates, self.own = self._estimates(gains=gains)
        self.payload = self._payload(mass)
        self.gains = self._gains() if gains else None

    def _checked(self, mass: float | None, *, gains: bool) -> LoadFit:
        """The fit, once there is a load and its mass is not another one."""
        if self._is_open:
            return fit_load(self._robot, self._runs, mass, gains=gains)
        free = fit_load(self._robot, self._runs)
        error = float(np.sqrt(free.covariance[MASS, MASS]))
        if free.present.p_value > ABSENT:
            raise no_load(float(free.phi[MASS]), error, free.present.p_value)
        refuse_negative(float(free.phi[MASS]), error)
        if mass is None:
            return free
        if not gains:
            self._refuse_contradiction(free, mass)
        return fit_load(self._robot, self._runs, mass, gains=gains)

    def _refuse_contradiction(self, free: LoadFit, mass: float) -> None:
        m, error = free.phi[MASS], np.sqrt(free.covariance[MASS, MASS])
        if not error or abs(m - mass) <= CONTRADICTS * error:
            return
        by_mass = fit_load(self._robot, self._runs, mass, gains=True)
        before = np.exp(np.mean([np.log(run.scaling.gains) for run in self._runs], axis=0))
        change = np.log(by_mass.gains / before)
        notable = np.flatnonzero(np.abs(change) > NOTABLE * by_mass.gain_errors)
        factors = np.exp(change)
        explained = ", ".join(f"{factors[k]:.3g} times that of axis {k + 1}" for k in notable)
        raise Mismatch(
            f"a mass of {mass:g} kg contradicts {m:.4g} ± {error:.2g} kg by these runs; gains of"
            f" {explained or f'{mass / m:.3g} times those of all axes'} would explain it: correct"
            " the mass, or find the gains by it with --gains"
        )

    def _estimates(self, *, gains: bool) -> tuple[tuple[Estimate, Estimate], Estimate | None]:
        own = None if self._is_open else self._estimate(self._runs[1])
        if not gains and own is not None:
            return (self._estimate(self._runs[0]), own), own
        scaling = Scaling.known(self._fit.gains)
        before, after = (self._estimate(replace(run, scaling=scaling)) for run in self._runs)
        return (before, after), own

    def _estimate(self, run: Gathered) -> Estimate:
        return estimate_from(self._robot, DEFAULT, VARIANTS[DEFAULT].solver, run)

    def _payload(self, mass: float | None) -> Payload:
        before, after = self.estimates
        carried = after.drive_effect - before.drive_effect
        covariance = before.covariance + after.covariance + carried @ carried.T
        fit = self._fit
        K, free = load_columns(self._robot)
        absent, present = payload_names(self._robot)
        shown = np.abs(free).max(axis=1, initial=0.0) > 0
        unidentifiable = tuple(
            name for k, name in present if fit.lost[k] or not shown[k]
        )  # fmt: skip
        return Payload(
            before=before.p,
            after=after.p,
            change=after.p - before.p,
            standard_error=np.sqrt(np.diag(covariance)),
            expected=K @ fit.phi,
            covariance=covariance,
            phi=fit.phi,
            phi_covariance=fit.covariance,
            stated_mass=mass,
            unseen=absent,
            chi_squared=fit.rigid.square,
            degrees_of_freedom=fit.rigid.directions,
            unidentifiable=unidentifiable,
            degrees=fit.degrees,
            chance=fit.rigid.p_value,
        )

    def _gains(self) -> Gains:
        """Gains over those that the maps state; of unknown ones there is no error."""
        fit, unknown = self._fit, list(self._runs[0].found.unknown_gains)
        error = 1.0 / fit.gains - 1.0
        error[unknown] = np.nan
        return Gains(
            error=error,
            standard_error=fit.gain_errors / np.where(np.isnan(error), 1.0, fit.gains),
            constant=fit.gains,
            constant_error=fit.gains * fit.gain_errors,
            p=self.estimates[0].p,
        )


def _gathered(run: Run, *, open_scale: bool) -> Gathered:
    with named(run):
        return gather(run.robot, Pooled([run]), VARIANTS[DEFAULT], open_scale=open_scale)
