"""Version of the installed distribution, which `pyproject.toml` states."""

from importlib.metadata import version

DISTRIBUTION = "canopen-robot-identification"
__version__ = version(DISTRIBUTION)
