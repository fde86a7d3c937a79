"""Processor time of `hil --help` and of a completion, against that of the underlying libraries.

Processor time (user and system) is that of whole processes, interpreter included, measured in turns
so that other load affects all alike. The help of `hil` and the completion of a command's name are
compared with an interpreter that only imports typer and rich, and with `--help` of a minimal typer
program of two commands. The figures are medians; the help may take three times as long as the
import of the libraries.

    python benchmarks/start_up.py [--times 10]
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
from statistics import median

from figures import Figure, keep

PROMISED = 3.0
"""Bound of the ratio of the help's processor time to that of the libraries."""
LIBRARIES = "typer, rich alone"
HELP = "hil --help"
LEAST = "help of two commands"
SMALL = """
import typer
app = typer.Typer()
@app.command()
def one(number: int = 1):
    "One."
@app.command()
def two(number: int = 1):
    "Two."
app(["--help"])
"""
"""A program of typer with two commands that shows its help."""
COMPLETION = "completion of hil ide"
KEYS = ("libraries", "least", "help", "completion")
PROGRAM = (sys.executable, "-m", "hil")
ASKED = {"_HIL_COMPLETE": "complete_bash", "COMP_WORDS": "hil ide", "COMP_CWORD": "1"}
STARTED: dict[str, tuple[tuple[str, ...], dict[str, str]]] = {
    LIBRARIES: ((sys.executable, "-c", "import typer, rich"), {}),
    LEAST: ((sys.executable, "-c", SMALL), {}),
    HELP: ((*PROGRAM, "--help"), {}),
    COMPLETION: (PROGRAM, ASKED),
}
"""Commands and additional environment of the comparison."""


def main() -> None:
    """Measure in turns, print and keep the medians; exit status 1 for a broken bound."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--times", type=int, default=10)
    times = parser.parse_args().times
    spent = {name: [] for name in STARTED}
    for turn in range(times + 1):  # the first call writes byte code and fills the disk's cache
        for name, (command, variables) in STARTED.items():
            time = processor_time(command, variables)
            if turn:
                spent[name].append(time)
    middle = {name: median(each) for name, each in spent.items()}
    kept: dict[str, Figure] = {}
    for key, (name, each) in zip(KEYS, middle.items(), strict=True):
        ratio = each / middle[LIBRARIES]
        print(f"{name:<24}{1e3 * each:6.0f} ms  {ratio:5.2f} times the libraries")
        ratios = [a / b for a, b in zip(spent[name], spent[LIBRARIES], strict=True)]
        if name != LIBRARIES:
            kept[f"{key}-over-libraries"] = Figure(ratio, scatter=Figure.median(ratios).scatter)
        kept[key] = Figure.median([1e3 * time for time in spent[name]], "ms")
    ratio = middle[HELP] / middle[LIBRARIES]
    print(f"promised: {HELP} at most {PROMISED:g} times; {ratio:.2f}")
    keep(
        "start-up", kept, depends=("hil/cli", "hil/__main__.py"),
        command=f"python benchmarks/start_up.py --times {times}",
    )  # fmt: skip
    sys.exit(ratio > PROMISED)


def processor_time(command: tuple[str, ...], variables: dict[str, str]) -> float:
    """Return the processor time of a process from its start to its end [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, env={**os.environ, **variables}, stdout=subprocess.DEVNULL, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


if __name__ == "__main__":
    main()
