"""Page with statements of the paper beside our results, line by line, each with its verdict."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jinja2
import numpy as np

from hil.model.base_parameters import base_parameters
from hil.model.dynamics import mass_matrix
from hil.model.robot_file import LINK_PARAMETERS
from hil.planning.plan import make_plan
from hil.planning.prediction.identifiability import group_observations

from .campaigns import DISC, PLANS
from .figures import operating_characteristics, shown, sort_by_speed

if TYPE_CHECKING:
    from collections.abc import Mapping

    from hil.arrays import Array
    from hil.model.robot import Robot

    Figures = Mapping[str, Any]

HOME = Path(__file__).parents[2]
RESULTS, PAGE = HOME / "benchmarks/results/paper.json", HOME / "docs/explanation/paper.md"


def rendered(article: Figures, results: Figures, robot: Robot) -> tuple[str, list[str]]:
    """Return the page, and the lines with a changed verdict."""
    failed: list[str] = []

    def verdict(word: str, holds: object, what: str) -> str:
        if not holds:
            failed.append(f"{what}: no longer {word}")
        return word

    def code(name: str) -> str:
        module, _, attribute = name.rpartition(".")
        getattr(import_module(module), attribute)
        return f"`{name}`"

    def seed_values(case: str, *path: str) -> Array:
        """Return one figure of a case for each seed."""
        found = results["cases"][case]
        for key in path:
            found = [each[key] for each in found]
        return np.array(found, dtype=float)

    environment = jinja2.Environment(  # noqa: S701 - Markdown of our own figures
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    environment.filters |= {"f": _digits, "pc": lambda x, n=2: f"{_digits(100 * x, n)}\u00a0%"}
    page = environment.get_template("page.md.j2").render(
        article=article, **results, verdict=verdict, code=code, np=np, seed_values=seed_values,
        rms=lambda case, *path: rms(seed_values(case, *path)), robot=robot_figures(article, robot),
        table=table_3_figures(article, robot, seed_values),
        friction=friction_figures(results["drawn"]),
        choice=choice_figures(robot), seen=element_figures(results["drawn"]),
    )  # fmt: skip
    return page + "\n", failed


def rms(values: Any) -> float:
    """Return the root mean square of values."""
    return float(np.sqrt(np.mean(np.square(values))))


def _digits(x: float, digits: int = 2) -> str:
    """Return a figure with a number of digits."""
    text = f"{x:.{digits}g}"
    return (f"{float(text):.0f}" if "e+" in text else text).replace("-", "−")


def robot_figures(article: Figures, robot: Robot) -> Figures:
    """Return Table 1, eq. (22), Table 2, groups and M44, with symbols of the robot file."""
    base, random, number = base_parameters(robot), np.random.default_rng(1), range(robot.n_joints)
    symbols = {name: random.normal() for name in (*robot.standard_parameters, "l1", "l2")}
    # expressions with equal values at random arguments are the same polynomial
    pairs = zip(base.expressions, article["equation_22"], strict=True)
    cells = []
    for i, row in enumerate(article["table_2"]):
        printed = [{int(k) for k in cell.split()} for cell in row.split("|")]
        own = [*base.dependencies.mass[i], base.dependencies.gravity[i]]
        found = [set((np.flatnonzero(each) + 1).tolist()) for each in own]
        cells += [found[j] == printed[j] for j in (*number[i:], -1)]
    q, p = random.normal(size=(9, len(number))), random.normal(size=len(base))
    M44 = p[9] + p[10] * np.sin(q[:, 4]) ** 2 + p[13] * np.cos(q[:, 4]) ** 2
    return {
        "table_1": sorted(robot.present) == sorted(article["table_1"].split()),
        "n_present": len(robot.present),
        "equation_22": [abs(_value(a, symbols) - _value(b, symbols)) < 1e-9 for a, b in pairs],
        "table_2": cells,
        "groups": {group: [k + 1 for k in own] for group, own in base.groups.items()},
        "M44": float(np.abs(mass_matrix(robot, p, q)[:, 3, 3] - M44).max()),
    }


def _value(expression: str, symbols: Mapping[str, float]) -> float:
    """Return the value of an expression in the paper's format."""
    python = re.sub(r"(?<=[\w)]) (?=[\w(])", "*", expression.replace("^", "**"))
    return float(eval(python, {}, dict(symbols)))  # noqa: S307 - our own text


