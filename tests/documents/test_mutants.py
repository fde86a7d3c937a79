"""Each mistake of `tools/mutants.py` still has a place in the code."""

from __future__ import annotations

import pytest

from tools.mutants import MUTANTS, Mutant, mutated


@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda each: each.file)
def test_what_a_mistake_replaces_stands_there_once(mutant: Mutant) -> None:
    assert mutated(mutant) != mutated(mutant._replace(new=mutant.old))
