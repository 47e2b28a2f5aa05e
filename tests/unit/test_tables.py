"""Tables of sweeps as frames of pandas and Parquet files, and series of loads from these."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import incipient.sweep
from incipient import cli
from incipient.simulation.judge_series import read_columns
from incipient.sweep.axes import parsed
from incipient.sweep.cases import Source
from incipient.sweep.request import requested
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


def test_series_of_loads_come_from_parquet(tmp_path: Path, capsys: Any) -> None:
    pyarrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    time = np.linspace(0.0, 1.0, 11)
    columns = {"time": time, "force_x": 0.3 * time, "force_y": 0.0 * time, "couple": 0.0 * time}
    path = tmp_path / "forces.parquet"
    parquet.write_table(pyarrow.table(columns), path)
    found = read_columns(path)
    assert list(found) == list(columns) and all(
        (found[name] == columns[name]).all() for name in columns
    )
    assert cli.main(["judge", str(CASES / "block_on_incline.toml"), "--series", str(path)]) == 0
    assert "11 from 0 to 1" in capsys.readouterr().out
    path.write_bytes(b"no Parquet")
    assert cli.main(["judge", str(CASES / "block_on_incline.toml"), "--series", str(path)]) == 2
    complaint = capsys.readouterr().err
    assert complaint.count("\n") == 1 and "give a Parquet file of numbers" in complaint


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
