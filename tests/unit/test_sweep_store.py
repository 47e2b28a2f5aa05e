"""The file of a sweep: its cases and columns, files of others, damage, a second writer."""

from __future__ import annotations

import json
import math
import random
import sqlite3
from pathlib import Path
from typing import Any

import pytest

from incipient.cli import main
from incipient.errors import OutputError
from incipient.sweep.cases import SweepCase
from incipient.sweep.store import DONE, FAILED, WAITING, Store
from incipient.sweep.table import as_csv, in_words, pockets, rows
from incipient.sweep.worker import CaseOutcome

CASES = [
    SweepCase(f"case{n}", "judge", "made", (f"a.x={n}",), json.dumps({"a": {"x": n}}))
    for n in range(40)
]


def outcome(drag: float) -> CaseOutcome:
    result = json.dumps({"verdict": None, "coefficients": {"drag": drag}, "text": "x" * 3000})
    return CaseOutcome(result, {"drag": drag, "held": True}, wall=1.5, versions={"incipient": "1"})


def filled(path: Path, count: int = 40) -> list[dict[str, Any]]:
    """A file of cases of which `count` are done, and its table."""
    with Store(path, make=True) as store:
        store.add(CASES)
        store.finish([(case.identity, 1, outcome(n)) for n, case in enumerate(CASES[:count])])
        store.write_view()
    return rows(path)


def changed(path: Path, statement: str) -> list[Any]:
    with sqlite3.connect(path) as base:
        found = base.execute(statement).fetchall()
    base.close()
    return found


def test_cases_wait_are_finished_and_wait_again_after_a_failure(tmp_path: Path) -> None:
    path = tmp_path / "sweep.sqlite"
    with Store(path, make=True) as store:
        store.add(CASES[:3])
        store.finish([("case0", 1, outcome(2.0)), ("case1", 3, CaseOutcome(reason="too heavy"))])
        store.add(CASES[:4])
        states = {"case0": DONE, "case1": FAILED, "case2": WAITING, "case3": WAITING}
        assert store.states() == states and store.keys() == ["a.x"]
        assert store.columns(states) == {"case0": {"drag": 2.0, "held": True}}
        store.add(CASES[:2], retry=True)
        assert store.states() == states | {"case1": WAITING}
    first, second, *_ = rows(path)
    assert (first["a.x"], first["drag"], first["versions"]) == (0, 2.0, "incipient 1")
    assert (second["tries"], second["reason"], "drag" in second) == (3, "", False)


def test_the_view_has_varied_keys_and_quantities_infinite_ones_too(tmp_path: Path) -> None:
    path, odd = tmp_path / "sweep.sqlite", SweepCase("odd", "run", "s", ("b.0=1",), '{"b": [7]}')
    with Store(path, make=True) as store:
        store.add([*CASES[:2], odd])
        store.finish([("case1", 1, CaseOutcome("{}", {"shields": math.inf}))])
        store.finish([("odd", 1, CaseOutcome("{}", {"shields": 0.5}))])
        store.write_view()
    query = 'SELECT "a.x", "b.0", shields, status FROM results'
    expected = [(0, None, None, WAITING), (1, None, math.inf, DONE)]
    assert changed(path, query) == [*expected, (None, 7, 0.5, DONE)]
    assert rows(path)[1]["shields"] == math.inf


def test_files_of_others_and_of_other_versions_are_refused(tmp_path: Path) -> None:
    text, other, old = (tmp_path / f"{name}.sqlite" for name in ("text", "other", "old"))
    text.write_text("not a database, but long enough to have the head of one\n" * 20)
    changed(other, "CREATE TABLE things (id TEXT)")
    filled(old, 0)
    changed(old, "PRAGMA user_version = 4")
    for path, words in (
        (text, "is not the file of a sweep"),
        (other, "is not the file of a sweep"),
        (old, "is the file of a sweep by another version of incipient; give another name"),
    ):
        with pytest.raises(OutputError, match=words):
            Store(path, make=True)
    with pytest.raises(OutputError, match="no such file"):
        Store(tmp_path / "absent.sqlite")


