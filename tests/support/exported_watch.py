"""Alarms of an exported watch on recorded samples: C compiled, Python imported, ST interpreted."""

from __future__ import annotations

import subprocess
import types
from typing import TYPE_CHECKING, Any

import numpy as np
from compiled_code import COMPILER, IEC2C, MATIEC, STRICT, module
from structured_text import Parser

from hil.export import watch_steps
from hil.export.languages import write_c, write_st
from hil.export.source_code import identifier
from hil.export.watch_code import write_watch
from hil.export.watch_constants import STATE

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from hil.results.model import Model
    from hil.results.watch import Watched

    Array = NDArray[np.float64]
    Samples = tuple[Array, Array, Array]
    Alarms = list[tuple[int, float]]

MAIN = """\
#include <stdio.h>
#include <stdlib.h>
#include "NAME_watch.h"
int main(int count, char **words)
{
    static NAME_watch s;
    double row[1 + 2 * JOINTS];
    NAME_real q[JOINTS], tau[JOINTS];
    int j;
    NAME_start_watch(&s, (count > 1) && (atoi(words[1]) == 1));
    while (fread(row, sizeof row, 1, stdin) == 1) {
        for (j = 0; j < JOINTS; j++) {
            q[j] = (NAME_real)row[1 + j];
            tau[j] = (NAME_real)row[1 + JOINTS + j];
        }
        NAME_watch_sample(&s, (NAME_real)row[0], q, tau);
        for (j = 0; j < JOINTS; j++) {
            printf("%d ", (int)s.alarm[j]);
        }
    }
    return 0;
}
"""


def begun(time: Array, alarm: Iterable[Iterable[Any]]) -> Alarms:
    """Return axes, from 1, and times of the samples at which alarms begin."""
    found, before = [], [False] * 100
    for now, flags in zip(time.tolist(), alarm, strict=True):
        axes = list(map(bool, flags))
        found += [(k + 1, round(now, 6)) for k, one in enumerate(axes) if one and not before[k]]
        before = axes
    return found


def present(samples: Samples) -> tuple[Samples, Array]:
    """Return the samples, a third of the missing ones left out, and the time between them."""
    time, q, tau = samples
    there = np.isfinite(q).all(axis=1) & np.isfinite(tau).all(axis=1) | (np.arange(len(q)) % 3 > 0)
    time, q, tau = time[there], q[there], tau[there]
    return (time, q, tau), np.diff(time, prepend=time[0] - np.diff(time).min())


def alarms_in_c(
    model: Model, found: Watched, samples: Samples, folder: Path, *flags: str, learned: bool
) -> Alarms:
    (time, q, tau), elapsed = present(samples)
    name = identifier(model.robot.name)
    for file, text in (write_c(model, ()).files | write_watch(model, "c", (), found)).items():
        (folder / file).write_text(text)
    main = MAIN.replace("NAME", name).replace("JOINTS", str(model.robot.n_joints))
    (folder / "main.c").write_text(main)
    command = [str(COMPILER), *STRICT, *flags, "-Wconversion", "main.c", "-o", "main", "-lm"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)  # noqa: S603
    assert done.returncode == 0, done.stderr
    return run_main(folder, time, np.column_stack([elapsed, q, tau]), learned=learned)


def alarms_in_python(model: Model, found: Watched, samples: Samples, *, learned: bool) -> Alarms:
    (time, q, tau), elapsed = present(samples)
    name = identifier(model.robot.name)
    (text,) = write_watch(model, "python", (), found).values()
    line = f"from {name}_dynamics import _columns, _stacked, rigid_bodies"
    assert line in text
    names = module(model)
    exec(compile(text.replace(line, ""), "exported", "exec"), names)  # noqa: S102 - our own text
    watch, alarm = names["Watch"](learned), []
    for sample in zip(elapsed, q, tau, strict=True):
        watch.sample(*sample)
        alarm.append(list(watch.alarm))
    return begun(time, alarm)


