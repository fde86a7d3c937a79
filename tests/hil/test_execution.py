"""A single job needs no process; an error is the job's result."""

from __future__ import annotations

import os

import pytest

from hil.execution import local


def process_of(job: int) -> int:
    """Return the id of the executing process."""
    if job < 0:
        raise ValueError("must not be negative")
    return os.getpid()


def test_a_single_job_is_executed_in_this_process() -> None:
    with local(2) as execute:
        assert list(execute(process_of, [1])) == [(1, os.getpid())]
        [(job, error)] = execute(process_of, [-1])
        assert list(execute(process_of, [])) == []
    assert job == -1
    assert isinstance(error, ValueError)


@pytest.mark.long
def test_several_jobs_are_executed_in_others() -> None:
    with local(2) as execute:
        found = dict(execute(process_of, [1, 2]))
    assert set(found) == {1, 2}
    assert os.getpid() not in found.values()
