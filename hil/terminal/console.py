"""The console on which all commands print."""

from rich.console import Console

from hil.terminal.printable import printable

out = Console()


def say(text: str, style: str | None = None, console: Console = out) -> None:
    """Print a line as it is: nothing in it is markup, and the terminal alone wraps it."""
    console.print(printable(text), style=style, highlight=False, markup=False, soft_wrap=True)
