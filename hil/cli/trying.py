"""Command `hil try`: a virtual robot is measured, identified, watched and pushed, on one page.

The steps are `hil plan`, `run --live`, `identify` and `watch --live`, in sequence on one page:
measurement faster than real time, watch in real time.
"""

from __future__ import annotations

import time
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Option

from hil.cli.outputs import new_folder, output_option, say_verdicts
from hil.terminal.console import out, say, working

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from rich.console import Console

    from drivers.drive_bus import DriveBus
    from hil.live.feed import Feed
    from hil.measuring.sequencer import Event, Recorded
    from hil.model.robot import Robot
    from hil.planning.plan import Plan
    from hil.results.model import Model
    from hil.results.watch import Alarm

commands = typer.Typer()

ROBOT = "manutec-r15"
RUNS = Path("runs")
LEARNING = 25.0
"""Learning time of the thresholds [s]: every axis then has moved for 15 s, after which a push does
not count as scatter (`hil.watching.detector`)."""
LONGEST = 90.0
"""Latest start of a motion [s], once thresholds are learned: the announced duration is two minutes,
and a motion takes 20 s. On two idle cores the arm can be pushed from 40 s on.
"""
FASTEST_LEARNING = 8.0
"""Speed of learning relative to real time; the eye still follows the slow motion."""
ABOUT = (
    "Six simulated servo drives with the dynamics of an industrial arm answer on a simulated CAN "
    "bus. Masses, inertias and friction of this arm are unknown; only motor currents and "
    "encoders are measured."
)
MEASURING = (
    "One or two axes move at a time: the torques of their motors show masses, inertias and "
    "friction. The dashed line predicts each torque from the motions before; the coloured band "
    "contains the measured torque with a probability of 95 % and narrows with every motion. Once "
    "identified, the arm can feel a push without any sensor."
)
IDENTIFYING = (
    "One regression over all recordings yields the base parameters: the combinations of masses, "
    "centres of mass and inertias that determine the motor torques. The axes are off meanwhile."
)
IDENTIFIED = "The next motion tests the model: it differs from all recordings."
NOT_YET = "The arm can be pushed once it is identified"
FURTHER = (
    "hil view {folder}/pushed/run",
    "hil plan manutec-r15 -o plan.yaml",
    "hil run plan.yaml -o runs/whole --live",
)
"""Suggested next steps: view the push, measure the whole campaign of 34 minutes of robot time."""


@commands.command("try")
def try_(
    output: Annotated[
        Path | None,
        output_option(
            new_folder, "Folder for both runs; by default runs/try, or the next free one."
        ),
    ] = None,
    live: Annotated[
        int,
        Option(
            metavar="PORT",
            min=0,
            max=65535,
            help="Port of the page on this computer, 0 for a free one.",
        ),
    ] = 0,
    no_browser: Annotated[
        bool, Option("--no-browser", help="Print the address and open no browser.")
    ] = False,
    speed: Annotated[
        float,
        Option(
            min=1, max=1000, help="Maximum speed of the simulation, as a multiple of real time."
        ),
    ] = 60.0,
    push: Annotated[
        float | None,
        Option(
            min=5,
            max=3600,
            help="Time for pushing the arm \\[s]; by default up to 90 s after the start.",
        ),
    ] = None,
) -> None:
    """Demonstrate hil on a virtual robot in two minutes: measure, identify, predict, push.

    A page opens in the browser.

    It ends by itself, by the page's Stop button, when the page is closed, or by Ctrl-C.
    """
    began = time.monotonic()
    with ExitStack() as left:
        from tempfile import TemporaryDirectory

        from hil.cli.measuring import Shown, listeners
        from hil.live.audience import Audience
        from hil.terminal.keys import interruptible

        folder = _claim_folder(output)
        left.callback(lambda: _remove_if_empty(folder))
        left.enter_context(interruptible(lambda: f"stopped; recordings so far are in {folder}"))
        hand = f"{left.enter_context(TemporaryDirectory(prefix='hil-'))}/hand"
        shown = listeners(Shown(live=live), [f"hand={hand}"], folder / "measured", while_open=True)
        audience = Audience(shown)
        stated = left.enter_context(audience.open(out))
        audience.publish("headline", {"text": "Planning the measurements", "more": ABOUT})
        audience.publish("hand", {"closed": NOT_YET})
        if no_browser or not _open_browser(stated):
            say("open this address in a browser; Ctrl-C ends the demonstration")
        with working("planning the measurements of the virtual robot"):
            from hil.cli.try_plans import measured_plan
            from hil.live.feed import Feed
            from hil.model.robot import Robot

            robot = Robot.load(ROBOT)
            plan = measured_plan(robot)
            feed = Feed(audience, simulated=True)
        feed.publish("headline", {"text": "Checking the drives, then power on", "more": MEASURING})
        model = _measure(robot, plan, folder / "measured", feed, speed)
        learned = time.monotonic() + LEARNING / FASTEST_LEARNING
        ends = learned + push if push else began + LONGEST
        found = _push(robot, model, folder, feed, hand, ends)
        feed.publish("headline", {"text": "Writing the report", "more": ""})
        with working("writing the report"):
            from hil.report.page import report

            report(folder / "measured")
        feed.publish("headline", {"text": f"Done: {found}", "more": ""})
        further = [each.format(folder=folder) for each in FURTHER]
        feed.publish("report", {"folder": str(folder), "commands": further})
        say(f"{found}\nresults are in {folder}; continue with: hil report {folder / 'measured'}")
        say("the page is served until it is closed, or until Ctrl-C")
        with suppress(KeyboardInterrupt):  # the server reports the closed page in this way
            while not shown[0].gone:
                time.sleep(0.1)


