"""`hil export --to ranges`: samples are possible robots with the model's scatter."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from possible_models import model_of, possible

import hil
from hil.export import data_files
from hil.export.mjcf_file import write_mjcf
from hil.results.consistency import find_consistent_robot


@pytest.fixture(scope="module")
def model() -> hil.Model:
    robot = hil.Robot.load(Path("tests/robots/ur10e.yaml"))
    p, error = possible(robot)
    return find_consistent_robot(model_of(robot, p, 0.2 * error))


def test_every_sample_is_a_robot_of_bodies_and_loads_into_mujoco(
    model: hil.Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    mujoco = pytest.importorskip("mujoco")
    monkeypatch.setattr(data_files, "SAMPLES", 3)
    (text,) = data_files.write_ranges(model, ("origin",)).files.values()
    found = json.loads(text)
    (mjcf,) = write_mjcf(model, ()).files.values()
    assert len(found["samples"]) == 3
    for sample in found["samples"]:
        for mass, inertia in zip(sample["mass"], sample["fullinertia"], strict=True):
            xx, yy, zz, xy, xz, yz = inertia
            principal = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            assert mass > 0.0
            assert principal[0] > 0.0
            assert principal[2] < principal[0] + principal[1]
        spec = mujoco.MjSpec.from_string(mjcf)
        for k, link in enumerate(found["links"]):
            body = spec.body(link)
            body.mass, body.ipos = sample["mass"][k], sample["centre"][k]
            body.fullinertia = sample["fullinertia"][k]
        compiled = spec.compile()
        np.testing.assert_allclose(compiled.body_mass[2:], sample["mass"])


def test_drawn_parameters_scatter_as_the_covariance_says(model: hil.Model) -> None:
    rng = np.random.default_rng(2)
    drawn = [data_files.draw(model, rng) for _ in range(300)]
    z = (np.array([each.values for each in drawn]) - model.values) / model.standard_errors
    np.testing.assert_allclose(z.std(axis=0), 1.0, atol=0.2)
    coulomb = [each.friction_law.axes[0].terms["Coulomb"].value for each in drawn]
    assert np.std(coulomb) == pytest.approx(0.1, rel=0.2)
