"""Exported C against Pinocchio's RNEA: time per call and operations, for arms of six axes.

The exported functions are compiled by cc with -O2 and timed in C, over a thousand states, as a
controller calls them. Times are processor times, the best of five rounds, so that other processes
have less influence. Pinocchio is called from Python, including the cost of a call. Its C++ is timed
too if Eigen's headers are found (pip install --no-deps cmeel-eigen), for six axes with general
frames and all ten parameters of every link, because the time depends on both.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pinocchio as pin
from figures import Figure, keep
from regressor import pinocchio_arm
from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))
from stated_model import stated_model

from hil import Robot
from hil.export.expressions import count
from hil.export.functions import count_whole_links, functions
from hil.export.languages import write_c
from hil.export.source_code import identifier

ROBOTS = ("manutec-r15", str(Path(__file__).parents[1] / "tests" / "robots" / "ur10e.yaml"))
FRICTION = ("offset", "Coulomb", "viscous", "arc tangent")
"""Terms of the friction law chosen by `hil identify` for most axes of the virtual plants."""
PINOCCHIO = (
    "-DPINOCCHIO_ENABLE_TEMPLATE_INSTANTIATION",
    "-DBOOST_MPL_LIMIT_LIST_SIZE=30",
    "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS",
    "-DBOOST_FUSION_INVOKE_MAX_ARITY=10",
)
"""Macros of Pinocchio's own build, for the use of its compiled library."""
CALLS, STATES = 500_000, 1000
_C = """\
#define _POSIX_C_SOURCE 199309L
#include <stdio.h>
#include <time.h>
#include "{name}_dynamics.h"
static double q[{states}][6], qd[{states}][6], qdd[{states}][6], out[36];
static double now(void)
{{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return 1e6 * (double)t.tv_sec + 1e-3 * (double)t.tv_nsec;
}}
int main(void)
{{
    double sum = 0.0, best;
    int k, j, round;
    for (k = 0; k < {states}; k++)
        for (j = 0; j < 6; j++) {{
            q[k][j] = sin(k + j); qd[k][j] = cos(k - j); qdd[k][j] = sin(2 * k - j);
        }}
{timings}
    return sum > 1e300;
}}
"""
_TIMING = """\
    for (best = 1e300, round = 0; round < 5; round++) {{
        double begin = now();
        for (k = 0; k < {calls}; k++) {{
            int i = k % {states};
            {name}_{function}({arguments}, out);
            sum += out[0];
        }}
        begin = (now() - begin) / {calls};
        best = begin < best ? begin : best;
    }}
    printf("{function} %g\\n", best);
"""
_CPP = """\
#include <pinocchio/multibody.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <cstdio>
#include <ctime>
int main() {
    namespace pin = pinocchio;
    pin::Model model;
    for (int j = 0; j < 6; j++) {
        auto id = model.addJoint(j, pin::JointModelRZ(), pin::SE3::Random(), std::to_string(j));
        model.appendBodyToJoint(id, pin::Inertia::Random(), pin::SE3::Identity());
    }
    pin::Data data(model);
    Eigen::MatrixXd q = Eigen::MatrixXd::Random(6, 1000), v = 1.3 * q, a = 0.7 * q;
    double sum = 0.0, best = 1e300;
    for (int round = 0; round < 5; round++) {
        const std::clock_t begin = std::clock();
        for (int k = 0; k < 200000; k++)
            sum += pin::rnea(model, data, q.col(k % 1000), v.col(k % 1000), a.col(k % 1000))[0];
        const double took = 1e6 * double(std::clock() - begin) / CLOCKS_PER_SEC;
        best = std::min(best, took / 200000);
    }
    std::printf("%g\\n", best);
    return sum > 1e300;
}
"""


