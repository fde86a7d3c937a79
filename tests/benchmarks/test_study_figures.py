"""Figures of a study in table, picture and terminal."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from rich.console import Console

from benchmarks import figures
from benchmarks.drift_study import summary, view
from benchmarks.drift_study.__main__ import CHANGING, _command
from benchmarks.drift_study.cell import OUR_DEFAULT, Cell, Outcome
from benchmarks.drift_study.drift import Judged
from benchmarks.drift_study.scenarios import SCENARIOS
from benchmarks.plotting import plotting

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.text import Text


def outcome(method: str, torque: float, inside: int = 14, **groups: float) -> Outcome:
    errors = {"gravity": 0.1, "diagonal": 0.2, "off_diagonal": 0.3} | groups
    return Outcome(method, errors, torque, inside, 14, [0.0] * 14)


def judge_seed(
    seed: int, *outcomes: Outcome, scenario: str = "on", kind: str = "two-step"
) -> Judged:
    return Judged(Cell(Path("study"), scenario, kind, seed, seed + 1), outcomes)


class TestFigures:
    def test_errors_are_root_mean_squares_over_the_seeds(self) -> None:
        found = [
            judge_seed(1, outcome(OUR_DEFAULT, 0.03, gravity=0.01)),
            judge_seed(2, outcome(OUR_DEFAULT, 0.04, gravity=0.07)),
        ]
        (row,) = summary.summarise(found)
        assert (row.scenario, row.method, row.n) == ("on", OUR_DEFAULT, 2)
        assert row.torque_error == pytest.approx(np.sqrt((0.03**2 + 0.04**2) / 2))
        assert row.group_error["gravity"] == pytest.approx(0.05)
        assert row.torque_errors == (0.03, 0.04)

    def test_ratios_are_those_to_our_default_in_the_same_scenario(self) -> None:
        found = [
            judge_seed(1, outcome(OUR_DEFAULT, 0.01), outcome("rival", 0.05)),
            judge_seed(1, outcome(OUR_DEFAULT, 0.02), outcome("rival", 0.06), scenario="off"),
        ]
        ratio = {(row.scenario, row.method): row.ratio for row in summary.summarise(found)}
        assert ratio["on", "rival"] == pytest.approx(5)
        assert ratio["off", "rival"] == pytest.approx(3)
        assert ratio["off", OUR_DEFAULT] == 1

    def test_without_our_default_there_is_no_ratio(self) -> None:
        (row,) = summary.summarise([judge_seed(1, outcome("rival", 0.05))])
        assert np.isnan(row.ratio)

    def test_coverage_counts_intervals_of_all_seeds(self) -> None:
        found = [judge_seed(k, outcome("rival", 0.1, inside=n)) for k, n in ((1, 14), (2, 7))]
        assert summary.summarise(found)[0].coverage == pytest.approx(0.75)

    def test_they_are_kept_by_scenario_and_method(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(figures, "RESULTS", tmp_path)
        found = [judge_seed(seed, outcome("jointly: rival", 0.01 * seed)) for seed in (1, 3)]
        given = {
            **dict.fromkeys(CHANGING),
            "seeds": 2,
            "first_seed": 1,
            "scenario": ["on"],
            "kind": (),
        }
        summary.keep_figures(summary.summarise(found), (1, 3), _command(given))
        kept = figures.read("drift")
        assert kept.command.endswith("-o FOLDER --seeds 2 --first-seed 1 --scenario on")
        assert [(name, each.stated) for name, each in kept.figures.items()] == [
            ("on-jointly-rival", "2.2 ± 1 %"),
            ("on-jointly-rival-diagonal", "20 %"),
            ("on-jointly-rival-inside", "100 %"),
        ]

    def test_scenarios_and_campaigns_stand_in_their_order_whatever_failed(self) -> None:
        found = [
            judge_seed(1, outcome("rival", 1.0), scenario="load", kind="trajectory"),
            judge_seed(1, outcome("rival", 1.0), scenario="off", kind="trajectory"),
            judge_seed(2, outcome(OUR_DEFAULT, 1.0), scenario="load"),
        ]
        order = [(row.scenario, row.method) for row in summary.summarise(found)]
        assert order == [("off", "rival"), ("load", OUR_DEFAULT), ("load", "rival")]


@pytest.fixture(scope="module")
def rows() -> list[summary.MethodScore]:
    """Rows of all scenarios and methods, with errors from hundredths to thousands of per cent."""
    names = {
        "two-step": (OUR_DEFAULT, "two-step, printed"),
        "trajectory": (
            "jointly: residual weights, model 2, offset and load",
            "jointly: friction by period",
        ),
        "compensated": ("beforehand: same session", "beforehand: other session"),
        "warmed": ("beforehand after warm-up: other session",),
    }
    found = [
        judge_seed(
            seed,
            *(outcome(name, 2e-4 * seed * 12**k, gravity=1.2345 * 10**-k) for name in methods),
            scenario=scenario,
            kind=kind,
        )
        for scenario in SCENARIOS
        for k, (kind, methods) in enumerate(names.items())
        for seed in (1, 2, 3)
    ]
    return summary.summarise(found)


def ticks_shown(panel: Axes) -> list[Text]:
    """Return labels of ticks within the limits; matplotlib adds ticks outside."""
    low, high = panel.get_xlim()
    return [label for label in panel.get_xticklabels() if low <= label.get_position()[0] <= high]


@pytest.fixture(scope="module")
def written(rows: list[summary.MethodScore], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("written")
    summary.write(folder, rows)
    return folder


class TestOutput:
    def test_the_table_holds_every_row_with_its_figures(
        self, rows: list[summary.MethodScore], written: Path
    ) -> None:
        found = list(csv.DictReader((written / summary.TABLE).read_text().splitlines()))
        assert [(line["scenario"], line["method"]) for line in found] == [
            (row.scenario, row.method) for row in rows
        ]
        for line, row in zip(found, rows, strict=True):
            assert float(line["torque"]) == pytest.approx(row.torque_error, rel=1e-5)
            assert float(line["gravity"]) == pytest.approx(row.group_error["gravity"], rel=1e-5)
            assert float(line["ratio"]) == pytest.approx(row.ratio, rel=1e-5)
            assert (float(line["coverage"]), line["seeds"]) == (1.0, "3")

    def test_the_picture_is_written_in_both_kinds(self, written: Path) -> None:
        assert (written / "study.png").read_bytes().startswith(b"\x89PNG")
        assert "</svg>" in (written / "study.svg").read_text()

    @pytest.mark.parametrize("scenarios", [("on",), tuple(SCENARIOS)])
    def test_no_text_of_the_picture_meets_another_or_the_edge(
        self, rows: list[summary.MethodScore], scenarios: Sequence[str]
    ) -> None:
        with plotting():
            figure = summary.picture([row for row in rows if row.scenario in scenarios])
            FigureCanvasAgg(figure).draw()
        axes = figure.axes
        texts = [panel._left_title for panel in axes]
        texts += [*axes[0].get_yticklabels(), figure._supxlabel]
        texts += [label for panel in axes for label in ticks_shown(panel)]
        boxes = [text.get_window_extent() for text in texts if text.get_text()]
        assert len(boxes) > len(scenarios) + 7
        for k, box in enumerate(boxes):
            assert 0 <= box.x0 < box.x1 <= figure.bbox.x1
            assert 0 <= box.y0 < box.y1 <= figure.bbox.y1
            assert not any(box.overlaps(other) for other in boxes[:k])

    def test_errors_are_on_a_logarithmic_scale_with_plain_numbers(
        self, rows: list[summary.MethodScore]
    ) -> None:
        (panel, *_) = summary.picture(rows).axes
        assert panel.get_xscale() == "log"
        assert panel.xaxis.get_major_formatter()(0.1, 0) == "0.1"
        assert panel.xaxis.get_major_formatter()(100, 0) == "100"

    def test_the_terminal_shows_whole_names_and_figures_in_100_columns(
        self, rows: list[summary.MethodScore]
    ) -> None:
        console = Console(width=100, record=True, file=io.StringIO())
        view.render(rows, console)
        text = console.export_text()
        assert "…" not in text
        assert "e+" not in text
        for part in ("beforehand after warm-up:", "residual weights, model 2", "off-", "seeds"):
            assert part in text
        lines = [line for line in text.splitlines() if line.startswith(OUR_DEFAULT)]
        assert len(lines) == len(SCENARIOS)
        assert all(len(line.split()) == 10 for line in lines)
