"""Many independent jobs at once: on the cores of this machine, or on a Dask cluster.

A worker of this machine computes in one thread: linear algebra in several threads would have the
workers wait for one another.
Both give futures, in the order in which they are done. On a cluster, workers need the same
environment and must see the study's folder under the same path.
"""

from __future__ import annotations

import os
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from multiprocessing import get_context
from typing import TYPE_CHECKING, Any, TypeVar

from drivers.yaml_file import FileError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    Job = TypeVar("Job")
    Result = TypeVar("Result")
    Execute = Callable[
        [Callable[[Job], Result], Iterable[Job]], Iterator[tuple[Job, Result | Exception]]
    ]


@contextmanager
def local(workers: int) -> Iterator[Execute[Any, Any]]:
    """Processes of this machine."""
    for library in ("OPENBLAS", "MKL", "OMP"):
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:

        def execute(
            function: Callable[[Any], Any], jobs: Iterable[Any]
        ) -> Iterator[tuple[Any, Any]]:
            futures = {pool.submit(function, job): job for job in jobs}
            for future in as_completed(futures):
                yield futures[future], future.exception() or future.result()

        try:
            yield execute
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


@contextmanager
def cluster(address: str) -> Iterator[Execute[Any, Any]]:
    """A Dask cluster by its scheduler's address.

    Raises
    ------
    FileError
        Dask is not installed, or no scheduler answers.
    """
    try:
        import distributed  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise FileError(
            "Dask is not installed; install it with: pip install"
            " 'canopen-robot-identification[dask]'"
        ) from error
    try:
        client = distributed.Client(address)  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        raise FileError(f"{address}: no Dask scheduler answers: {error}") from error
    with client:

        def execute(
            function: Callable[[Any], Any], jobs: Iterable[Any]
        ) -> Iterator[tuple[Any, Any]]:
            futures = {client.submit(function, job, pure=False): job for job in jobs}
            for future in distributed.as_completed(futures):  # type: ignore[no-untyped-call]
                yield futures[future], future.exception() or future.result()

        yield execute
