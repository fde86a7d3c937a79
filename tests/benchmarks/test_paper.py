"""The paper line by line, short form: the page holds, and a mistake on either side shows."""

from __future__ import annotations

import copy
import json

import numpy as np
import pytest

from benchmarks.drift_study.scenarios import Scenario
from benchmarks.paper.assessment import local_fits, prepare, recorded
from benchmarks.paper.campaigns import ARTICLE, LOAD, measure
from benchmarks.paper.page import PAGE, RESULTS, rendered
from hil.model.base_parameters import base_parameters
from hil.model.robot import parse_robot
from hil.runs.run import Run


@pytest.fixture(scope="module")
def results():
    return json.loads(RESULTS.read_text())


def changed(content, path, change):
    """A copy of nested content with one entry changed."""
    whole = part = copy.deepcopy(content)
    for key in path[:-1]:
        part = part[key]
    part[path[-1]] = change(part[path[-1]])
    return whole


def test_the_page_is_what_its_results_make_and_every_verdict_holds(manutec, results):
    text, failed = rendered(ARTICLE, results, manutec)
    assert not failed
    assert text == PAGE.read_text()


def test_base_parameters_read_as_the_paper_prints_them_but_for_two_terms_order(manutec):
    pairs = zip(base_parameters(manutec).expressions, ARTICLE["equation_22"], strict=True)
    assert [k for k, (own, printed) in enumerate(pairs, start=1) if own != printed] == [9, 11]


@pytest.mark.parametrize(
    ("path", "change"),
    [
        (["table_1"], lambda text: text.replace(" Ixz2", "")),
        (["equation_22", 6], lambda text: text.replace("2 l2", "l2")),
        (["equation_22", 8], lambda text: text.replace("- Iyy4", "+ Iyy4")),
        (["table_2", 2], lambda text: text.replace("8 13", "8")),
        (["groups", "gravity"], lambda numbers: numbers[:2]),
        *((["table_3", row, 4], lambda p: p + 0.01) for row in ("A", "B", "change")),
        (["table_3", "expected", 7], lambda p: p - 0.1),
        (["minutes"], lambda minutes: 2 * minutes),
        (["offset"], lambda degrees: degrees + 10),
    ],
)
def test_a_mistake_in_the_papers_values_fails(manutec, results, path, change):
    assert rendered(changed(ARTICLE, path, change), results, manutec)[1]


@pytest.mark.parametrize(
    ("path", "change"),
    [
        (["cases", "loaded", 0, "published", "p", 4], lambda p: p + 20),
        (["cases", "bare", 0, "bound", "gravity", "exact"], lambda share: 3 + share),
        (["cases", "bare", 0, "neglected", "coriolis", "p3"], lambda p: p + 5),
        (["drawn", "offset", "degrees"], lambda degrees: degrees / 2),
    ],
)
def test_a_mistake_in_our_results_fails(manutec, results, path, change):
    assert rendered(ARTICLE, changed(results, path, change), manutec)[1]


@pytest.mark.parametrize(
    ("here", "there"), [("alpha: pi/2, r: l2", "alpha: -pi/2, r: l2"), ("[Ixx, Ixz,", "[Ixx,")]
)
def test_a_mistake_in_our_robot_fails(manutec, results, here, there):
    robot = parse_robot(manutec.text.replace(here, there, 1), "mistaken.yaml")
    try:
        failed = rendered(ARTICLE, results, robot)[1]
    except ValueError:  # not even the number of base parameters is the paper's
        return
    assert failed


@pytest.fixture(scope="module")
def measured(manutec, tmp_path_factory):
    """Gravity parameters without and with the load, each from eight measurements over the bus."""
    columns = list(base_parameters(manutec).groups["gravity"])

    def gravity(name, plant):
        scenario = Scenario(name, plant | {"symmetric": True})
        cell = measure(tmp_path_factory.mktemp(name), manutec, "glance", scenario, name, 1)
        fits, _ = local_fits(manutec, prepare(recorded(Run.open(cell.run)))[0])
        weights = 1 / manutec.torque_limit[[f.axis for f in fits]]
        W = np.array([f.row[columns] for f in fits]) * weights[:, None]
        return np.linalg.lstsq(W, weights * [f.sides[0] for f in fits])[0]

    bare = gravity("bare", {})
    return bare, gravity("loaded", LOAD) - bare


def agrees(found, expected):
    return np.linalg.norm(found - expected) < 0.01 * np.linalg.norm(expected)


def test_table_3_is_measured_over_the_bus(measured):
    row = ARTICLE["table_3"]
    p_g, change = (np.array(row["A"])[[4, 7, 12]], [5.43, -7.928, -1.520])
    assert agrees(measured[0], p_g)
    assert agrees(measured[1], change)
    assert not agrees(measured[1], np.array(row["change"])[[4, 7, 12]]), "the paper's own"
    assert not agrees(measured[1], 0.98 * np.array(change)), "a load of 10.64 kg"
