"""Identified models as files of other tools: a module a format, listed in `formats`."""

from hil.callable_package import make_callable

make_callable(__name__)
