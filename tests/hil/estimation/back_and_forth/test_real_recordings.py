"""Recording of a real carriage that moves back and forth, if available."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from real_recordings import DATA, EMPS, at_hand

from hil.estimation.back_and_forth import NAME
from hil.imports.importing import import_recordings
from hil.results.identification import identify, method_for

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = at_hand


def test_mass_and_friction_are_the_published_ones(tmp_path: Path) -> None:
    (tmp_path / "map.yaml").write_text(EMPS)
    run = import_recordings([tmp_path / "map.yaml"], tmp_path / "run", files=[DATA])
    assert method_for(run)[0] == NAME
    model = identify(run)
    fit = model.details
    assert fit is not None
    assert model.values[0] == pytest.approx(95.11, rel=0.01)
    low, high = model.interval()[0]
    assert low < 95.11 < high
    (curve,) = fit.curves
    assert curve.plain["Coulomb"].value == pytest.approx(20.39, rel=0.03)
    assert curve.plain["viscous"].value == pytest.approx(203.5, rel=0.03)
    # the curve itself deviates from the straight line
    for point in curve.points:
        assert point.friction == pytest.approx(20.39 + 203.5 * point.speed, rel=0.06)
    assert fit.overall_residual < 0.037
    assert not fit.not_identified
