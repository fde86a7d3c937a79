"""Folder of a run, sufficient for all evaluations without hardware::

    plan.yaml         planned measurements
    robot.yaml        the robot file, verbatim
    drives.yaml       the drives file, verbatim, if any
    run.json          sessions: versions, host, bus, axes, times, reasons of the end
    found-settings.yaml  values of the drives before the run
    recordings/ID.h5  a file for each finished measurement

A measurement is done when its file exists and is complete. Resuming first renames damaged files,
and then measures the missing files. `run.json` is written last at the start of a run: a folder
without it holds no measurements, and is started anew.
"""  # noqa: D400 - the summary leads into the listing

from __future__ import annotations

import hashlib
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING
from uuid import uuid4

from checked_files.yaml_file import FileError, FileModel, load_yaml
from hil.planning.plan import dump_plan
from hil.runs import SIMULATED
from hil.runs.atomic_file import (
    PART,
    file_errors,
    new_folder,
    own_folder,
    refuse_link,
    whole_name,
    write_file,
)
from hil.runs.journal import (
    Journal,
    RepeatedAttempt,
    Session,
    SyncTiming,
    axis_records,
    now,
    write_journal,
)
from hil.runs.recording_file import write_measured
from hil.runs.run import Run

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from drivers.drive_bus import AxisInfo
    from hil.model.robot import Robot
    from hil.planning.plan import Plan
    from hil.runs.journal import BusName
    from hil.runs.recording_file import Measured

DAMAGED = ".damaged"
_SETTINGS = "found-settings.yaml"
_STUB = {"recordings", "plan.yaml", "robot.yaml", "drives.yaml", "run.json"}


class _FoundSettings(FileModel, extra="ignore"):
    """Used part of `found-settings.yaml`."""

    restored: bool


