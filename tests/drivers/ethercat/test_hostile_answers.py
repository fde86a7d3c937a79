"""Any answer of slaves leads to an error of the driver at most, with axes off."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hostile.ethercat_answers import storm
from hypothesis import given
from hypothesis import strategies as st

from drivers.ethercat.line import Command, Datagram, answers_of
from drivers.ethercat.mailbox import SdoClient
from drivers.remote_dictionary import AccessRefused, NoAnswer

if TYPE_CHECKING:
    from collections.abc import Callable

    from drivers.drives_file import DrivesFile


def test_no_answer_upsets_the_driver_or_leaves_an_axis_under_power(drives: DrivesFile) -> None:
    assert storm(1, 300, drives).sessions > 3


@given(st.binary(max_size=200))
def test_a_frame_of_any_content_is_an_answer_or_none(frame: bytes) -> None:
    asked = [Datagram(Command.FPRD, 0, bytes(4)), Datagram(Command.BRD, 0, bytes(2))]
    answers = answers_of(frame, asked)
    assert answers is None or [len(answer.data) for answer in answers] == [4, 2]


class OfAnyContent:
    """Mailbox with services of arbitrary content that pass for answers."""

    capacity = 506

    def __init__(self, services: list[bytes]) -> None:
        self._services = services

    def exchange(self, service: bytes, is_answer: Callable[[bytes], bool], timeout: float) -> bytes:
        while self._services:
            found = self._services.pop()
            if is_answer(found):
                return found
        raise NoAnswer("none", "")


services = st.builds(
    lambda kind, command, rest: bytes([0, kind << 4, command, 0x00, 0x10, 0x00]) + rest,
    st.sampled_from([2, 3]),
    st.integers(0, 255),
    st.binary(max_size=40),
)


@given(st.lists(st.one_of(services, st.binary(max_size=30)), max_size=30))
def test_services_of_any_content_are_a_value_a_refusal_or_none(found: list[bytes]) -> None:
    client = SdoClient(OfAnyContent(found), 0.0)  # type: ignore[arg-type]
    try:
        assert len(client.upload(0x1000, 0)) <= 4096
    except (AccessRefused, NoAnswer):
        return


@pytest.mark.parametrize("size", [1, 2, 4])
def test_a_value_without_a_stated_size_has_that_of_its_object(size: int) -> None:
    answer = bytes([0, 0x30, 0x42, 0x00, 0x10, 0x00, 1, 2, 3, 4])
    client = SdoClient(OfAnyContent([answer]), 0.0)  # type: ignore[arg-type]
    assert client.upload(0x1000, 0, size) == bytes([1, 2, 3, 4])[:size]
