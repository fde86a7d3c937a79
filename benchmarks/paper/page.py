"""The page: what the paper says beside what was found, line by line, each with its verdict."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jinja2
import numpy as np

from hil.least_squares.solving import inverse
from hil.model.base_parameters import base_parameters
from hil.model.load import LINK_PARAMETERS
from hil.planning.plan import as_plan
from hil.planning.prediction.identifiability import group_observations

from .campaigns import LOAD, PLANS, by_rule
from .figures import in_operation, of_fig_7, shown, sinusoid
from .results import rms

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from hil.arrays import Array
    from hil.model.robot import Robot
    from hil.planning.plan import Plan

    Figures = Mapping[str, Any]


def rendered(article: Figures, results: Figures, robot: Robot) -> tuple[str, list[str]]:
    """Return the page, and the lines whose verdict does not hold any more."""
    failed: list[str] = []

    def verdict(word: str, holds: object, what: str) -> str:
        if not holds:
            failed.append(f"{what}: no longer {word}")
        return word

    def code(name: str) -> str:
        module, _, attribute = name.rpartition(".")
        getattr(import_module(module), attribute)
        return f"`{name}`"

    environment = jinja2.Environment(  # noqa: S701 - of Markdown, from our own figures
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    environment.globals |= {"verdict": verdict, "code": code, "np": np}
    environment.filters |= {"f": _digits, "pc": lambda x: f"{_digits(100 * x)} %"}
    known = {
        "article": article, **results, "robot": of_robot(article, robot),
        "table": of_table_3(article, robot, results), "friction": of_friction(results["drawn"]),
        "choice": of_choice(robot), "seen": of_elements(results["drawn"]),
    }  # fmt: skip
    return environment.get_template("page.md.j2").render(known), failed


def _digits(x: float, digits: int = 2) -> str:
    """Write a figure to so many digits."""
    text = f"{x:.{digits}g}"
    return (f"{float(text):.0f}" if "e+" in text else text).replace("-", "−")


def of_robot(article: Figures, robot: Robot) -> Figures:
    """Table 1, eq. (22), Table 2 and the groups, each symbol as the robot file gives it."""
    base = base_parameters(robot)
    random = np.random.default_rng(1)
    symbols = {name: random.normal() for name in (*robot.standard_parameters, "l1", "l2")}
    # expressions that agree at random values of all their symbols are the same polynomial
    pairs = zip(base.expressions, article["equation_22"], strict=True)
    same = [abs(_value(own, symbols) - _value(printed, symbols)) < 1e-9 for own, printed in pairs]
    cells, number = [], range(robot.n_joints)
    for i, row in enumerate(article["table_2"]):
        printed = [{int(k) for k in cell.split()} for cell in row.split("|")]
        own = [base.dependencies.mass[i, j] for j in number] + [base.dependencies.gravity[i]]
        found = [set((np.flatnonzero(each) + 1).tolist()) for each in own]
        cells += [found[j] == printed[j] for j in (*number[i:], -1)]
    return {
        "table_1": sorted(robot.present) == sorted(article["table_1"].split()),
        "n_present": len(robot.present),
        "equation_22": same,
        "table_2": cells,
        "groups": {group: [k + 1 for k in own] for group, own in base.groups.items()},
    }


def _value(expression: str, symbols: Mapping[str, float]) -> float:
    """Value of an expression as the paper prints it."""
    python = re.sub(r"(?<=[\w)]) (?=[\w(])", "*", expression.replace("^", "**"))
    return float(eval(python, {}, dict(symbols)))  # noqa: S307 - our own text


def of_table_3(article: Figures, robot: Robot, results: Figures) -> Figures:
    """Return Table 3 recomputed: the paper's rows against eq. (22), and ours of all seeds."""
    row = {name: np.array(each) for name, each in article["table_3"].items()}
    load = LOAD["payload"]
    m, d = load["mass"], load["centre"][2]
    body = {
        "m": m, "sz": m * d, "Izz": load["Izz"],
        "Ixx": load["Ixx"] + m * d * d, "Iyy": load["Iyy"] + m * d * d,
    }  # fmt: skip
    phi = np.array([body.get(name, 0.0) for name in LINK_PARAMETERS])
    by_22: Array = base_parameters(robot).matrix[:, -10:] @ phi
    cases, l1 = results["cases"], robot.file.lengths["l1"]
    p = {name: {k: np.array(each) for k, each in cases[name]["p"].items()} for name in PAIRS}
    implied = row["expected"] / article["mass"]
    return row | {
        "by_22": by_22,
        "bare": p["bare"]["published"],
        "loaded": p["loaded"]["published"],
        "changes": p["loaded"]["published"] - p["bare"]["published"],
        "relative": [
            rms(own / true - 1) if true else np.nan
            for own, true in zip(p["default"]["published"].T, row["A"], strict=True)
        ],
        "misprint": np.abs(row["B"] - row["A"] - row["change"]).max(),
        "l1": (implied[0] / l1, implied[4]),
        "l2": (np.sqrt(implied[5]), -implied[7]),
        "paper": _of_load(row["change"], row["expected"], robot),
        "ours": {
            (case, method): _over_plants(
                [_of_load(change, by_22, robot) for change in p[case][method] - p[bare][method]]
            )
            for case, bare in (("loaded", "bare"), ("default-loaded", "default"))
            for method in p[case]
        },
    }


