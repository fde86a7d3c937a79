"""Gate of `tools/counts.py`: refused counts and messages."""

from __future__ import annotations

from tools.counts import COMMANDS, compare


def counted(rows: int, calls: dict[str, int]) -> dict[str, object]:
    counts = {"regressor rows": rows, "own calls": 10_000}
    return {name: {"counts": counts, "calls": calls} for name in COMMANDS}


KEPT = counted(1000, {"hil/a.py:often": 600, "hil/b.py:seldom": 20})


def test_counts_within_their_bounds_are_none_of_its_business() -> None:
    assert compare(counted(1019, {"hil/a.py:often": 700}), KEPT) == []


def test_a_count_beyond_its_bounds_names_the_functions_whose_calls_grew_most() -> None:
    now = {"hil/a.py:often": 590, "hil/b.py:seldom": 200, "hil/c.py:new": 90, "hil/d.py:rare": 9}
    found = compare(counted(1021, now), KEPT)
    assert len(found) == len(COMMANDS)
    assert found[0] == (
        "hil plan: regressor rows 1,021, must be 980 to 1,020; calls that grew most:"
        " hil/b.py:seldom +180, hil/c.py:new +80"
    )


def test_less_work_is_refused_too_so_that_bounds_stay_close() -> None:
    assert "regressor rows 900, must be 980 to 1,020" in compare(counted(900, {}), KEPT)[0]
