"""Read generated foreign files: `tools/fuzz.py [MINUTES OF PROCESSOR TIME] [FORMAT ...]`.

Without a format all formats take turns. Each example has a number from 0, or from --from NUMBER;
--only NUMBER repeats one example. A reader must not end in a traceback, write outside of the
folder, or use more memory than 200 MB and four times the file. Examples that break a rule are kept
in .hypothesis/found/fuzz. The program uses one core; start it twice, with numbers far apart, to use
two. Ctrl-C ends it with the results so far.
"""

from __future__ import annotations

import argparse
import os
import shutil
import sys
import tempfile
from collections import Counter
from contextlib import suppress
from itertools import count
from pathlib import Path

ROOT = Path(__file__).parents[1]
KEPT = ROOT / ".hypothesis" / "found" / "fuzz"


def main() -> int:
    """Read until the time is over; return 1 if any example broke a rule, else 0."""
    for place in ("", "tests/support", "tests/harness", "tests"):
        sys.path.insert(0, str(ROOT / place))
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("minutes", nargs="?", type=float, default=60.0)
    parser.add_argument("formats", nargs="*")
    parser.add_argument("--from", dest="first", type=int, default=0)
    parser.add_argument("--only", type=int)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="fuzz-") as name:
        os.environ["FUZZING_FOLDER"] = name
        return _all(asked, Path(name))


def _all(asked: argparse.Namespace, scratch: Path) -> int:
    from fuzzing import KINDS, attempt, made  # noqa: PLC0415 - its folder has just been named

    kinds = asked.formats or list(KINDS)
    numbers = count(asked.first) if asked.only is None else iter([asked.only])
    found: dict[str, Counter[str]] = {kind: Counter() for kind in kinds}
    most: Counter[str] = Counter()
    with suppress(KeyboardInterrupt):
        for number in numbers:
            for kind in kinds:
                if _processor_time() > 60 * asked.minutes:
                    return _conclusion(found, most)
                path = made(kind, number, scratch / "example")
                outcome = attempt(kind, path)
                found[kind][outcome.how] += 1
                most[kind] = max(most[kind], outcome.memory)
                if outcome.wrong:
                    found[kind]["wrong"] += 1
                    sys.stdout.write(f"{kind} {number}: {outcome.wrong.strip()}\n")
                    sys.stdout.flush()
                    shutil.copytree(path.parent, KEPT / f"{kind}-{number}", dirs_exist_ok=True)
                shutil.rmtree(scratch / "example")
    return _conclusion(found, most)


def _processor_time() -> float:
    """Return the processor time of this process and its children [s]."""
    used = os.times()
    return used.user + used.system + used.children_user + used.children_system


def _conclusion(found: dict[str, Counter[str]], most: Counter[str]) -> int:
    sys.stdout.write(f"{_processor_time() / 60:.1f} minutes of processor time\n")
    for kind, each in found.items():
        sys.stdout.write(
            f"{kind:<10}{each['read']:>7} read {each['refused']:>7} refused"
            f" {each['wrong']:>5} wrong {most[kind] / 1e6:>7.0f} MB at most\n"
        )
    return int(any(each["wrong"] for each in found.values()))


if __name__ == "__main__":
    sys.exit(main())