def test_a_second_writer_is_refused_and_readers_are_not(tmp_path: Path) -> None:
    path = tmp_path / "sweep.sqlite"
    filled(path, 1)
    with Store(path, make=True) as store:
        with pytest.raises(OutputError, match="another sweep writes to it; wait"):
            Store(path, make=True)
        assert len(rows(path)) == 40
        store.finish([("case1", 1, outcome(1.0))])
    with Store(path, make=True) as store:
        assert store.states()["case1"] == DONE


def test_random_bytes_give_one_line_or_a_table(tmp_path: Path) -> None:
    """Bytes at random places, as of a bad disk, in 200 files: no other error."""
    path, broken = tmp_path / "whole.sqlite", tmp_path / "broken.sqlite"
    filled(path)
    content, refused = path.read_bytes(), 0
    for seed in range(200):
        chance, damaged = random.Random(seed), bytearray(content)
        for place in (chance.randrange(len(content)) for _ in range(chance.choice((1, 20, 200)))):
            damaged[place] = chance.randrange(256)
        broken.write_bytes(damaged)
        try:
            table = rows(broken)
            as_csv(table), [in_words(row) for row in table]
        except OutputError as error:
            assert len(str(error)) < 400 and "\n" not in str(error)
            refused += 1
    assert refused > 40


def test_the_table_prints_the_first_cases_and_counts_all(
    tmp_path: Path, capsys: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("incipient.commands.tabulate.FIRST", 30)
    path = tmp_path / "sweep.sqlite"
    filled(path, 38)
    assert main(["table", str(path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 32
    assert lines[-1].startswith("40 cases: 38 done, 2 waiting; the first 30 are shown")


def at_rest(slope: float, *centre: float, **columns: float) -> dict[str, Any]:
    """The row of a grain of size 20 on a bed with a slope."""
    axes = {f"centre_{axis}": x for axis, x in zip("xyz", centre, strict=True) if x}
    return {"bed.slope": slope, "fluid.reynolds": 1.0, "grain_size": 20.0, **axes, **columns}


@pytest.mark.parametrize(
    ("second", "line"),
    [
        (at_rest(5.0, 60.0, 0.0, 9.0), None),
        (at_rest(5.0, 60.1, 0.0, 9.0), None),  # half a percent of its size
        (at_rest(5.0, 62.0, 0.0, 9.0), "(0.1 of its size apart, 0 degrees turned)"),
        # In place, but turned by 0.1 rad about y: 5% of its size on its surface; in 2-D by an angle.
        (at_rest(5.0, 60.0, 0.0, 9.0, rotation_y=0.1), "(0 of its size apart, 5.7 degrees turned)"),
        (at_rest(5.0, 60.0, 0.0, 9.0, rotation=-0.1), "(0 of its size apart, 5.7 degrees turned)"),
        (at_rest(5.0, 62.0, 0.0, 9.0) | {"fluid.reynolds": 2.0}, None),  # no neighbour
        ({"bed.slope": 5.0, "fluid.reynolds": 1.0}, None),  # failed
    ],
)
def test_neighbours_that_rest_elsewhere_are_named(second: dict[str, Any], line: str | None) -> None:
    lines = pockets([second, at_rest(0.0, 60.0, 0.0, 9.0)], ["bed.slope", "fluid.reynolds"])
    assert len(lines) == (line is not None)
    if line is not None:
        assert lines[0].startswith(
            "bed.slope = 0 and 5: the grain rests on other points of the bed"
        )
        assert line in lines[0] and 'body.settle = "level"' in lines[0]


def test_a_grain_moved_by_its_own_section_is_not_named() -> None:
    table = [at_rest(0.0, x, 0.0, 9.0) | {"body.x": x} for x in (60.0, 70.0)]
    assert pockets(table, ["body.x"]) == []
