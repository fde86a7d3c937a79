"""Parallel execution of independent jobs on the cores of this machine or on a Dask cluster.

A worker of this machine computes in one thread: linear algebra in several threads would make the
workers wait for one another. Each worker has its own process group, so that Ctrl-C reaches the
command alone. An interrupted command ends its workers, and a worker ends the processes that it
started. A worker without its command ends too.

Jobs return in the order of completion. The result of a job whose process ended is a
`BrokenExecutor`; a cluster repeats such a job a few times first. On a cluster, workers need the
same environment and the same folders under the same paths. After an interrupt they finish their
current job.
"""

from __future__ import annotations

import os
import signal
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor, as_completed
from contextlib import contextmanager, suppress
from functools import partial
from multiprocessing import active_children, get_context, parent_process
from threading import Thread
from typing import TYPE_CHECKING, Any, TypeVar

from checked_files.yaml_file import FileError
from hil.optional_packages import remedy

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    Job = TypeVar("Job")
    Result = TypeVar("Result")
    Execute = Callable[
        [Callable[[Job], Result], Iterable[Job]], Iterator[tuple[Job, Result | Exception]]
    ]


@contextmanager
def local(workers: int) -> Iterator[Execute[Any, Any]]:
    """Run jobs on processes of this machine; no process survives an error."""
    for library in ("OPENBLAS", "MKL", "OMP"):
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    others = set(active_children())
    context = get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_start) as pool:
        try:
            yield _executor(pool.submit, as_completed, BrokenExecutor)
        except BaseException:
            for worker in set(active_children()) - others:
                worker.terminate()
            raise


@contextmanager
def cluster(address: str) -> Iterator[Execute[Any, Any]]:
    """Run jobs on a Dask cluster, given by its scheduler's address.

    Raises
    ------
    FileError
        Dask is not installed, or no scheduler answers, or it ended meanwhile.
    """
    try:
        import distributed  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise FileError(
            f"Dask is not installed; install it with: {remedy('dask', 'distributed')}"
        ) from error
    try:
        client = distributed.Client(address)  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        raise FileError(f"{address}: no Dask scheduler answers: {error}") from error
    with client:
        submit = partial(client.submit, pure=False)
        try:
            yield _executor(submit, distributed.as_completed, distributed.KilledWorker)
        except distributed.client.FutureCancelledError as error:
            raise FileError(
                f"{address}: the Dask scheduler ended meanwhile; start it, and give the same"
                " command again"
            ) from error


def _executor(
    submit: Callable[..., Any], completed: Callable[..., Any], died: type[Exception]
) -> Execute[Any, Any]:
    def execute(function: Callable[[Any], Any], jobs: Iterable[Any]) -> Iterator[tuple[Any, Any]]:
        futures = {submit(function, job): job for job in jobs}
        for future in completed(futures):
            if (error := future.exception()) is None:
                yield futures[future], future.result()
            else:
                ended = isinstance(error, died)
                yield futures[future], BrokenExecutor(str(error)) if ended else error

    return execute


def _start() -> None:
    """Initialise this process as a worker."""
    os.setpgrp()
    signal.signal(signal.SIGTERM, _leave)
    Thread(target=_leave_with_command, name="command", daemon=True).start()


def _leave(*_signal: object) -> None:
    """End this worker after the processes that it started."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    os.killpg(0, signal.SIGTERM)
    with suppress(ChildProcessError):
        while True:
            os.wait()
    os._exit(1)


def _leave_with_command() -> None:
    if command := parent_process():
        command.join()
    os.kill(os.getpid(), signal.SIGTERM)
