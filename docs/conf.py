"""How the site of the documentation is made: `make docs` writes it to build/docs."""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING

import typer
from typer.cli import get_docs_for_click

from hil import cli
from hil.cli import HELP, STATUSES

if TYPE_CHECKING:
    from sphinx.application import Sphinx

sys.path.insert(0, str(Path(__file__).parent / "site"))
sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))
from figures import expanded
from notebooks import write_pages
from over_time import page as benchmarks_over_time

project = "Robot identification over CANopen and EtherCAT"
_PROJECT = Path(__file__).parents[1] / "pyproject.toml"
version = release = tomllib.loads(_PROJECT.read_text())["project"]["version"]
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "formulas",
    "keys_of_files",
    "table_of_causes",
]
html_theme = "furo"
html_math_renderer = "svg"
html_title = project
html_show_copyright = False
myst_enable_extensions = ["deflist", "dollarmath"]
myst_dmath_allow_space = False
myst_heading_anchors = 3
copybutton_prompt_text = r"\$ |>>> |\.\.\. "
copybutton_prompt_is_regexp = True
napoleon_use_rtype = False
autodoc_typehints = "none"
add_module_names = False

REFERENCE = Path(__file__).parent / "reference"
COMMON = {"quiet": "-q, --quiet", "verbose": "-v, --verbose", "json": "--json"}
EPILOG = re.compile(r"\[bold\]Examples\[/bold\]\n((?:  .*(?:\n|$))+)")
NOTEBOOKS = Path(__file__).parent / "tutorials" / "notebooks"


def write_commands(_: Sphinx) -> None:
    """Write the page of all commands from the commands themselves."""
    common = (f"| `{options}` | {HELP[name]} |" for name, options in COMMON.items())
    statuses = (f"| {status} | {meaning} |" for status, meaning in STATUSES.items())
    text = "\n".join([
        "# Commands", "", "As `hil COMMAND --help` states them.", "",
        "## Options of every command", "", "| option | |", "|---|---|", *common, "",
        "`--json`: `tables` holds each table that is printed otherwise, with its `title` and its"
        " `rows`, a value for each head, which states the unit unless a column beside does;"
        " `judgement` the word and its sentence; `sentences` what is stated beside the tables.", "",
        "## Exit status", "", "| status | meaning |", "|---|---|", *statuses, "",
        *(_described(name) for panel in cli.PANELS.values() for name in panel),
    ])  # fmt: skip
    (REFERENCE / "commands.md").write_text(text, encoding="utf-8")


def _described(name: str) -> str:
    command = cli.import_command(name)
    context = typer.Context(command, info_name="hil")
    text = get_docs_for_click(obj=command, ctx=context, name=name, indent=1, call_prefix="hil")
    without = re.sub(rf"\* `(?:{'|'.join(COMMON.values())})`.*\n", "", text)
    return EPILOG.sub(_examples, without)


def _examples(found: re.Match[str]) -> str:
    lines = (f"$ {line.strip()}" for line in found[1].strip().splitlines())
    return "\n".join(["**Examples**:", "", "```console", *lines, "```", ""])


def write_benchmarks(_: Sphinx) -> None:
    """Write the page of figures over time, as git has them."""
    (REFERENCE / "benchmarks.md").write_text(benchmarks_over_time(), encoding="utf-8")


def write_figures(_: Sphinx, __: str, source: list[str]) -> None:
    """Let a page print figures as they were measured last."""
    source[0] = expanded(source[0])


def write_notebooks(app: Sphinx) -> None:
    """Write pages and .ipynb of the notebooks."""
    write_pages(NOTEBOOKS, carry_out=app.config.carry_out)


def setup(app: Sphinx) -> None:
    """Have the generated pages written before any is read."""
    app.add_config_value("carry_out", True, "env", bool)
    app.connect("source-read", write_figures)
    app.connect("builder-inited", write_commands)
    app.connect("builder-inited", write_benchmarks)
    app.connect("builder-inited", write_notebooks)
