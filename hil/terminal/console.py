"""The console on which all commands print."""

from rich.console import Console

out = Console()
