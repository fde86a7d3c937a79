"""Version of the installed distribution, as stated in `pyproject.toml`."""

from importlib.metadata import version

DISTRIBUTION = "canopen-robot-identification"
__version__ = version(DISTRIBUTION)
