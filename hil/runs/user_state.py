"""State directory of the user, and the secret key for files that a command wrote for itself."""

from __future__ import annotations

import os
import secrets
import tempfile
from contextlib import suppress
from functools import cache
from pathlib import Path

STATE = "XDG_STATE_HOME"


def state_folder() -> Path:
    """Return the folder of this program in the user's state directory."""
    stated = os.environ.get(STATE, "")
    home = Path(stated) if Path(stated).is_absolute() else Path.home() / ".local" / "state"
    return home / "hil"


def own_key() -> bytes:
    """Return the secret key of this user, or a key of this process alone if none can be stored."""
    try:
        return _key(state_folder() / "key")
    except RuntimeError:  # a user without a home
        return _key(None)


@cache
def _key(path: Path | None) -> bytes:
    made = secrets.token_bytes(32)
    if path is None:
        return made
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent) as file:  # readable by the user alone
            file.write(made)
            file.flush()
            with suppress(FileExistsError):
                os.link(file.name, path)  # written at once; the first process determines the key
        return path.read_bytes()
    except OSError:
        return made
