"""Long text with plain rows is parsed by Arrow, with identical numbers and errors."""

import numpy as np
import pytest

from checked_files.yaml_file import FileError
from hil.imports.map_file import Format
from hil.imports.readers import open_table, text
from hil.imports.readers.arrow import plain_rows

pytest.importorskip("pyarrow")

ROWS = [f"{0.004 * k:.3f},{np.sin(k):.9f},{k}" for k in range(300)]


def decimals():
    """Return doubles of all exponents, and decimals halfway between two doubles."""
    rng = np.random.default_rng(5)
    every = rng.integers(0, 1 << 64, 20_000, dtype=np.uint64).view(np.float64)
    yield from map(repr, every[np.isfinite(every)].tolist())
    for k in rng.integers(1 << 53, 1 << 54, 500).tolist():
        yield from (f"{2 * k + 1}", f"{2 * k + 1}00000e-5", f"{2 * k + 1}.{'0' * 40}1")
    yield from ("5e-324", "2.4703282292062328e-324", "1.7976931348623157e308", "-0", ".5", "7.")


def test_arrow_rounds_decimals_as_python_does():
    cells = list(decimals())
    found = plain_rows("\n".join(cells).encode(), ",", 1, [0])
    assert found[:, 0].tobytes() == np.array([float(cell) for cell in cells]).tobytes()


def read_blocks(path, monkeypatch, plain):
    """Return numbers of a file, or the error of its refusal, and the count of plain blocks."""
    used = []

    def spied(*arguments):
        used.append(found := plain(*arguments))
        return found

    monkeypatch.setattr(text, "BLOCK", 1000)
    monkeypatch.setattr(text, "plain_rows", spied)
    try:
        table = open_table(path, Format())
        blocks = list(table.blocks([2, 0, 1, 0]))
    except FileError as error:
        return str(error), len(used)
    return np.concatenate(blocks).tobytes(), sum(block is not None for block in used)


@pytest.mark.parametrize(
    ("rows", "plain"),
    [
        (ROWS, True),
        ([row.replace(",", ";").replace(".", ",") for row in ROWS], True),
        ([row.replace(",", "\t") for row in ROWS], True),
        ([f"{row}\r" for row in ROWS], True),
        ([f"{row}," for row in ROWS], True),
        ([*ROWS[:200], "1,,3", "", "2,nan,4", *ROWS[200:]], True),
        ([*ROWS[:200], "1,none,3", " ", "2, inf ,4", "3,1", "# as, it, were", *ROWS[200:]], True),
        ([*ROWS[:200], '1,"2",3', "1,2,3 # so", *ROWS[200:]], True),
        ([*ROWS[:200], "1,2,3,", "1,2,3\r4,5,6", *ROWS[200:]], True),
        ([*ROWS[:200], "1,2,3,4", *ROWS[200:]], True),
        ([*ROWS[:200], "1,2,three", *ROWS[200:]], True),
        ([*ROWS[:200], "1,2,3\xff", *ROWS[200:]], True),
        ([row.replace(",", " ") for row in ROWS], False),
        ([f"{row} # so" for row in ROWS], False),
    ],
)
def test_numbers_and_errors_are_those_without_arrow(tmp_path, monkeypatch, rows, plain):
    path = tmp_path / "a.csv"
    path.write_bytes("\n".join(rows).encode("latin-1"))
    without, _ = read_blocks(path, monkeypatch, lambda *_: None)
    found, used = read_blocks(path, monkeypatch, plain_rows)
    assert found == without
    assert (used > 1) == plain
