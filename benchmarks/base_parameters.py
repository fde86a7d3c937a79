"""Time of the base parameters of the manutec-r15, for all sixty and for the present parameters.

Both sets are timed in a fresh interpreter, so that nothing is cached, with and without imports.
"""

from __future__ import annotations

import re
import subprocess
import sys
import time

from figures import Figure, keep
from rich.console import Console
from rich.table import Table

from hil import Robot

TIMED = """
import sys, time
from hil import base_parameters
from hil.model.robot import parse_robot
robot = parse_robot(sys.stdin.read(), "benchmark")
begin = time.perf_counter()
print(len(base_parameters(robot)), time.perf_counter() - begin)
"""


def measure(text: str) -> tuple[int, float, float]:
    """Return the number of base parameters, and times of the regrouping and of the process [s]."""
    begin = time.perf_counter()
    result = subprocess.run(
        [sys.executable, "-c", TIMED], input=text, capture_output=True, text=True, check=True
    )
    count, inner = result.stdout.split()
    return int(count), float(inner), time.perf_counter() - begin


def main() -> None:
    """Print and keep the table of times."""
    own = Robot.load("manutec-r15").text
    full = re.sub(r"(?s)\nties:.*", "", re.sub(r"\n    parameters:.*", "", own))
    table = Table(
        "link parameters", "base parameters", "regrouping", "process", title="Base parameters"
    )
    kept: dict[str, Figure] = {}
    for name, text in (("all sixty", full), ("Table 1 and tie", own)):
        count, inner, outer = measure(text)
        table.add_row(name, str(count), f"{inner:.3f} s", f"{outer:.2f} s")
        key = "all" if text is full else "own"
        kept |= {f"{key}-number": Figure.count(count), f"{key}-regrouping": Figure(inner, "s")}
        kept[f"{key}-process"] = Figure(outer, "s")
    Console().print(table)
    command = "python benchmarks/base_parameters.py"
    keep("base-parameters", kept, depends=("hil/model",), command=command)


if __name__ == "__main__":
    main()
