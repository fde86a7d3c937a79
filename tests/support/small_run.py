"""Run folders with known parameters, written in a moment: recordings without a plant."""

import json
import shutil
import tempfile
from functools import cache
from pathlib import Path

import numpy as np
from synthetic import TABLE_3_A, Friction, record

from drivers.drive_bus import AxisInfo
from hil.model.robot import Robot
from hil.planning.design.by_counts import design
from hil.results import findings
from hil.results.model_file import NAME
from hil.runs.journal import BusName, axis_records
from hil.runs.recording_file import Measured
from hil.runs.run import Run
from hil.runs.run_folder import RunFolder
from hil.show.charts.chart import Chart

COUNTS = {"gravity": 12, "inertia": 24, "coupling": 3}
SIMULATED = BusName("sim_plant", "manutec-r15")
NOISE = 0.0025


def write_run(path, robot, truth=None, seed=1, more=()):
    """Write a complete run of a small plan; friction decays and has an offset.

    `truth` is the true robot with its base parameters, if different from the file. `more` are
    additional measurements of the plan. Without either, the run is copied from one recorded once
    per process.
    """
    if truth is None and not more:
        if not (kept := _place() / f"{robot.digest}-{seed}").exists():
            _write(kept, robot, None, seed, ())
        shutil.copytree(kept, path, dirs_exist_ok=True)
        return RunFolder.open(path)
    return _write(path, robot, truth, seed, more)


def _write(path, robot, truth, seed, more):
    machine, p = truth or (robot, TABLE_3_A)
    plan = design(robot, COUNTS)
    plan = plan.model_copy(update={"measurements": (*plan.measurements, *more)})
    folder = RunFolder.create(path, plan, robot)
    friction = Friction(growth=-3e-4, offset=np.array([1, -2, 0.5, 0.3, -0.2, 0.1]))
    rng, begin = np.random.default_rng(seed), 0.0
    with folder.session(SIMULATED) as session:
        axes = [
            AxisInfo(f"joint {n}", f"drive no. {n}", -3.0, 3.0, 3.0, 99.0, 0.1, 1e-5)
            for n in range(1, 7)
        ]
        folder.keep(axes=axis_records(axes))
        for measurement in plan.measurements:
            recording = record(machine, measurement, p, friction, begin=begin, noise=NOISE, rng=rng)
            folder.write(Measured(measurement, recording, session=session))
            begin = float(recording.time[-1]) + 1.0
    return folder


def identified_model(seed=1):
    """Return the model of `write_run`'s small run of the
    manutec-r15, estimated once per process.
    """
    return _identified(seed)[1]


def identified_run(path, seed=1):
    """Copy the run of `identified_model`, with model and all findings, to `path`; return `path`."""
    kept, model = _identified(seed)
    shutil.copytree(kept, path)
    model.save(path / NAME)
    return path


@cache
def _identified(seed):
    run = write_run(_place() / f"identified-{seed}" / "run", Robot.load("manutec-r15"), seed=seed)
    return run.path, findings.identify_and_keep(Run.open(run.path), "improved").model


@cache
def _temporary():
    return tempfile.TemporaryDirectory()  # until this process ends


def _place():
    return Path(_temporary().name)


def state_hardware(journal, bus):
    """Change the `run.json` of a run to state another bus than the virtual plant's."""
    content = json.loads(journal.read_text())
    for session in content["sessions"]:
        session |= {"bus": bus, "simulated": False}
    journal.write_text(json.dumps(content))


def empty_plots(monkeypatch):
    """Replace the plots of reports by empty ones."""
    monkeypatch.setattr("hil.show.outcome.Plot.chart", Chart())
