"""Identification of a model from runs, by any method, and experience for the next plan.

Nothing is written.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import InvalidArray, NotEnoughData, NotIdentifiable
from hil.estimation.campaign_friction import campaign_friction
from hil.estimation.condensed import stack
from hil.estimation.drive_train import find_drive_train
from hil.estimation.estimate import covariance_of_drives
from hil.estimation.excluded.proof import proved
from hil.estimation.free_motion.motion import smooth_positions
from hil.estimation.free_motion.result import FreeMotionFit
from hil.estimation.friction.points import history
from hil.estimation.identify import default_method, estimate
from hil.estimation.options import DEFAULTS
from hil.estimation.two_step_methods import fill_reached_limits, prepare, prepared_for
from hil.least_squares.regression import ByName
from hil.model.robot import Robot
from hil.planning.measurement import shows_element
from hil.results.advice import error_budget
from hil.results.band_residual import band_residual
from hil.results.model import Model
from hil.results.provenance import Provenance, digests, named
from hil.results.recorded_torque import torque_parts
from hil.results.verdict import verdict
from hil.runs.journal import now
from hil.runs.pooling import Pooled, pooled
from hil.runs.run import Run, opened
from hil.version import __version__

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import ArrayLike

    from hil.arrays import Array
    from hil.estimation.estimate import Estimate
    from hil.estimation.excluded.result import Excluded
    from hil.estimation.noise_levels import Levels
    from hil.estimation.options import Options
    from hil.estimation.prior import Prior
    from hil.runs.recording import Recorded, Recording
    from hil.show.outcome import Outcome

    Arrays = ArrayLike | Sequence[ArrayLike]


@dataclass(frozen=True, eq=False)
class ModelFit(ByName):
    """Identified values by name.

    Base parameters have the robot's names, in kg m^2, kg m or kg; names of an axis's quantities
    begin with the axis: ``axis 2 Coulomb`` [N m or N], ``axis 2 lag`` [s], ``axis 2 compliance``
    [rad/(N m)].

    Attributes
    ----------
    model : Model
        Base parameters with their errors, the data of the estimation, and its judgement.

    Examples
    --------
    >>> fit = hil.regression(hil.Run.open("runs/head")).fit()
    >>> low, high = fit.conf_int()["p8"]
    >>> low < fit.params["p8"] < high
    True
    """

    model: Model

    @property
    def estimate(self) -> Model:
        """Name of `model` for its data of the estimation, until version 0.3."""
        return self.model

    @cached_property
    def _found(self) -> dict[str, tuple[float, float]]:
        """Value and standard error by name."""
        model = self.model
        # also of parameters that are not identified
        errors = np.sqrt(np.diag(model.covariance))
        rows = zip(model.names, model.values, errors, strict=True)
        found = {name: (float(value), float(error)) for name, value, error in rows}
        for axis, law in enumerate(model.friction_law.axes, start=1):
            for term, each in (law.terms if law else {}).items():
                found[f"axis {axis} {term}"] = each.value, each.standard_error
        if (train := model.drive_train) is not None:
            for axis in range(len(train.lag)):
                found[f"axis {axis + 1} lag"] = float(train.lag[axis]), float(train.lag_error[axis])
                if train.soft[axis]:
                    pair = train.compliance[axis], train.compliance_error[axis]
                    found[f"axis {axis + 1} compliance"] = float(pair[0]), float(pair[1])
        for axis, lag in enumerate(model.details.lag, start=1):
            found[f"axis {axis} lag"] = lag.value, lag.standard_error
        for axis, soft in model.details.compliance.items():
            found[f"axis {axis} compliance"] = soft.value, soft.standard_error
        for gain in (*model.gains, *model.details.gains):
            found[f"axis {gain.axis} gain"] = gain.value, gain.standard_error
        return found

    def _half_widths(self, level: float) -> dict[str, float]:
        return dict(zip(self.model.names, self.model.half_width(level).tolist(), strict=True))

    def summary(self) -> Outcome:
        """Return tables of the identified values, for a terminal or a notebook."""
        return self.model.summary()

    def torque_parts(self, recording: Recording) -> dict[str, Array]:
        """Return the torque of a recording by parts, each of shape (n, n_joints) [N m or N].

        ``time`` has shape (n,) [s]. Parts of the model are ``gravity``, ``inertia``, ``velocity``
        (Coriolis and centrifugal), ``rotors`` and ``friction``; ``measured`` less their sum is
        ``left``. All pass the low-pass of the identification.

        Raises
        ------
        NotEnoughData
            The recording is shorter than the reach of the low-pass.
        """
        return torque_parts(self.model, recording)


def identify(
    run: Run | Robot | Path | str,
    method: str | None = None,
    others: Sequence[Run | Path | str] = (),
    prior: Prior | None = None,
    *,
    t: Arrays | None = None,
    q: Arrays | None = None,
    tau: Arrays | None = None,
    qd: Arrays | None = None,
    alone: int | None = None,
    cut_off: float | None = None,
    accept: Sequence[str] = (),
) -> Model:
    """Identify a robot's dynamics and friction from a run or from arrays; nothing is written.

    Parameters
    ----------
    run : Run, Robot or path
        Run or its folder; with arrays, the robot or an argument of `hil.Robot.load`.
    method : str, optional
        Method of estimation; by default chosen by the kind of recordings.
    others : sequence of Run or path
        Additional runs of the same robot, identified jointly.
    prior : Prior, optional
        Bodies from CAD, for parameters that the motion does not excite.
    t : array_like, shape (n_samples,), or a list of these, one a recording
        Time stamps [s].
    q, tau : array_like, shape (n_samples, n_joints), or a list of these
        Positions [rad or m] and torques [N m or N], joint side.
    qd : array_like, shape (n_samples, n_joints), or a list of these, optional
        Velocities [rad/s or m/s]. Accelerations are found from positions and velocities.
    alone, cut_off, accept : optional
        As in `hil.Run.import_arrays`.

    Raises
    ------
    InvalidArray, InvalidValue
        As in `hil.Run.import_arrays`.
    FileError, Mismatch, UnknownName, NotIdentifiable, NotEnoughData
        As in `hil.results.identification.identified`.

    Examples
    --------
    >>> robot = hil.Robot.load("examples/pan_tilt/head.urdf")
    >>> rows = np.loadtxt("examples/pan_tilt/excitation.csv.gz", delimiter=",", skiprows=1)
    >>> q, tau = np.deg2rad(rows[:, 1:3]), 2.5 * rows[:, 3:5]  # 2.5 N m for one ampere
    >>> hil.identify(robot, t=rows[:, 0], q=q, tau=tau)
    <Model of pan-tilt: 8 base parameters, free motion method, 2 measurements>
    >>> hil.identify("runs/head")
    <Model of pan-tilt: 8 base parameters, free motion method, 2 measurements>
    """
    if isinstance(run, Robot) or any(each is not None for each in (t, q, tau, qd)):
        from hil.imports.arrays import run_from_arrays  # noqa: PLC0415 - runs need none of it

        if t is None or q is None or tau is None or isinstance(run, Run):
            given = {"t": t, "q": q, "tau": tau}
            lacking = [name for name, each in given.items() if each is None]
            raise InvalidArray(
                "arrays need a robot, not a run, and all of t, q and tau; missing: "
                f"{', '.join(lacking) or 'a robot'}"
            )
        robot = run if isinstance(run, Robot) else Robot.load(run)
        run = run_from_arrays(robot, t, q, tau, qd, alone, cut_off, accept)
    more = [opened(each) for each in others]
    options = replace(DEFAULTS, prior=prior)
    return identified(opened(run), method, more, options=options).model


def identified(
    run: Run,
    method: str | None = None,
    others: Sequence[Run] = (),
    recorded: Recorded | None = None,
    options: Options = DEFAULTS,
) -> ModelFit:
    """Identify the base parameters from a run.

    Parameters
    ----------
    method : str, optional
        One of `hil.estimation.identify.METHODS`; by default chosen by the kind of recordings
        (`method_for`).
    others : sequence of Run
        Further runs of the same robot, identified jointly with the first.
    recorded : iterable of (RecordedMotion, Recording), optional
        Recordings of all runs, if already read.
    options : Options
        Unknowns beside the base parameters, and the method for standard errors.

    Raises
    ------
    FileError
        A damaged recording.
    Mismatch
        Runs of different robots, or the same run twice.
    UnknownName
        The method does not exist.
    NotIdentifiable, NotEnoughData
        The measurements do not suffice; the most likely cause is stated, if any is found.
    """
    campaign = Pooled([run, *others]) if recorded is None else recorded
    with named(run):
        try:
            found = estimate(run.robot, campaign, method or method_for(run, others)[0], options)
        except (NotIdentifiable, NotEnoughData) as error:
            proof = proved(run.robot, campaign)
            if proof is None or not proof.found:
                raise
            # more measurements would not remove the cause
            cause = f"{proof.found[0]}; {proof.found[0].remedy}"
            raise type(error)(f"{cause}\nwithout this correction: {error}") from error
    if found.drive_train is None and not found.friction_law.known:
        # free motions and the improved method have chosen their laws already
        prepared = prepared_for(run.robot, found, campaign)
        # stated or reached limits determine the samples for the choice of a friction law
        robot, past = fill_reached_limits(run.robot, prepared), None
        if run.robot.limits_known:
            past = history(robot, prepared)
        stacks = (axes for motion, s in prepared for axes in stack(robot, motion, s))
        found = replace(found, friction_law=campaign_friction(robot, found.values, stacks, past))
    smooth = None
    if isinstance(found.details, FreeMotionFit):
        smooth = partial(smooth_positions, cut_off=found.details.cut_off)
    proof = proved(run.robot, campaign, found.values, found.drive_train, found.joint, smooth)
    return ModelFit(model_of(run, found, others, proof, options, campaign))


def method_for(run: Run, others: Sequence[Run] = ()) -> tuple[str, str]:
    """Return the name of the method for some runs, and the reason for the choice."""
    return default_method([motion for each in (run, *others) for motion in each.motions])


def model_of(
    run: Run,
    found: Estimate,
    others: Sequence[Run] = (),
    proof: Excluded | None = None,
    options: Options = DEFAULTS,
    recorded: Recorded = (),
) -> Model:
    """Create a model from an estimate, and judge the model.

    Without `recorded`, the model states no residual over the fixed band.
    """
    found = replace(found, robot=run.robot)  # without the limits that were only reached
    if proof is not None:
        total = covariance_of_drives(run.robot, found.effect, proof.shifts)
        found = replace(found, drive_covariance=total)
    prior = None
    if options.prior is not None and found.prior_share is not None:
        prior = options.prior.stated(found.names, found.prior_share)
    sessions = run.journal.sessions
    model = Model(
        # the joint fit holds all samples and is no longer needed
        **vars(found) | {"joint": None},
        provenance=Provenance(
            robot=run.robot.name,
            robot_digest=run.robot.digest,
            plan_digest=run.journal.plan_digest,
            measured=sessions[-1].started if sessions else "",
            bus=sessions[-1].bus if sessions else "",
            simulated=any(each.journal.simulated for each in (run, *others)),
            drives=tuple(axis.identity for axis in sessions[-1].axes) if sessions else (),
            measurements=found.n_measurements,
            missing=sum(len(each.missing) for each in (run, *others)),
            together_with=tuple(str(each.path) for each in others),
            left_out=tuple(str(left) for left in found.left_out),
            without=tuple(sorted(run.set_aside)),
            warnings=tuple(line for each in (run, *others) for line in each.journal.warnings),
            identified=now(),
            method=found.method,
            version=__version__,
            recordings=tuple(digest for each in (run, *others) for digest in digests(each)),
        ),
        error_budget=error_budget(found),
        excluded=proof,
        prior=prior,
    )
    return rejudged(model, recorded, options)


def rejudged(model: Model, recorded: Recorded, options: Options = DEFAULTS) -> Model:
    """Return a model with the residual over the fixed band, and judged by this residual."""
    model = replace(model, band_residual=band_residual(model, recorded, options.accuracy))
    return replace(model, verdict=verdict(model, options.accuracy))


def experience(folders: Sequence[Run]) -> Levels:
    """Return the noise and the base parameters estimated from the runs of a robot.

    Raises
    ------
    FileError
        A damaged recording.
    NotEnoughData
        No measurement is usable.
    """
    from hil.estimation.noise_levels import noise_levels  # noqa: PLC0415 - loads an optimiser

    robot = folders[0].robot
    raw, _ = prepare(pooled(folders))
    if not raw:
        raise NotEnoughData(
            f"{folders[0].path}: holds no measurement of gravity, inertia or coupling; measure "
            "some with --resume"
        )
    drive_train = find_drive_train(robot, raw)
    return noise_levels(
        robot, [(m, drive_train.applied(robot, s)) for m, s in raw if shows_element(m)]
    )
