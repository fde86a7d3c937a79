"""Run folders with known parameters, written in a moment: recordings without a plant."""

import json
import shutil
import tempfile
from functools import cache
from pathlib import Path

import numpy as np
from synthetic import TABLE_3_A, Friction, record

from drivers.drive_bus import AxisInfo
from hil.model.robot import load_robot
from hil.planning.design.by_counts import design
from hil.report.charts.chart import Chart
from hil.results.identification import identify
from hil.results.model_file import NAME
from hil.runs.journal import BusName, axis_records
from hil.runs.recording_file import Measured
from hil.runs.run_folder import RunFolder

COUNTS = {"gravity": 12, "inertia": 24, "coupling": 3}
SIMULATED = BusName("sim_plant", "manutec-r15")
NOISE = 0.0025


def write_run(path, robot, truth=None, seed=1, more=()):
    """Write a whole run of a small plan; friction decays and has an offset.

    `truth`: the robot as it is and its base parameters, if it is not as its file says.
    `more`: measurements that the plan has besides.
    """
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


@cache
def identified_model(seed=1):
    """The model of `write_run`'s small run of the manutec-r15, estimated once a process."""
    return identify(RunFolder.open(_identified(seed)))


def identified_run(path, seed=1):
    """Put a copy of that run with its model at `path`; return that."""
    shutil.copytree(_identified(seed), path)
    identified_model(seed).save(path / NAME)
    return path


@cache
def _identified(seed):
    place = tempfile.TemporaryDirectory()
    _KEPT.append(place)
    return write_run(Path(place.name) / "run", load_robot("manutec-r15"), seed=seed).path


_KEPT = []
"""Folders that are there until this process ends."""


def as_on_hardware(journal, bus):
    """Let the `run.json` of a run say that it was measured on another bus."""
    content = json.loads(journal.read_text())
    for session in content["sessions"]:
        session |= {"bus": bus, "simulated": False}
    journal.write_text(json.dumps(content))


def empty_plots(monkeypatch):
    """Let reports have all their plots, with nothing in them."""
    monkeypatch.setattr("hil.report.section.Plot.chart", Chart())