def timed_c(robot: Robot, folder: Path) -> dict[str, float]:
    """Time each exported function [us per call]."""
    model, name = stated_model(robot, friction=FRICTION), identifier(robot.name)
    for file, text in write_c(model, ()).files.items():
        (folder / file).write_text(text)
    arrays = {"q": "q[i]", "qd": "qd[i]", "qdd": "qdd[i]", "load": "qdd[i]", "tau": "qdd[i]"}
    timings = "".join(
        _TIMING.format(
            name=name,
            function=each.name,
            arguments=", ".join(arrays[a] for a in each.arguments),
            calls=CALLS,
            states=STATES,
        )
        for each in functions(model)
    )
    (folder / "time.c").write_text(_C.format(name=name, states=STATES, timings=timings))
    command = ["cc", "-std=c99", "-O2", "time.c", "-o", "time", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    done = subprocess.run([folder / "time"], capture_output=True, text=True, check=True)
    return {name: float(us) for name, us in (line.split() for line in done.stdout.splitlines())}


def pinocchio_from_python(robot: Robot) -> float:
    """Time pin.rnea [us per call]."""
    model = pinocchio_arm(robot)
    data = model.createData()
    q, qd, qdd = np.random.default_rng(0).uniform(-2.0, 2.0, (3, 20_000, robot.n_joints))
    times = []
    for _ in range(5):
        begin = time.perf_counter()
        for k in range(len(q)):
            pin.rnea(model, data, q[k], qd[k], qdd[k])
        times.append(time.perf_counter() - begin)
    return min(times) / len(q) * 1e6


def pinocchio_in_cpp(folder: Path) -> float | None:
    """Time pinocchio::rnea for six axes [us per call]; None without Eigen's headers."""
    prefix = next(parent for parent in Path(pin.__file__).parents if parent.name == "cmeel.prefix")
    eigen = prefix / "include" / "eigen3"
    if not eigen.exists() or shutil.which("c++") is None:
        return None
    (folder / "rnea.cpp").write_text(_CPP)
    include, library = prefix / "include", prefix / "lib"
    command = [
        "c++", "-std=c++17", "-O2", "-DNDEBUG", *PINOCCHIO, f"-I{include}", f"-I{eigen}",
        "rnea.cpp", "-o", "rnea", f"-L{library}", "-lpinocchio_default", f"-Wl,-rpath,{library}",
    ]  # fmt: skip
    subprocess.run(command, cwd=folder, check=True)
    done = subprocess.run([folder / "rnea"], capture_output=True, text=True, check=True)
    return float(done.stdout)


def main() -> None:
    """Time everything and print a table for each robot."""
    with tempfile.TemporaryDirectory() as folder:
        in_cpp = pinocchio_in_cpp(Path(folder))
    kept: dict[str, Figure] = {}
    for where in ROBOTS:
        robot = Robot.load(where)
        table = Table("", "operations", "us a call", title=robot.name)
        counted = {
            each.name: count(each.results)
            for each in functions(stated_model(robot, friction=FRICTION))
        }
        with tempfile.TemporaryDirectory() as folder:
            for name, us in timed_c(robot, Path(folder)).items():
                table.add_row(f"exported {name}", str(counted[name]), f"{us:.3f}")
                kept[f"{robot.name}-{name}"] = Figure(us, "us")
        table.add_row("recursion on whole links", str(count_whole_links(robot)), "")
        from_python = pinocchio_from_python(robot)
        kept[f"{robot.name}-rnea-from-python"] = Figure(from_python, "us")
        table.add_row("Pinocchio's rnea from Python", "", f"{from_python:.3f}")
        table.add_row("Pinocchio's rnea in C++", "", f"{in_cpp:.3f}" if in_cpp else "no Eigen")
        if in_cpp:
            kept[f"{robot.name}-rnea-in-cpp"] = Figure(in_cpp, "us")
            ratio = kept[f"{robot.name}-torque"].value / in_cpp
            table.add_row("exported torque over rnea in C++", "", f"{ratio:.2f}")
            kept[f"{robot.name}-torque-of-rnea"] = Figure(ratio, digits=2)
        Console().print(table)
        whole = count_whole_links(robot)
        for name, total in (("own", counted["rigid_bodies"]), ("whole-links", whole)):
            arithmetic = total.multiplications + total.additions
            kept[f"{robot.name}-operations-{name}"] = Figure(arithmetic, digits=3)
    keep(
        "exported-code", kept, depends=("hil/export", "hil/model"),
        command="python benchmarks/exported_code.py",
    )  # fmt: skip


if __name__ == "__main__":
    main()
