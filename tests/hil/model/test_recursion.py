"""Numba's cache of the recursion is that of its source."""

import re
from pathlib import Path

from hil.model import recursion


def test_all_that_is_compiled_into_the_recursion_stands_in_its_own_file() -> None:
    """Numba compiles a file anew when it has changed, and does not look at others."""
    source = Path(recursion.__file__).read_text()
    imported = re.findall(r"^(?:from|import) ([\w.]+)", source, re.MULTILINE)
    assert "numba" in imported
    assert not [name for name in imported if name.startswith("hil")]