def alarms_in_structured_text(
    model: Model, found: Watched, samples: Samples, *, learned: bool
) -> Alarms:
    (time, q, tau), elapsed = present(samples)
    name = identifier(model.robot.name)
    files = write_st(model, ()).files | write_watch(model, "st", (), found)
    parsed = Parser(files[f"{name}_dynamics.st"] + files[f"{name}_watch.st"])
    unit = parsed.units[f"{name}_watch".upper()]
    values, alarm = unit.start(), []
    for sample in zip(elapsed.tolist(), q.tolist(), tau.tolist(), strict=True):
        unit.call(values, *sample, learned)
        alarm.append(list(values["ALARM"]))
    return begun(time, alarm)


MATIEC_MAIN = """\
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "POUS.h"
#include "POUS.c"
TIME __CURRENT_TIME;
int main(int count, char **words)
{
    static NAME_WATCH b;
    double row[1 + 2 * JOINTS];
    int j;
    NAME_WATCH_init__(&b, 0);
    b.LEARNED.value = (count > 1) && (atoi(words[1]) == 1);
    while (fread(row, sizeof row, 1, stdin) == 1) {
        b.ELAPSED.value = row[0];
        memcpy(b.Q.value.table, row + 1, JOINTS * sizeof(double));
        memcpy(b.TAU.value.table, row + 1 + JOINTS, JOINTS * sizeof(double));
        NAME_WATCH_body__(&b);
        for (j = 0; j < JOINTS; j++) {
            printf("%d ", (int)b.ALARM.value.table[j]);
        }
    }
    return 0;
}
"""


def alarms_by_matiec(
    model: Model, found: Watched, samples: Samples, folder: Path, *, learned: bool
) -> Alarms:
    (time, q, tau), elapsed = present(samples)
    name = identifier(model.robot.name)
    files = write_st(model, ()).files | write_watch(model, "st", (), found)
    (folder / "text.st").write_text(files[f"{name}_dynamics.st"] + files[f"{name}_watch.st"])
    main = MATIEC_MAIN.replace("NAME", name.upper()).replace("JOINTS", str(model.robot.n_joints))
    (folder / "main.c").write_text(main)
    for command in (
        [str(IEC2C), "-I", MATIEC, "-T", ".", "text.st"],
        [str(COMPILER), "-w", "-I", f"{MATIEC}/C", "main.c", "-o", "main", "-lm"],
    ):
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)  # noqa: S603
        assert done.returncode == 0, done.stdout + done.stderr
    return run_main(folder, time, np.column_stack([elapsed, q, tau]), learned=learned)


def run_main(folder: Path, time: Array, rows: Array, *, learned: bool) -> Alarms:
    words = [str(folder / "main"), str(int(learned))]
    data = rows.astype(float).tobytes()
    out = subprocess.run(words, input=data, capture_output=True, check=True).stdout.decode()  # noqa: S603
    return begun(time, np.array(out.split(), dtype=int).reshape(len(time), -1))


def alarms_by_constants(
    constants: Mapping[str, Any],
    calls: Mapping[str, Callable[..., None]],
    samples: Samples,
    *,
    learned: bool,
) -> Alarms:
    """Return the alarms of `hil.export.watch_steps` itself."""
    (time, q, tau), elapsed = present(samples)
    c = types.SimpleNamespace(**constants, **calls)
    sizes = constants | {"three": 3, "rows": c.joints * c.parameters}
    empty = {"float": 0.0, "int": 0, "bool": False}
    s = types.SimpleNamespace(**{
        name: np.full([sizes[each] for each in field.shape], empty[field.kind]).tolist()
        for name, field in STATE.items()
    })  # fmt: skip
    watch_steps.start_watch(c, s, learned)
    alarm = []
    for sample in zip(elapsed.tolist(), q.tolist(), tau.tolist(), strict=True):
        watch_steps.watch_sample(c, s, *sample)
        alarm.append(list(s.alarm))
    return begun(time, alarm)
