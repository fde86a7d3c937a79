"""What stands in YAML text, event by event: read by libyaml, which takes a tenth of the time.

PyYAML has libyaml compiled in wherever it is installed as a wheel. Elsewhere its own parser in
Python gives the same events.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import yaml

if TYPE_CHECKING or not yaml.__with_libyaml__:

    class Events(yaml.reader.Reader, yaml.scanner.Scanner, yaml.parser.Parser):
        """Events of a text."""

        def __init__(self, text: str) -> None:
            yaml.reader.Reader.__init__(self, text)
            yaml.scanner.Scanner.__init__(self)
            yaml.parser.Parser.__init__(self)

else:
    from yaml.cyaml import CParser as Events

__all__ = ["Events"]
