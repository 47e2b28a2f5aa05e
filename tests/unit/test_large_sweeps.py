"""Sweeps with very many cases: the quick table is the slow one, and pictures are of the same numbers."""

from __future__ import annotations

import csv
import json
import math
import sqlite3
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from incipient.cli import main
from incipient.errors import OutputError, SceneError
from incipient.pictures.charts import many_cases
from incipient.sweep import store as stores
from incipient.sweep.cases import SweepCase
from incipient.sweep.store import CaseOutcome, Store
from incipient.sweep.table import rows

NUMBER = 400
NAMES = ("a.x", "a.y")


def case(number: int) -> tuple[SweepCase, CaseOutcome]:
    """Two keys; a safety factor that varies by chance, is infinite in some cases, and missing in those that fail."""
    chance = np.random.default_rng(number)
    x, y = float(chance.uniform(1.0, 20.0)), int(chance.integers(1, 4))
    factor = None if number % 50 == 7 else x * y * float(chance.uniform(0.05, 0.15))
    moves = factor is not None and factor < 1.0
    paper = {"moves": moves, "wording": "sliding"}
    verdict = {"mode": "sliding" if moves else "rest", "moves": moves, "safety_factor": factor}
    result: dict[str, Any] | None = {"verdict": {**verdict, "judges": {"criteria": paper}}}
    reason = ""
    if number % 40 == 3:
        result, reason = None, "too heavy"
    text = json.dumps({"a": {"x": x, "y": y}})
    outcome = CaseOutcome(result, reason, 0.5, 0.25, 80.0, {"incipient": "1", "numpy": "2"})
    return SweepCase(
        f"{number:05d}", "judge", f"made {number % 2}", (f"a.x={x}",), text, ""
    ), outcome