PAIRS = ("bare", "loaded", "default", "default-loaded")


def _over_plants(found: Sequence[Figures]) -> Figures:
    """Root mean squares of errors over pairs of runs; of masses mean and scatter."""
    errors = {k: rms([each[k] for each in found]) for k in found[0]}
    masses = {k: np.array([each[k] for each in found]) for k in ("mass_5", "mass_8")}
    return errors | {k: (float(m.mean()), float(m.std())) for k, m in masses.items()}


def _of_load(change: Array, expected: Array, robot: Robot) -> Figures:
    """Errors of a change by the load in the norm, and the mass that p5 and p8 make of it."""
    parts = {"all": slice(None)} | {g: list(k) for g, k in base_parameters(robot).groups.items()}
    error = {
        group: float(np.linalg.norm((change - expected)[k]) / np.linalg.norm(expected[k]))
        for group, k in parts.items()
        if np.any(expected[k])
    }
    l1, l2 = robot.file.lengths["l1"], robot.file.lengths["l2"]
    return error | {"mass_5": change[4] / l1, "mass_8": -change[7] / l2}


def of_friction(drawn: Figures) -> Figures:
    """Figs. 1 and 2 as figures: curvature, models, symmetry, what stops do."""
    points = np.array(drawn["sweep"]["points"])
    early, ratios = [], {kind: [] for kind in ("cube-root", "arctan")}
    for axis, models in drawn["sweep"]["models"].items():
        own = points[points[:, 0] == float(axis)]
        own = own[np.argsort(own[:, 2])]
        v, level = own[:, 2] / own[-1, 2], (own[:, 3] - own[:, 4]) / 2
        creep, half = np.interp([0.02, 0.51], v, level)
        early.append((half - creep) / (level[-1] - creep))
        for kind, each in ratios.items():
            each.append(models[kind][0] / models["linear"][0])
    stops = np.array(drawn["stops"]["points"])
    level, minutes = (stops[:, 3] - stops[:, 4]) / 2, stops[:, 1]
    after = np.flatnonzero(np.diff(minutes, prepend=minutes[0]) > 0.5)
    uneven = [(c[:, 3] + c[:, 4]).sum() / (c[:, 3] - c[:, 4]).sum() for c in in_operation(drawn)]
    mean = [float(np.mean(c[:, 3] - c[:, 4])) for c in in_operation(drawn)]
    return {
        "early": early,
        "ratios": ratios,
        "models": {k: m[0] for k, m in drawn["sweep"]["models"]["1"].items()},
        "rises": [level[k] / level[k - 5 : k].mean() - 1 for k in after],
        "decays": [level[k + 10 : k + 15].mean() / level[k - 5 : k].mean() - 1 for k in after],
        "uneven": uneven,
        "warming": mean[-1] / mean[0] - 1,
        "every": float(np.median(np.diff(minutes))) * 60,
    }  # fmt: skip


def of_choice(robot: Robot) -> Figures:
    """Condition and least singular value of the groups by plans of the paper's counts."""
    random = np.random.default_rng(1)
    rule = by_rule(robot)
    drawn = [
        m.model_copy(update={"q": tuple(random.uniform(0.8 * robot.q_min, 0.8 * robot.q_max))})
        for m in rule.measurements
    ]
    plans = {"rule": rule, "chosen": PLANS["chosen"](robot), "random": as_plan(robot, drawn)}
    return {name: _characteristic(plan, robot) for name, plan in plans.items()}


def _characteristic(plan: Plan, robot: Robot) -> Figures:
    found = {}
    for group, columns in base_parameters(robot).groups.items():
        W = group_observations(plan, robot, group)
        s = np.linalg.svd(W, compute_uv=False)
        found[group] = {
            "condition": s[0] / s[-1], "least": s[-1],
            "scatter": float(np.sqrt(np.trace(inverse(W.T @ W)) / len(columns))),
        }  # fmt: skip
    return found


def of_elements(drawn: Figures) -> Figures:
    """Figs. 5 to 7: how well the model reflects the elements, what p_g makes of them, the phase."""
    left = {}
    for case in ("bare", "loaded"):
        for kind, axes in (("gravity", (2, 3, 4, 5)), ("inertia", range(1, 7))):
            own = [shown(drawn, case, kind, axis) for axis in axes]
            left[case, kind] = [float(np.std(x[:, 1] - x[:, 2]) / np.ptp(x[:, 2])) for x in own]
    inertia = [each for each in drawn["bare"] if each["kind"] == "inertia"]
    varied = {}
    for axis in (1, 2, 3):
        own = [each for each in inertia if each["axis"] == axis]
        whole = np.array([each["model"] for each in own])
        rest = whole - np.array([each["of_gravity"] for each in own])
        varied[axis] = (float(np.ptp(whole)), float(np.ptp(rest)))
    q, value, model = of_fig_7(drawn).T
    shift = sinusoid(q, value)[1] - sinusoid(q, model)[1]
    return {"left": left, "varied": varied, "shift": abs((shift + 180) % 360 - 180)}
