"""Reading of YAML text by events, and writing, with libyaml: a fraction of the time of Python.

PyYAML has libyaml compiled in wherever it is installed as a wheel. Elsewhere its own parser in
Python gives the same events, and the same content in lines that may be folded elsewhere.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import yaml

if TYPE_CHECKING or not yaml.__with_libyaml__:

    class Events(yaml.reader.Reader, yaml.scanner.Scanner, yaml.parser.Parser):
        """Parser events of a text."""

        def __init__(self, text: str) -> None:
            yaml.reader.Reader.__init__(self, text)
            yaml.scanner.Scanner.__init__(self)
            yaml.parser.Parser.__init__(self)

    Dumper = yaml.SafeDumper
else:
    from yaml.cyaml import CParser as Events
    from yaml.cyaml import CSafeDumper as Dumper

__all__ = ["Dumper", "Events"]
