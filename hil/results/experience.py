"""What earlier runs of a robot teach for the next plan: its noise, and what is known already."""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.yaml_file import FileError
from hil.estimation.lag import find_lags
from hil.estimation.noise_levels import noise_levels
from hil.estimation.signals import NotEnoughData, signals
from hil.planning.measurement import Coupling, Gravity, Inertia
from hil.results.pooling import pooled

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from hil.estimation.noise_levels import Levels
    from hil.estimation.signals import Signals
    from hil.measuring.recording import Recording
    from hil.measuring.run_folder import RunFolder
    from hil.planning.measurement import Element, Measurement


def experience(folders: Sequence[RunFolder]) -> Levels:
    """Noise that runs of one robot show, and what they tell of its parameters.

    Raises
    ------
    FileError
        A damaged recording, or no measurement of use.
    """
    robot = folders[0].robot
    raw = list(_prepared(pooled(folders)))
    if not raw:
        raise FileError(
            f"{folders[0].path}: no measurement of gravity, inertia or coupling is there; measure"
            " some with --resume"
        )
    lag = find_lags(robot, raw).lag
    return noise_levels(robot, [(measurement, s.torque_advanced(lag)) for measurement, s in raw])


def _prepared(
    recordings: Iterable[tuple[Measurement, Recording]],
) -> Iterator[tuple[Element, Signals]]:
    for measurement, recording in recordings:
        if isinstance(measurement, Gravity | Inertia | Coupling):
            try:
                yield measurement, signals(recording)
            except NotEnoughData:
                continue
