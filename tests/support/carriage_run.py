"""Carriage of known mass and friction, and a simulated recording."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from possible_models import model_of

import hil
from hil.friction.law import AxisLaw, FrictionLaw, TermValue
from hil.results.model import Model
from hil.runs.run import Run
from hil.simulation.arm import Arm, Drive, Start

PERIOD = 0.005


def carriage(mass: float = 5.0) -> Model:
    """Return the model of a carriage with Coulomb friction, as from identification."""
    terms = {"Coulomb": TermValue(value=4.0, standard_error=0.1)}
    plain = terms | {"viscous": TermValue(value=0.0, standard_error=0.1)}
    law = AxisLaw(law="Coulomb", speed=1.0, terms=terms, plain=plain, held_out={})
    robot = hil.Robot.load("emps")
    model = model_of(robot, np.array([mass]), np.array([0.01]), friction=False)
    return replace(model, friction_law=FrictionLaw(axes=(law,)))


def noisy_run(model: Model, seed: int = 0, seconds: float = 12.0, period: float = 0.004) -> Run:
    """Return the motion of a carriage under noisy recorded forces, with rests."""
    return noisy_runs(model, [seed], seconds, period)[0]


def noisy_runs(model: Model, seeds: Sequence[int], seconds: float, period: float) -> list[Run]:
    """Return `noisy_run` of several seeds, simulated side by side, one after the other in time."""
    robot, none, time = hil.Robot.load("emps"), np.zeros(1), np.arange(0.0, seconds, period)
    phases = 6.0 * np.sin(2.3 * time + np.array(seeds)[:, None])
    forces = (12.0 * np.sin(7.0 * time) + phases + 0.5)[..., None]
    instants = time + seconds * np.arange(len(seeds))[:, None]
    drive = Drive(instants.ravel(), np.vstack(forces), 0.0 * np.vstack(forces), none, none)
    starts = [Start(none, none, own, lambda *_: False) for own in instants]
    made = []
    for seed, q, force in zip(
        seeds, Arm(model, step=period).run(starts, drive), forces, strict=True
    ):
        rng = np.random.default_rng(seed)
        read = q + 1e-5 * rng.standard_normal(q.shape)
        noisy = force + rng.standard_normal(q.shape)
        made.append(hil.Run.import_arrays(robot, time, read, noisy, accept=["friction"]))
    return made


def carriage_run() -> Run:
    """Return a run of the carriage at rest, then back and forth for two seconds."""
    time, none = np.arange(0.0, 2.2, PERIOD), np.zeros(1)
    force = 15.0 * np.sin(2 * np.pi * np.maximum(time - 0.2, 0.0))[:, None]
    drive = Drive(time, force, 0.0 * force, none, none)
    (q,) = Arm(carriage()).run([Start(none, none, time, lambda *_: False)], drive)
    return hil.Run.import_arrays(hil.Robot.load("emps"), time, q, force, accept=["friction"])
