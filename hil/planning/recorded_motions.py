"""What stands in a run's folder in place of a plan where its recordings come from elsewhere."""

from __future__ import annotations

import hashlib
from typing import Literal

import yaml
from pydantic import Field

from checked_files.yaml_file import FileModel
from hil.planning.free_motion import FreeMotion
from hil.planning.plan import PlannedRobot


class RecordedMotions(FileModel):
    """Motions that somebody else recorded of a robot; nothing of it can be measured again.

    Attributes
    ----------
    map_digest : str
        SHA-256 of the map that the recordings were read with.
    """

    format: Literal[1] = 1
    robot: PlannedRobot
    map_digest: str
    measurements: tuple[FreeMotion, ...] = Field(min_length=1)

    @property
    def digest(self) -> str:
        """Fingerprint of the content."""
        return hashlib.sha256(self.text().encode()).hexdigest()

    def text(self) -> str:
        """As YAML."""
        return yaml.safe_dump(
            self.model_dump(mode="json", exclude_none=True), sort_keys=False, width=200
        )
