"""Thinned evidence: many friction terms remove rows, many recordings remove whole blocks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from free_run import TRUTH, arm, recorded

from hil.estimation.excluded import proof
from hil.estimation.excluded.columns import EvidenceRows
from hil.estimation.excluded.evidence import Evidence
from hil.least_squares.window import smooth


def evidence(n_parts: int, rows: int, rank: int, n_own: int = 2) -> Evidence:
    """Return evidence of two channels: blocks, rows of each block, and rank of the friction."""
    rng = np.random.default_rng(n_parts)
    n = 2 * n_parts * rows
    parts = tuple(
        (slice(k * rows, (k + 1) * rows), np.linalg.qr(rng.standard_normal((rows, rank)))[0])
        for k in range(2 * n_parts)
    )
    return Evidence(
        axis=np.repeat([0, 1], n // 2),
        group=np.repeat(np.arange(2 * n_parts), rows),
        torque=rng.standard_normal(n),
        recorded=rng.standard_normal(n),
        rate=rng.standard_normal(n),
        X=rng.standard_normal((n, 3)),
        own=rng.standard_normal((n, n_own)),
        motion=rng.standard_normal((3, 3, n, 2)),
        period=np.full(n, 0.01),
        time=0.01 * np.arange(n),
        parts=parts,
        finest=np.zeros(2),
        signals=(),
        source=np.zeros(n, dtype=int),
        sample=np.arange(n),
    )


@pytest.mark.parametrize(("n_parts", "rows"), [(3, 800), (68, 35), (150, 40), (40, 15)])
def test_as_many_rows_as_are_asked_for_are_left_beside_friction(n_parts: int, rows: int) -> None:
    thin, at = evidence(n_parts, rows, 4).thinned(250)
    left = np.array([(thin.axis == channel).sum() for channel in (0, 1)], dtype=float)
    for rows_of_part, Q in thin.parts:
        left[thin.axis[rows_of_part.start]] -= Q.shape[1]
    assert np.all(left >= 250)
    assert np.all(left <= 2 * (250 + 4 * n_parts))
    assert len(at) == len(thin.axis)


@pytest.mark.parametrize(("period", "step"), [(0.016, 1), (0.004, 3), (0.004, 12)])
def test_rows_that_share_samples_scatter_between_groups_by_white_noise(
    period: float, step: int
) -> None:
    """At a SYNC of 16 ms "scatter between measurements" was found in white noise."""
    rows, draws = 200, 4000
    noise = np.random.default_rng(1).standard_normal((step * rows + 40, draws))
    smoothed = smooth(noise, period)[20 : 20 + step * rows : step]
    shown = smoothed.sum(axis=0).var() / rows / smoothed.var()
    whole = evidence(2, rows, 1)
    found = replace(whole, period=np.full(len(whole.axis), period), sample=step * whole.sample)
    assert found.overlap == pytest.approx(shown, rel=0.08)


def test_without_own_columns_nothing_is_left_along_them() -> None:
    whole = evidence(5, 60, 3)
    bare = whole.project_out_own()
    rows = bare.project_out_friction(np.column_stack([whole.torque, whole.X]))
    for channel in (0, 1):
        of = whole.axis == channel
        own = whole.project_out_friction(whole.own)[of]
        assert np.abs(own.T @ rows[of]).max() < 1e-9
    counts = [e.blocks(np.zeros((len(e.axis), 1)), 0).counts[0] for e in (whole, bare)]
    assert (counts[0] - counts[1]).tolist() == [2.0, 2.0]


@pytest.mark.parametrize(("enough", "kept"), [(9, 9), (8, 5), (4, 3), (2, 2), (0.5, 1)])
def test_of_many_free_motions_every_so_many_are_looked_at_whole(
    monkeypatch: pytest.MonkeyPatch, enough: float, kept: int
) -> None:
    data = recorded(arm(), TRUTH, n=9)
    monkeypatch.setattr(proof, "ENOUGH", 1.0001 * enough * data[0][0].duration)
    found = list(proof._prepared(data))
    names = [motion.id for motion, _ in data]
    places = [names.index(motion.id) for motion, _ in found]
    assert len(found) == kept
    assert len(set(np.diff(places))) <= 1
    assert all(len(s.time) == len(data[0][1].time) for _, s in found)


def test_columns_in_the_span_of_friction_make_no_torque() -> None:
    """Rounding leaves 1e-10 of such a column, which must not carry the residual torque."""
    made, rng = evidence(4, 100, 3), np.random.default_rng(1)
    own = np.zeros_like(made.own)
    for rows, Q in made.parts:
        own[rows] = Q @ rng.standard_normal((3, 2)) + 1e-10 * rng.standard_normal((100, 2))
    p, X = np.zeros(len(TRUTH)), np.zeros((len(own), len(TRUTH)))
    found = EvidenceRows(arm(), p, replace(made, own=own, X=X)).own_torque
    assert np.abs(found).max() < 1e-3