def _measure(robot: Robot, plan: Plan, folder: Path, feed: Feed, speed: float) -> Model:
    import numpy as np

    from hil.cli.measuring import OnBus, measure
    from hil.live.interim import estimate_line
    from hil.measuring.feeding import PacedBus
    from hil.results import model_file
    from hil.results.findings import identify_and_keep
    from hil.results.identification import method_for
    from hil.results.prediction import free_torques
    from hil.runs.run import Run

    paced = partial(PacedBus, fastest=speed)
    measure(plan, robot, Path("the plan"), folder, OnBus(feed=feed), in_front=paced)
    text = "Identifying the robot from all recordings"
    feed.publish("headline", {"text": text, "more": IDENTIFYING})
    with working("identifying the robot"):
        run = Run.open(folder)
        model = identify_and_keep(run, method_for(run)[0]).model
        model.save(folder / model_file.NAME)
    free = free_torques(model)
    half = model.interval(0.95) @ np.array([-0.5, 0.5])
    known = np.ones(len(half), dtype=bool)
    if free is not None:
        n = model.provenance.measurements
        feed.publish("estimate", estimate_line(robot, free, n, model.values, half, known))
    if (left := model.band_residual) is not None:
        share = f"{100 * left.overall:.2g} % of the torque up to {left.band:g} Hz"
        feed.publish("headline", {"text": f"Identified: residual {share}", "more": IDENTIFIED})
    say_verdicts(model.verdict.verdicts if model.verdict else ())
    return model


class _TimeUp(Exception):
    """End of the available time, between two motions."""


def _push(robot: Robot, model: Model, folder: Path, feed: Feed, hand: str, ends: float) -> str:
    """Watch the arm while it can be pushed; return residual on the new motion, and pushes.

    Thresholds are learned faster than in real time. Afterwards no motion starts later than `ends`
    on the monotonic clock [s].
    """
    confirmed = ""
    with working("predicting torques"):
        from hil.cli.beside_model import keep_watch
        from hil.cli.measuring import OnBus, measure
        from hil.cli.monitoring import WatchView
        from hil.cli.try_plans import pushed_plan
        from hil.measuring.feeding import PacedBus
        from hil.measuring.sequencer import Recorded
        from hil.results import model_file
        from hil.results.watch import pushes
        from hil.watching.watcher import TOGETHER, Watcher, WatchingBus

        plan, rounds = pushed_plan(robot, LEARNING + max(ends - time.monotonic(), 0.0))
        watcher = Watcher(model, plan.sample_period, LEARNING)
        view = WatchView(watcher, robot)

    def wrap(bus: DriveBus) -> DriveBus:
        paced = PacedBus(bus, FASTEST_LEARNING, ramped=False)

        def take(alarm: Alarm | None) -> None:
            paced.fastest = FASTEST_LEARNING if watcher.learning else 1.0
            # several samples are judged together, to keep this speed on a busy computer
            watching.at_once = max(1, round(TOGETHER * paced.fastest / plan.sample_period))
            view.take(alarm)

        watching = WatchingBus(paced, watcher, take)
        return watching

    @contextmanager
    def display(console: Console) -> Iterator[Callable[[Event], None]]:
        with view.display(console) as show:

            def take(event: Event) -> None:
                nonlocal confirmed
                show(event)
                if isinstance(event, Recorded) and not (confirmed or watcher.alarms):
                    confirmed = _confirm(model, event)
                over = time.monotonic() > ends and not watcher.learning
                if isinstance(event, Recorded) and over:
                    raise _TimeUp

            yield take

    how = OnBus(bus_option=[f"hand={hand}"], feed=feed)
    path = folder / "pushed"
    try:
        with suppress(_TimeUp):
            measure(
                plan, robot, Path("the motion"), path / "run", how,
                in_front=wrap, display=display, rounds=rounds, watcher=watcher,
            )  # fmt: skip
    finally:
        keep_watch(path, plan, watcher, str(folder / "measured" / model_file.NAME))
    count = len(pushes(watcher.alarms))
    return f"{confirmed}{count or 'no'} push{'es' * (count != 1)} found in {watcher.watched:.0f} s"


def _confirm(model: Model, event: Recorded) -> str:
    """Compare the residual on a new motion, without pushes, with that on the measured motions."""
    from hil.results.band_residual import band_residual

    stated = model.band_residual
    found = band_residual(model, [(event.measurement, event.recording)])
    if stated is None or found is None:
        return ""
    shares = [f"{100 * each.overall:.2g} %" for each in (found, stated)]
    return f"residual {shares[0]} of the torque on a new motion, {shares[1]} on the earlier ones; "


def _claim_folder(output: Path | None) -> Path:
    """Create the requested folder, or the first unused default folder."""
    if output is not None:
        output.mkdir(parents=True)
        return output
    for number in count(1):
        path = RUNS / ("try" if number == 1 else f"try-{number}")
        with suppress(FileExistsError):
            path.mkdir(parents=True)
            return path
    raise AssertionError


def _remove_if_empty(folder: Path) -> None:
    with suppress(OSError):
        folder.rmdir()


def _open_browser(stated: Sequence[str]) -> bool:
    """Open the page if there is a screen; a text browser would take over the terminal."""
    import os
    import sys
    import webbrowser
    from threading import Thread

    screens = ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")
    if sys.platform.startswith("linux") and not any(map(os.environ.get, screens)):
        return False
    address = stated[0].partition("http")[1:]
    # some browsers block until they are closed
    Thread(target=webbrowser.open, args=("".join(address),), daemon=True).start()
    return True
