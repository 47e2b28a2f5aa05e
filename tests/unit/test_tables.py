"""Tables of sweeps as frames of pandas and Parquet files, series of loads from these, and size classes."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import message

import incipient.sweep
from incipient import cli
from incipient.sweep.axes import parsed
from incipient.sweep.cases import Source
from incipient.sweep.request import requested
from incipient.sweep.size_classes import size_classes
from incipient.sweep.store import Store
from incipient.sweep.worker import computed

CASES = Path(__file__).parents[2] / "demos" / "cases"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A sweep of three judged cases, of which one waits and one moves."""
    source = Source.of(CASES / "block_on_incline.toml")
    axes = [parsed("contacts.friction=0.2,0.5,0.6")]
    cases = requested([source], axes, task="judge").cases()
    with Store(tmp_path / "sweep.sqlite", make=True) as store:
        store.add(cases)
        store.finish([(case.identity, 1, computed("judge", case.text)) for case in cases[:2]])
    return tmp_path / "sweep.sqlite"


def assert_same(one: list[dict[str, Any]], other: list[dict[str, Any]]) -> None:
    """The same numbers and words; what a case does not have is missing, not a number or none."""
    assert len(one) == len(other)
    for mine, theirs in zip(one, other, strict=True):
        for name in {*mine, *theirs}:
            a, b = mine.get(name), theirs.get(name)
            none = [
                value is None or (isinstance(value, float) and math.isnan(value))
                for value in (a, b)
            ]
            assert all(none) or (a == b and not any(none)), name


def test_a_frame_has_the_rows(file: Path) -> None:
    pytest.importorskip("pandas")
    frame, rows = incipient.sweep.frame(file), incipient.sweep.rows(file)
    assert frame["contacts.friction"].tolist() == [0.2, 0.5, 0.6]
    assert frame["status"].tolist() == ["done", "done", "waiting"]
    # By hand: (friction cos 20 - sin 20)/0.1, at 0.2 zero.
    assert frame["safety_factor"].tolist()[:2] == pytest.approx([0.0, 1.278], abs=1e-3)
    assert_same(frame.to_dict("records"), rows)


def test_parquet_has_the_rows(file: Path, tmp_path: Path, capsys: Any) -> None:
    pytest.importorskip("pandas")
    parquet = pytest.importorskip("pyarrow.parquet")
    target = tmp_path / "table.parquet"
    assert cli.main(["table", str(file), "--parquet", str(target)]) == 0
    assert capsys.readouterr().out.strip() == str(target)
    assert_same(parquet.read_table(target).to_pylist(), incipient.sweep.rows(file))
    assert cli.main(["table", str(file), "--parquet", str(tmp_path / "absent" / "x.parquet")]) == 5
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize("name", ["pandas", "pyarrow"])
def test_what_is_not_installed_is_said(
    name: str, file: Path, tmp_path: Path, monkeypatch: Any, capsys: Any
) -> None:
    monkeypatch.setitem(__import__("sys").modules, name, None)
    code = cli.main(["table", str(file), "--parquet", str(tmp_path / "table.parquet")])
    complaint = capsys.readouterr().err
    assert (
        code == 6 and complaint.count("\n") == 1 and "pip install 'incipient[tables]'" in complaint
    )


# -- size classes ------------------------------------------------------------------------------------


def grains(path: Path) -> Path:
    """Sizes 1 to 3 whose critical stresses are equal but for 10%: Shields numbers go as 1/D. Some have none."""
    rng = np.random.default_rng(0)
    sizes = rng.uniform(1.0, 3.0, 4000)
    shields = 0.05 / sizes * rng.uniform(0.9, 1.1, 4000)
    shields[::10] = np.inf
    lines = [
        f"{size!r},{value!r}" for size, value in zip(sizes.tolist(), shields.tolist(), strict=True)
    ]
    path.write_text(
        "\n".join(["diameter,shields", *lines, "2.0,"]) + "\n"
    )  # the last carries others
    return path


def test_classes_of_a_table_of_grains(tmp_path: Path) -> None:
    """Percentiles of 0.05/D within the spread of the class: 10% and its width; a tenth is not moved by any flow."""
    found = size_classes(grains(tmp_path / "grains.csv"), [1.0, 1.1, 2.0, 3.0, 5.0])
    assert sum(one["grains"] for one in found) == 4000
    assert [one["without_threshold"] for one in found][:3] == pytest.approx(
        [0.1 * one["grains"] for one in found][:3], rel=0.35
    )
    first = found[0]
    # Nine tenths have thresholds, so that the median of all is their percentile 50/0.9.
    expected = 0.05 / 1.05 * (0.9 + 0.2 * 0.5 / 0.9)
    assert first["shields_50"] == pytest.approx(expected, rel=0.02)
    assert first["shields_16"] < first["shields_50"] < first["shields_84"] < np.inf
    assert found[3] == {"size_low": 3.0, "size_high": 5.0, "grains": 0, "without_threshold": 0}


def test_the_command_prints_csv(tmp_path: Path, capsys: Any) -> None:
    path = grains(tmp_path / "grains.csv")
    assert cli.main(["table", str(path), "--size-classes", "1,2,3"]) == 0
    rows = list(csv.DictReader(io.StringIO(capsys.readouterr().out)))
    assert [row["size_low"] for row in rows] == ["1.0", "2.0"]
    assert float(rows[0]["shields_50"]) > float(rows[1]["shields_50"]) > 0.0
    assert cli.main(["table", str(path), "--size-classes", "1,x"]) == 2
    assert "is not a list of numbers" in capsys.readouterr().err


def test_classes_of_a_sweep(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Cases that are done, by the key that varies; three tell a median and no more, one tells no percentile."""
    sizes = (1.0, 1.5, 1.8, 2.0)
    done = [{"status": "done", "body.diameter": size, "shields": 0.1 * size} for size in sizes]
    found = [*done, {"status": "failed", "body.diameter": 1.2}]
    monkeypatch.setattr("incipient.sweep.size_classes.rows", lambda path: found)
    first, second = size_classes(tmp_path / "sweep.sqlite", [1.0, 2.0, 3.0])
    assert (first["grains"], first["size_median"]) == (3, 1.5)
    assert first["shields_50"] == pytest.approx(0.15)
    assert "shields_84" not in first
    assert second["grains"] == 1 and not any(name.startswith("shields") for name in second)


@pytest.mark.parametrize(
    ("bounds", "size", "said"),
    [
        ([2.0, 1.0], None, "2, 1 do not increase"),
        ([1.0], None, "do not increase"),
        ([1.0, 2.0], "weight", "has no column weight"),
        ([10.0, 20.0], None, "has no threshold of a diameter from 10 to 20"),
    ],
)
def test_what_is_wrong_is_said(
    bounds: list[float], size: str | None, said: str, tmp_path: Path
) -> None:
    path = grains(tmp_path / "grains.csv")
    assert said in message(lambda: size_classes(path, bounds, size))
    assert "cannot be read" in message(lambda: size_classes(tmp_path / "absent.csv", [1.0, 2.0]))