def table_3_figures(article: Figures, robot: Robot, seed_values: Any) -> Figures:
    """Return Table 3 recomputed: paper's rows, eq. (22), and our mean and scatter."""
    row = {name: np.array(each) for name, each in article["table_3"].items()}
    m, d = DISC["mass"], DISC["centre"][2]
    body = {"m": m, "sz": m * d, "Izz": DISC["Izz"]}
    body |= {name: DISC[name] + m * d * d for name in ("Ixx", "Iyy")}
    by_22 = base_parameters(robot).matrix[:, -10:] @ [body.get(n, 0.0) for n in LINK_PARAMETERS]
    implied = row["expected"] / article["mass"]
    pairs = (("bare", "loaded", "published"), ("bare", "loaded", "improved"), SHORT)
    change = {}
    for a, b, how in pairs:
        both = zip(seed_values(a, how, "p"), seed_values(b, how, "p"), strict=False)
        change[b, how] = np.array([loaded - bare for bare, loaded in both])
    p = {"A": seed_values("bare", "published", "p"), "B": seed_values("loaded", "published", "p")}
    p["change"] = change["loaded", "published"]
    short = seed_values("default", "published", "p")
    return row | {
        "by_22": by_22,
        "found": {k: list(zip(x.mean(axis=0), x.std(axis=0), strict=True)) for k, x in p.items()},
        "relative": [rms(short[:, k] / a - 1) if a else np.nan for k, a in enumerate(row["A"])],
        "misprint": np.abs(row["B"] - row["A"] - row["change"]).max(),
        "l1": (np.sqrt(implied[0]), implied[4]),
        "l2": (np.sqrt(implied[5]), -implied[7]),
        "paper": _load_figures(row["change"], row["expected"], robot),
        "ours": {key: _load_figures(each, by_22, robot) for key, each in change.items()},
    }


SHORT = ("default", "default-loaded", "published")


def _load_figures(change: Array, expected: Array, robot: Robot) -> Figures:
    """Return errors of changes by the load in the norm, and the masses by p5 and p8."""
    groups = base_parameters(robot).groups
    parts = {"all": slice(None)} | {g: list(groups[g]) for g in ("gravity", "diagonal")}
    lengths, error, size = robot.file.lengths, change - expected, np.linalg.norm
    masses = {"mass_5": change[..., 4] / lengths["l1"], "mass_8": -change[..., 7] / lengths["l2"]}
    found = {g: rms(size(error[..., k], axis=-1)) / size(expected[k]) for g, k in parts.items()}
    return found | masses


def friction_figures(drawn: Figures) -> Figures:
    """Return Figs. 1 and 2 as figures: curvature, models, symmetry, effect of stops."""
    fits, early = drawn["sweep"]["models"], []
    for axis in fits:
        v, forward, backward = sort_by_speed(np.array(drawn["sweep"]["points"]), int(axis))
        creep, half = np.interp([0.02 * v[-1], 0.51 * v[-1]], v, forward - backward)
        early.append((half - creep) / (forward[-1] - backward[-1] - creep))
    richer = ("cube-root", "arctan")
    _, minutes, _, forward, backward = np.array(drawn["stops"]["points"]).T
    level = forward - backward
    after = np.flatnonzero(np.diff(minutes, prepend=minutes[0]) > 0.5)
    curves = [(forward, backward) for _, forward, backward in operating_characteristics(drawn)]
    size = [float(np.sum(forward - backward)) for forward, backward in curves]
    return {
        "early": early,
        "ratios": {k: [m[k][0] / m["linear"][0] for m in fits.values()] for k in richer},
        "models": {k: m[0] for k, m in fits["1"].items()},
        "rises": [level[k] / level[k - 5 : k].mean() - 1 for k in after],
        "decays": [level[k + 10 : k + 15].mean() / level[k - 5 : k].mean() - 1 for k in after],
        "uneven": [np.sum(c) / s for c, s in zip(curves, size, strict=True)],
        "warming": size[-1] / size[0] - 1,
        "every": float(np.median(np.diff(minutes))) * 60,
    }  # fmt: skip


def choice_figures(robot: Robot) -> Figures:
    """Return condition, least singular value and scatter of p_Md by plans of equal counts."""
    random, rule, found = np.random.default_rng(1), PLANS["rule"](robot), {}
    anywhere = [
        m.model_copy(update={"q": tuple(random.uniform(0.8 * robot.q_min, 0.8 * robot.q_max))})
        for m in rule.measurements
    ]
    plans = {"rule": rule, "chosen": PLANS["chosen"](robot), "random": make_plan(robot, anywhere)}
    for name, plan in plans.items():
        W = group_observations(plan, robot, "diagonal")
        s = np.linalg.svd(W, compute_uv=False)
        scatter = np.linalg.norm(1 / s)  # root of the trace of the inverse of W'W
        found[name] = {"condition": s[0] / s[-1], "least": s[-1], "scatter": scatter}
    return found


def element_figures(drawn: Figures) -> Figures:
    """Return Figs. 5 and 6: residuals of the model, and the part of p_g in the elements."""
    gravity = [shown(drawn, "bare", "gravity", axis).T for axis in (2, 3, 5)]
    left = [rms(value - model) / np.ptp(model) for _, value, model in gravity]
    varied = {}
    for axis in (1, 2, 3):
        own = [e for e in drawn["bare"] if (e["kind"], e["axis"]) == ("inertia", axis)]
        whole, part = np.array([(e["model"], e["of_gravity"]) for e in own]).T
        varied[axis] = (float(np.ptp(whole)), float(np.ptp(whole - part)))
    return {"left": left, "varied": varied}
