"""Instructions of the exported C on a Cortex-M7, counted by QEMU.

    python benchmarks/cortex_m7.py

The torque with friction is compiled by arm-none-eabi-gcc with -O2 for the double-precision FPU, and
run on QEMU's board mps2-an500. With ``-icount shift=0`` an instruction takes a nanosecond of
virtual time, so SysTick, with 25 MHz, counts 40 instructions a tick. A loop without the call is
subtracted. The calls of sin, cos and atan are those of newlib. QEMU has no pipeline and no caches:
instructions are no cycles.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from exported_code import FRICTION, ROBOTS
from figures import Figure, keep

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))
from stated_model import stated_model

from hil import Robot
from hil.export.languages import write_c
from hil.export.source_code import identifier

COMPILER, QEMU = shutil.which("arm-none-eabi-gcc"), shutil.which("qemu-system-arm")
CALLS, STATES = 2000, 50
TICK = 40
"""Instructions in a tick of SysTick, 25 MHz, at one instruction a nanosecond."""
KINDS = {"double": (), "single": ("-DSINGLE",)}
_LINKER = """\
ENTRY(reset)
SECTIONS
{
    .text 0x0 : { KEEP(*(.vectors)) *(.text* .rodata*) *(.ARM.exidx*) }
    .data 0x20000000 : { *(.data*) *(.bss* COMMON) end = .; }
}
"""
_C = """\
#ifdef SINGLE
#define {upper}_SINGLE
#endif
#include "{name}_dynamics.h"
#define REG(at) (*(volatile unsigned *)(at))
static {name}_real q[{states}][6], qd[{states}][6], qdd[{states}][6], out[6];
static volatile {name}_real sum;
void reset(void);
static void say(const char *text)
{{
    register int operation __asm__("r0") = 4;
    register const char *given __asm__("r1") = text;
    __asm__ volatile("bkpt 0xab" : "+r"(operation) : "r"(given) : "memory");
}}
static void leave(void)
{{
    register int operation __asm__("r0") = 0x18;
    register int reason __asm__("r1") = 0x20026;
    __asm__ volatile("bkpt 0xab" : : "r"(operation), "r"(reason));
}}
static void print(unsigned number)
{{
    char text[12];
    int at = 11;
    text[at] = 0;
    text[--at] = '\\n';
    do {{ text[--at] = (char)('0' + number % 10); number /= 10; }} while (number);
    say(text + at);
}}
static unsigned ticks(int call)
{{
    unsigned begin = REG(0xE000E018);
    int k;
    for (k = 0; k < {calls}; k++) {{
        int i = k % {states};
        if (call) {{
            {name}_torque(q[i], qd[i], qdd[i], out);
        }}
        sum += out[0] + q[i][0];
    }}
    return (begin - REG(0xE000E018)) & 0xFFFFFF;
}}
static __attribute__((noinline)) void count(void)
{{
    int k, j;
    for (k = 0; k < {states}; k++)
        for (j = 0; j < 6; j++) {{
            q[k][j] = ({name}_real)sin(k + j);
            qd[k][j] = ({name}_real)cos(k - j);
            qdd[k][j] = ({name}_real)sin(2 * k - j);
        }}
    REG(0xE000E014) = 0xFFFFFF;
    REG(0xE000E018) = 0;
    REG(0xE000E010) = 5; /* on, by the processor's clock */
    print(ticks(0));
    print(ticks(1));
    leave();
}}
void reset(void)
{{
    REG(0xE000ED88) |= 0xFu << 20; /* FPU on, before a function saves its registers */
    __asm__ volatile("dsb\\nisb");
    count();
}}
__attribute__((section(".vectors"), used)) static const void *vectors[] = {{
    (void *)0x20400000, (void *)reset
}};
"""


def instructions(robot: Robot, kind: str, folder: Path) -> float:
    """Return the instructions of one torque with friction."""
    name = identifier(robot.name)
    for file, text in write_c(stated_model(robot, friction=FRICTION), ()).files.items():
        (folder / file).write_text(text)
    source = _C.format(name=name, upper=name.upper(), states=STATES, calls=CALLS)
    (folder / "main.c").write_text(source)
    (folder / "board.ld").write_text(_LINKER)
    assert COMPILER is not None
    assert QEMU is not None
    compiled = [
        COMPILER, "-std=gnu99", "-O2", "-mcpu=cortex-m7", "-mthumb", "-mfpu=fpv5-d16",
        "-mfloat-abi=hard", *KINDS[kind], "-nostartfiles", "--specs=nosys.specs", "-T", "board.ld",
        "main.c", "-o", "main.elf", "-lm",
    ]  # fmt: skip
    subprocess.run(compiled, cwd=folder, check=True, capture_output=True)
    run = [
        QEMU, "-M", "mps2-an500", "-kernel", "main.elf", "-icount", "shift=0", "-nographic",
        "-semihosting-config", "enable=on,target=native", "-monitor", "none", "-serial", "none",
    ]  # fmt: skip
    done = subprocess.run(run, cwd=folder, check=True, capture_output=True, text=True, timeout=120)
    without, with_calls = map(int, (done.stdout + done.stderr).split())
    return TICK * (with_calls - without) / CALLS


def main() -> None:
    """Count for each robot and precision, and keep the figures."""
    if COMPILER is None or QEMU is None:
        sys.exit("install gcc-arm-none-eabi, libnewlib-arm-none-eabi and qemu-system-arm")
    kept: dict[str, Figure] = {}
    for where in ROBOTS:
        robot = Robot.load(where)
        for kind in KINDS:
            with tempfile.TemporaryDirectory() as folder:
                found = instructions(robot, kind, Path(folder))
            print(f"{robot.name}, {kind}: {found:.0f} instructions of torque with friction")
            kept[f"{robot.name}-torque-{kind}"] = Figure(found, digits=2)
    keep(
        "cortex-m7", kept, depends=("hil/export", "hil/model"),
        command="python benchmarks/cortex_m7.py",
    )  # fmt: skip


if __name__ == "__main__":
    main()