@pytest.fixture
def large(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A file of 400 cases, twenty of which wait, where that is many."""
    both, path = [case(n) for n in range(NUMBER)], tmp_path / "large.sqlite"
    with Store(path, make=True) as store:
        store.add([one for one, _ in both], NAMES)
        taken = [one.identity for one, _ in both[: NUMBER - 20]]
        assert store.claim(taken) == set(taken)
        store.finish({one.identity: outcome for one, outcome in both[: NUMBER - 20]})
    monkeypatch.setattr(stores, "LARGE", 100)
    return path


def test_the_quick_table_is_that_of_the_results(
    large: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """But for the keys of cases that wait, whose scenes are not read."""
    quick = rows(large)
    monkeypatch.setattr(stores, "LARGE", NUMBER)
    slow = rows(large)
    finished = [row for row in slow if row["status"] != "waiting"]
    assert [row for row in quick if row["status"] != "waiting"] == finished
    assert [type(value) for value in quick[0].values()] == [
        type(slow[0][name]) for name in quick[0]
    ]
    assert [row["id"] for row in quick] == [row["id"] for row in slow]
    assert any(math.isinf(row.get("safety_factor", 0.0)) for row in quick)


def test_a_file_of_before_is_given_its_columns(large: Path) -> None:
    quick = rows(large)
    with sqlite3.connect(large) as base:
        base.executescript("DROP TABLE shown; DROP INDEX cases_by_status; PRAGMA user_version = 3;")
    base.close()
    whole = rows(large)
    assert [row for row in whole if row["status"] != "waiting"] == [
        r for r in quick if r["status"] != "waiting"
    ]
    with Store(large, make=True) as store:
        assert store.is_large
    assert rows(large) == quick


def test_the_table_prints_the_first_cases_and_counts_all(
    large: Path, capsys: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert main(["table", str(large)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1].startswith(
        "400 cases: 370 done, 10 failed, 20 waiting; the first 300 are shown"
    )
    assert len(lines) == 302
    assert main(["table", str(large), "--csv"]) == 0
    quick = capsys.readouterr().out.splitlines()
    monkeypatch.setattr(stores, "LARGE", NUMBER)
    assert main(["table", str(large), "--csv"]) == 0
    slow = capsys.readouterr().out.splitlines()
    assert (
        sorted(quick[0].split(",")) == sorted(slow[0].split(",")) and len(quick) == len(slow) == 401
    )
    for one, other in zip(csv.DictReader(quick[:380]), csv.DictReader(slow[:380]), strict=True):
        assert one == other


def lines_of(figure: Figure) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    return {
        str(line.get_label()): (line.get_xdata(), line.get_ydata()) for line in figure.axes[0].lines
    }


def test_curves_are_medians_of_the_results(large: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By numpy's lower and upper medians of the cases in each bin."""
    monkeypatch.setattr(many_cases, "BINS", 12)
    with Store(large) as store:
        drawn = many_cases.figures(store, None, "a.x", "a.y")
    assert drawn.keys() == {"safety_factor", "map"}
    done = [row for row in rows(large) if math.isfinite(row.get("safety_factor", math.inf))]
    for label in ("1", "2", "3"):
        x, y = lines_of(drawn["safety_factor"])[label]
        mine = [row for row in done if row["a.y"] == int(label)]
        place = np.array([row["a.x"] for row in mine])
        factor = np.array([row["safety_factor"] for row in mine])
        assert len(x) > 6 and len(place) > 100
        ratio = (place.max() / place.min()) ** (0.5 / 12)
        for middle, median in zip(x, y, strict=True):
            inside = factor[
                (place >= middle / ratio * (1 - 1e-12)) & (place <= middle * ratio * (1 + 1e-12))
            ]
            assert len(inside) >= many_cases.LEAST
            low, high = (np.quantile(inside, 0.5, method=one) for one in ("lower", "higher"))
            assert low <= median <= high


def test_a_map_is_of_the_results(large: Path) -> None:
    """Means of the logarithm in cells of few values along y, by going through all cases."""
    with Store(large) as store:
        figure = many_cases.figures(store, None, "a.x", "a.y")["map"]
    (mesh,) = (
        one
        for one in figure.axes[0].collections
        if one.get_array() is not None and one.get_array().ndim == 2
    )
    means = mesh.get_array()
    done = [row for row in rows(large) if math.isfinite(row.get("safety_factor", math.inf))]
    every = np.log([row["a.x"] for row in rows(large) if "a.x" in row])
    low, high = every.min(), every.max()
    sums: dict[tuple[int, int], list[float]] = {}
    for row in done:
        column = min(
            int((math.log(row["a.x"]) - low) / (high - low) * many_cases.CELLS),
            many_cases.CELLS - 1,
        )
        sums.setdefault((row["a.y"] - 1, column), []).append(math.log10(row["safety_factor"]))
    assert means.count() == len(sums)
    for cell, values in sums.items():
        assert means[cell] == pytest.approx(np.mean(values), abs=1e-12)


def test_what_cannot_be_drawn_is_refused(large: Path, tmp_path: Path) -> None:
    with Store(large) as store:
        with pytest.raises(SceneError, match="has no column nonsense"):
            many_cases.figures(store, "nonsense", None, None)
        with pytest.raises(SceneError, match="paper is not a number"):
            many_cases.figures(store, "paper", None, None)
    with Store(tmp_path / "empty.sqlite", make=True) as store:
        store.add([case(n)[0] for n in range(NUMBER)], NAMES)
        assert store.is_large
        with pytest.raises(OutputError, match="no case has been computed"):
            many_cases.figures(store, None, None, None)


@pytest.mark.slow
def test_pictures_and_page_of_a_large_sweep(large: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In processes of their own, for which this one is no large one: as they were before."""
    assert main(["report", str(large)]) == 0
    page = large.with_name("large_report.html").read_text()
    assert (
        "400 cases: 370 computed, 10 failed, 20 not computed yet. Tables are of the first 300."
        in page
    )
