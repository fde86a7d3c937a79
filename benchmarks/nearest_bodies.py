"""Nearest robot of real bodies: comparison with another solver, time, and improvement of estimates.

First figure: difference to the distance by SCS, a first-order solver, for the unreduced program
with equality constraints. Second: median processor time of a projection for six axes, with the cost
of every condition. Third: effect of a projection on estimates of robots with real bodies (eight
point masses per link, each base parameter with an error of 5 %), as the ratio of the squared
distances to the truth after and before the projection.

    python benchmarks/nearest_bodies.py [--seeds 20]
"""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path
from statistics import median
from time import process_time
from typing import TYPE_CHECKING

import numpy as np
from figures import Figure, keep
from scipy import sparse

from hil.estimation.consistent.conditions import BodyBounds, tightened
from hil.estimation.consistent.nearest import nearest_robot
from hil.model.base_parameters import base_parameters
from hil.model.robot import Robot

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.estimation.consistent.conditions import Condition

    Array = NDArray[np.float64]

ROOT = Path(__file__).parents[1]
SUPPORT = ROOT / "tests" / "support"
SAME, FASTEST = 1e-4, 0.5
"""Bounds: relative difference to the other solver, and processor time of six axes [s]."""


def independent_distance(
    robot: Robot, p: Array, covariance: Array, bounds: BodyBounds, tolerance: float = 1e-6
) -> float:
    """Return d^2 by SCS: unknowns are x of p' = p + L x and all standard parameters."""
    import scs

    whole = robot.free_links()
    K = base_parameters(whole).matrix
    T, root = K @ base_parameters(robot).placement, np.linalg.cholesky(covariance)
    norms = np.linalg.norm(K, axis=0)
    unit = 1.0 / np.where(norms > 0, norms, 1.0)
    asked = tightened(whole, bounds)
    asked.sort(key=lambda each: len(each.constant))
    equal = np.hstack([T @ root, -K * unit])
    below = [
        np.hstack([np.zeros((len(rows), len(p))), -rows * unit]) for rows, _ in map(_lower, asked)
    ]
    sides = [-T @ p, *(side for _, side in map(_lower, asked))]
    n, k = len(p), K.shape[1]
    data = {
        "P": sparse.csc_matrix(np.diag([1.0] * n + [0.0] * k)),
        "A": sparse.csc_matrix(np.vstack([equal, *below])),
        "b": np.concatenate(sides),
        "c": np.zeros(n + k),
    }
    sizes = [len(each.constant) for each in asked]
    cone = {"z": len(K), "l": sizes.count(1), "s": [size for size in sizes if size > 1]}
    solver = scs.SCS(
        data, cone, eps_abs=tolerance, eps_rel=tolerance, max_iters=500_000, verbose=False
    )
    return float(2.0 * solver.solve()["info"]["pobj"])


def _lower(condition: Condition) -> tuple[Array, Array]:
    """Return the lower triangle by columns in the form of SCS: rows of weights and constants."""
    size = len(condition.constant)
    at = [(i, j) for j in range(size) for i in range(j, size)]
    scale = np.array([1.0 if i == j else np.sqrt(2.0) for i, j in at])
    rows = np.array([condition.weights[i, j] for i, j in at]) * scale[:, np.newaxis]
    return rows, np.array([condition.constant[i, j] for i, j in at]) * scale


def main() -> None:
    """Print and keep the three figures; exit status 1 for a broken bound."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    seeds = parser.parse_args().seeds
    kept: dict[str, Figure] = {}
    good = [_published(kept), _estimates(seeds, kept)]
    keep(
        "nearest-bodies", kept, depends=("hil/estimation/consistent",), seeds=range(seeds),
        command=f"python benchmarks/nearest_bodies.py --seeds {seeds}",
    )  # fmt: skip
    sys.exit(0 if all(good) else 1)


def _published(kept: dict[str, Figure]) -> bool:
    """Print the projection of the published manutec-r15; return True if both solvers agree.

    Each parameter has an error of 1 %.
    """
    sys.path.insert(0, str(SUPPORT))
    from synthetic import TABLE_3_A

    robot = Robot.load("manutec-r15")
    covariance = np.diag((0.01 * np.maximum(np.abs(TABLE_3_A), 0.01)) ** 2)
    found = nearest_robot(robot, TABLE_3_A, covariance)
    other = independent_distance(robot, TABLE_3_A, covariance, BodyBounds(), 1e-9)
    print(f"manutec-r15 as published: distance {found.distance:.4f}, by SCS {other:.4f}")
    names = base_parameters(robot).names
    for k in np.flatnonzero(np.abs(found.change) > 0.5):
        print(
            f"  {names[k]:4} {TABLE_3_A[k]:9.4f} -> {found.p[k]:9.4f} ({found.change[k]:+.1f} s.e.)"
        )
        kept[names[k]] = Figure(found.p[k], digits=5)
        kept[f"{names[k]}-change"] = Figure(found.change[k], "standard errors", 3)
    for each in found.binding:
        print(f"  {each.name}: without it {each.distance_without:.4g}")
        name = re.sub(r"\W+", "-", each.name)
        kept[f"distance-without-{name}"] = Figure(each.distance_without, digits=4)
    print(f"  with the absent link parameters free: {found.distance_complete:.4g}")
    kept |= {
        "distance": Figure(found.distance, digits=8),
        "distance-by-scs": Figure(other, digits=8),
        "distance-complete": Figure(found.distance_complete, digits=4),
    }
    return abs(found.distance / other - 1.0) < SAME


def _estimates(seeds: int, kept: dict[str, Figure]) -> bool:
    """Print the effect on estimates of robots with real bodies; return True if fast enough."""
    from possible_models import possible

    robot, shares, times = Robot.load(ROOT / "tests" / "robots" / "ur10e.yaml"), [], []
    for seed in range(seeds):
        truth, error = possible(robot, seed)
        p = truth + error * np.random.default_rng(seed + 1000).standard_normal(len(truth))
        begun = process_time()
        found = nearest_robot(robot, p, np.diag(error**2))
        times.append(process_time() - begun)
        before, after = (np.sum(((x - truth) / error) ** 2) for x in (p, found.p))
        shares.append(after / before)
    print(f"ur10e, {seeds} estimates: median {median(times):.2f} s, slowest {max(times):.2f} s")
    print(
        f"  squared distance to the truth, after over before: median {median(shares):.2f},"
        f" {min(shares):.2f} to {max(shares):.2f}"
    )
    kept["truth-median"] = Figure.median(shares)
    kept["truth-least"], kept["truth-most"] = Figure(min(shares)), Figure(max(shares))
    kept["time"] = Figure.median(times, "s")
    kept["time-slowest"] = Figure(max(times), "s")
    return median(times) < FASTEST


if __name__ == "__main__":
    main()