class RunFolder(Run):
    """Folder of a run being measured (see `Run` for the attributes)."""

    plan: Plan

    @classmethod
    def create(
        cls, path: Path | str, plan: Plan, robot: Robot, drives: str | None = None
    ) -> RunFolder:
        """Make the folder of a new run.

        Parameters
        ----------
        drives : str, optional
            Text of the drives file.

        Raises
        ------
        FileError
            `path` exists already, or cannot be written.
        """
        path = Path(path)
        cls.refuse_taken(path)
        new_folder(path)
        own_folder(path / "recordings")
        write_file(path / "plan.yaml", dump_plan(plan).encode())
        write_file(path / "robot.yaml", robot.text.encode())
        if drives is not None:
            write_file(path / "drives.yaml", drives.encode())
        journal = Journal(
            run_id=uuid4().hex,
            plan_digest=plan.digest,
            robot_digest=robot.digest,
            drives_digest=_digest(drives),
        )
        write_journal(path / "run.json", journal)
        return cls(path, plan, robot, journal)

    @classmethod
    def refuse_taken(cls, path: Path) -> None:
        """Refuse a path that cannot become a new run folder.

        Raises
        ------
        FileError
            The path exists already.
        """
        if path.exists() and not (cls.is_stub(path) or _is_empty(path)):
            raise FileError(
                f"{path}: already exists; continue with --resume, or choose another folder with -o"
            )

    @staticmethod
    def is_stub(path: Path) -> bool:
        """Return True for a run folder without content, left by a kill during its creation."""
        recordings = path / "recordings"
        with file_errors(path, "read"):
            if not recordings.exists() and not recordings.is_symlink():
                return _is_empty(path)  # other content belongs to the user
            if (path / "run.json").exists() or recordings.is_symlink() or not _is_empty(recordings):
                return False
            return all(whole_name(entry.name) in _STUB for entry in path.iterdir())

    def refuse_changes(self, plan: Plan, robot: Robot, drives: str | None = None) -> None:
        """Refuse to resume with another plan, robot or drives file than at the start.

        Raises
        ------
        FileError
            A file differs.
        """
        for name, then, given in (
            ("plan", self.journal.plan_digest, plan.digest),
            ("robot file", self.journal.robot_digest, robot.digest),
            ("drives file", self.journal.drives_digest, _digest(drives)),
        ):
            if then != given:
                raise FileError(
                    f"{self.path}: the {name} differs from that of the run's start; resume with "
                    "the earlier one, or start a new run with -o"
                )

    def refuse_other_drives(self, axes: Sequence[AxisInfo]) -> None:
        """Refuse to resume with other drives than at the start.

        Raises
        ------
        FileError
            The identity of a drive differs.
        """
        known = next((s.axes for s in self.journal.sessions if s.axes), ())
        for then, present in zip(known, axis_records(axes), strict=False):
            if then.identity != present.identity:
                raise FileError(
                    f"{self.path}: the drive of {present.name} was {then.identity} when the run was"
                    f" started, now it is {present.identity}; resume on the same machine, or start"
                    " a new run with -o"
                )

    def write(self, measured: Measured) -> None:
        """Write a recording, completely or not at all."""
        refuse_link(self.path / "recordings")
        own = replace(measured, run=self.journal.run_id)
        write_measured(self.recording_path(measured.measurement), own, self.robot)

    def set_aside_damaged(self) -> list[str]:
        """Prepare to resume: rename damaged recordings, remove unfinished ones.

        Returns
        -------
        list of str
            Fault and new name of each file set aside.

        Raises
        ------
        FileError
            The recordings lie behind a symbolic link, or cannot be renamed.
        """
        set_aside = []
        refuse_link(self.path / "recordings")
        with file_errors(self.path / "recordings", "cleaned up"):
            for part in (*self.path.glob(f"*{PART}"), *self.path.glob(f"recordings/*{PART}")):
                part.unlink()
        for measurement in self.plan.measurements:
            path = self.recording_path(measurement)
            if not path.exists():
                continue
            try:
                self.read(measurement)
            except FileError as error:
                with file_errors(path, "set aside"):
                    candidate = path.with_name(path.name + DAMAGED)
                    number = 2
                    while candidate.exists():
                        candidate = path.with_name(f"{path.name}{DAMAGED}.{number}")
                        number += 1
                    aside = path.replace(candidate)
                set_aside.append(f"{error}; kept as {aside.name}, will be measured again")
        return set_aside

    def discard_if_empty(self) -> bool:
        """Remove the folder if nothing was rehearsed or measured; return True if removed."""
        if not self.path.exists():
            return True
        if self.journal.rehearsed or any((self.path / "recordings").iterdir()):
            return False
        if not self._settings_restored:
            return False
        with file_errors(self.path, "removed"):
            for name in ("plan.yaml", "robot.yaml", "drives.yaml", "run.json", _SETTINGS):
                (self.path / name).unlink(missing_ok=True)
            (self.path / "recordings").rmdir()
            if not any(self.path.iterdir()):
                self.path.rmdir()
        return True

    @property
    def _settings_restored(self) -> bool:
        """True if no drive needs the found settings in the folder."""
        path = self.path / _SETTINGS
        return not path.exists() or load_yaml(path, _FoundSettings).restored

    @contextmanager
    def session(self, bus_name: BusName, real_time: Sequence[str] = ()) -> Iterator[int]:
        """Open a session and yield its number; note the reason of the end in any case.

        The timing of killed sessions is counted anew from their recordings: a kill may come between
        the writing of a recording and of the journal.
        """
        sessions = list(self.journal.sessions)
        killed = {k: SyncTiming() for k, each in enumerate(sessions) if each.ended is None}
        for measured in self if killed else ():
            if (k := measured.session) in killed:
                killed[k] = killed[k].add_recording(measured.recording)
        for k, timing in killed.items():
            sessions[k] = sessions[k].model_copy(update={"sync": timing})
        self.journal = self.journal.model_copy(update={"sessions": tuple(sessions)})
        number = len(self.journal.sessions)
        started = Session(
            started=now(),
            bus=str(bus_name),
            simulated=bus_name.interface == SIMULATED,
            real_time=tuple(real_time),
        )
        self._note(self.journal.add_session(started))
        try:
            yield number
        except BaseException as error:
            with suppress(FileError):  # a full disk is reported already
                self._note(self.journal.change_last(ended=now(), reason=_reason(error)))
            raise
        self._note(self.journal.change_last(ended=now(), reason="finished"))

    @property
    def only_rehearsed(self) -> bool:
        """True if the plan was rehearsed and nothing has been measured."""
        recorded = any((self.path / "recordings").iterdir())
        return self.journal.rehearsed is not None and not recorded

    def note_rehearsed(self, speed: float) -> None:
        """Note a rehearsal of the plan at this share of the speed limits."""
        self._note(self.journal.model_copy(update={"rehearsed": speed}))

    def keep(self, **of_session: object) -> None:
        """Set fields of the session; written by `save_journal`, or at the session's end."""
        self.journal = self.journal.change_last(**of_session)

    def keep_repeated(self, measurement: str, attempt: int, findings: Sequence[str]) -> None:
        """Note a repeated attempt; written by `save_journal`, or at the session's end."""
        failed = RepeatedAttempt(measurement=measurement, attempt=attempt, findings=tuple(findings))
        self.keep(repeated=(*self.journal.sessions[-1].repeated, failed))

    def _note(self, journal: Journal) -> None:
        self.journal = journal
        self.save_journal()

    def save_journal(self) -> None:
        """Write the present state of `run.json`."""
        write_journal(self.path / "run.json", self.journal)


def _reason(error: BaseException) -> str:
    if isinstance(error, KeyboardInterrupt | GeneratorExit):
        return "interrupted by the operator"
    return f"{type(error).__name__}: {error}"


def _digest(text: str | None) -> str | None:
    return None if text is None else hashlib.sha256(text.encode()).hexdigest()


def _is_empty(path: Path) -> bool:
    with file_errors(path, "read"):
        return path.is_dir() and not any(path.iterdir())
