"""Where a model comes from, as its file states it."""

from __future__ import annotations

from checked_files.yaml_file import FileModel
from hil.runs.journal import was_simulated


class Provenance(FileModel):
    """Where a model comes from.

    `together_with` names further runs that it was made from, `without` measurements that whoever
    identified it left out, `drives` what each axis's drive said it is, in the last session; empty
    where that was not recorded. `simulated` is whether any of the runs was measured on the virtual
    plant, `recordings` a digest of each recording (`hil.results.stamp.digests`); None and empty in
    files of earlier versions.
    """

    robot: str
    robot_digest: str
    plan_digest: str
    measured: str
    bus: str
    simulated: bool | None = None
    drives: tuple[str, ...] = ()
    measurements: int
    missing: int = 0
    together_with: tuple[str, ...] = ()
    left_out: tuple[str, ...]
    without: tuple[str, ...] = ()
    identified: str
    method: str
    version: str
    recordings: tuple[str, ...] = ()

    @property
    def of_virtual_plant(self) -> bool:
        """Whether any of what the model was made from was measured on the virtual plant."""
        return was_simulated(self.simulated, self.bus)
