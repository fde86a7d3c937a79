"""Short form of the page that reproduces the paper: the page
is complete and reveals any mistake.
"""

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

FOUND = json.loads(RESULTS.read_text())


def test_the_page_is_what_its_results_make_and_every_verdict_holds(manutec):
    text, failed = rendered(ARTICLE, FOUND, manutec)
    assert not failed
    assert text == PAGE.read_text()


def test_base_parameters_read_as_the_paper_prints_them_but_for_two_terms_order(manutec):
    pairs = zip(base_parameters(manutec).expressions, ARTICLE["equation_22"], strict=True)
    assert [k for k, (own, printed) in enumerate(pairs, start=1) if own != printed] == [9, 11]


@pytest.mark.parametrize(
    ("path", "change"),
    [
        ("table_1", lambda text: text.replace(" Ixz2", "")),
        ("equation_22/6", lambda text: text.replace("2 l2", "l2")),
        ("equation_22/8", lambda text: text.replace("- Iyy4", "+ Iyy4")),
        ("table_2/2", lambda text: text.replace("8 13", "8")),
        ("groups/gravity", lambda numbers: numbers[:2]),
        ("table_3/A/4", lambda p: p + 0.01),
        ("table_3/B/4", lambda p: p + 0.01),
        ("table_3/change/4", lambda p: p + 0.01),
        ("table_3/expected/7", lambda p: p - 0.1),
        ("mass", lambda mass: mass + 0.1),
        ("minutes", lambda minutes: 2 * minutes),
        ("offset", lambda degrees: degrees + 10),
        ("cases/loaded/0/published/p/4", lambda p: p + 20),
        ("cases/bare/0/bound/gravity/exact", lambda share: share + 3),
        ("cases/bare/0/neglected/coriolis/p3", lambda p: p + 5),
        ("drawn/offset/degrees", lambda degrees: degrees / 2),
    ],
)
def test_a_mistake_in_the_papers_values_or_in_ours_fails(manutec, path, change):
    both = part = copy.deepcopy(ARTICLE | FOUND)
    *outer, last = (int(key) if key.isdigit() else key for key in path.split("/"))
    for key in outer:
        part = part[key]
    part[last] = change(part[last])
    article, found = ({key: both[key] for key in keys} for keys in (ARTICLE, FOUND))
    assert rendered(article, found, manutec)[1]


@pytest.mark.parametrize(
    ("here", "there"), [("alpha: pi/2, r: l2", "alpha: -pi/2, r: l2"), ("[Ixx, Ixz,", "[Ixx,")]
)
def test_a_mistake_in_our_robot_file_fails(manutec, here, there):
    robot = parse_robot(manutec.text.replace(here, there, 1), "mistaken.yaml")
    assert len(base_parameters(robot)) != 14 or rendered(ARTICLE, FOUND, robot)[1]


@pytest.fixture(scope="module")
def measured(manutec, tmp_path_factory):
    """Gravity parameters without the load, and their change by the load, of eight measurements
    each.
    """
    columns = list(base_parameters(manutec).groups["gravity"])
    found = []
    for name, plant in (("bare", {}), ("loaded", LOAD)):
        scenario = Scenario(name, plant | {"symmetric": True})
        cell = measure(tmp_path_factory.mktemp(name), manutec, "glance", scenario, name, 1)
        fits, _ = local_fits(manutec, prepare(recorded(Run.open(cell.run)))[0])
        weights = 1 / manutec.torque_limit[[f.measurement.index for f in fits]]
        W = np.array([f.row[columns] for f in fits]) * weights[:, None]
        found.append(np.linalg.lstsq(W, weights * [f.sides[0] for f in fits])[0])
    return found[0], found[1] - found[0]


def agrees(found, expected):
    return np.linalg.norm(found - expected) < 0.01 * np.linalg.norm(expected)


def test_table_3_is_measured_over_the_bus(measured):
    p_g, change = (np.array(ARTICLE["table_3"][row])[[4, 7, 12]] for row in ("A", "change"))
    l1, l2, mass = 0.50, 0.73, ARTICLE["mass"]
    by_22 = mass * np.array([l1, -l2, -ARTICLE["distance"]])
    assert agrees(measured[0], p_g)
    assert agrees(measured[1], by_22)
    assert not agrees(measured[1], change), "the paper's own change"
    assert not agrees(measured[1], 0.98 * by_22), "a load of 10.64 kg"
