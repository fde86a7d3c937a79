"""Fixture that calls the command line."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import pytest

from hil import cli

if TYPE_CHECKING:
    from command_line import Hil


@pytest.fixture
def hil(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, wide_console: None
) -> Hil:
    """Call the command line; return exit status, standard output and standard error."""
    monkeypatch.setattr("sys.stdin", io.StringIO())

    def call(*arguments: object) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as left:
            cli.main([str(argument) for argument in arguments])
        printed = capsys.readouterr()
        assert "Traceback" not in printed.out + printed.err
        return int(left.value.code or 0), printed.out, printed.err

    return call
