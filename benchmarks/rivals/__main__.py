"""``hil identify`` with additional methods for comparison.

python -m benchmarks.rivals RUN --method NAME [--help]
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

from hil import cli
from hil.cli.results import identify
from hil.estimation.identify import METHODS

from . import RIVALS

if TYPE_CHECKING:
    from collections.abc import Sequence

app = typer.Typer(
    pretty_exceptions_enable=False, context_settings={"help_option_names": ["-h", "--help"]}
)
app.command()(identify)


def main(arguments: Sequence[str] | None = None) -> None:
    """Entry point; exit status as in ``hil identify``."""
    METHODS.update(RIVALS)
    cli.main(arguments, app, "python -m benchmarks.rivals")


if __name__ == "__main__":
    main()
