"""What a sweep varies, the identity of its cases, and the file that keeps them."""

from __future__ import annotations

import sqlite3
import subprocess
import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import message

from incipient.cli import main
from incipient.errors import OutputError
from incipient.pictures.charts.sweep_axes import soulsby_whitehouse
from incipient.progress import Silent
from incipient.scene import Scene, example, load
from incipient.scene.key_units import unit_of
from incipient.sweep.axes import combined, of_mapping, parsed, table_of_cases
from incipient.sweep.call import Means
from incipient.sweep.cases import Source, SweepCase, resolved
from incipient.sweep.dry_run import foretold, sampled
from incipient.sweep.request import parsed_seconds, requested
from incipient.sweep.store import DONE, RUNNING, WAITING, CaseOutcome, Store

SOURCE = Source("mine", example())
# Claims the first case of a file and is killed.
CLAIM = """
import os, signal, sys
from pathlib import Path
from incipient.sweep.store import Store
store = Store(Path(sys.argv[1]))
assert store.claim(["a"])
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_ranges_hold_both_ends_and_equal_ratios_or_differences() -> None:
    assert parsed("fluid.reynolds=log:0.1:1000:5").values == (
        "0.1",
        "1.0",
        "10.0",
        "100.0",
        "1000.0",
    )
    assert parsed("contact.friction=lin:0.2:0.6:3").values == ("0.2", "0.4", "0.6")
    assert parsed('a.b=1,[2, 3],"x, y",log:1:4:2').values == ("1", "[2, 3]", '"x, y"', "1.0", "4.0")


def test_axes_of_python_and_toml_are_those_of_the_command_line() -> None:
    nested = {
        "fluid": {"reynolds": "log:1:100:3"},
        "bed.offset": [[0.0, 1.0]],
        "flow.kind": ["shear"],
    }
    assert of_mapping(nested) == [
        parsed("fluid.reynolds=1.0,10.0,100.0"),
        parsed("bed.offset=[0.0, 1.0]"),
        parsed("flow.kind=shear"),
    ]
    assert of_mapping({"body.diameter": np.array([0.5, 1.0])}) == [parsed("body.diameter=0.5,1.0")]


def test_cases_are_combinations_or_pairs_for_each_row_of_a_table(tmp_path: Path) -> None:
    axes = [parsed("a.x=1,2"), parsed("a.y=3,4")]
    assert combined(axes, False) == [
        ("a.x=1", "a.y=3"),
        ("a.x=1", "a.y=4"),
        ("a.x=2", "a.y=3"),
        ("a.x=2", "a.y=4"),
    ]
    assert combined(axes, True) == [("a.x=1", "a.y=3"), ("a.x=2", "a.y=4")]
    path = tmp_path / "cases.csv"
    path.write_text('b.x,b.y\n1,"[2, 3]"\n4,\n')
    listed = table_of_cases(path)
    assert listed == [("b.x=1", "b.y=[2, 3]"), ("b.x=4",)]
    assert combined(axes[:1], False, listed)[-1] == ("b.x=4", "a.x=2")


@pytest.mark.parametrize(
    ("axis", "said"),
    [
        ("fluid.reynolds", "is not a key with values"),
        ("fluid.reynolds=", "is not a key with values"),
        ("fluid.reynolds=log:0:1:3", "ends above zero"),
        ("fluid.reynolds=log:1:x:3", "is not a range of numbers"),
        ("fluid.reynolds=lin:0:1:0", "gives 0 values"),
        ("fluid.reynolds=lin:1:nan:5", "1 to nan are not finite numbers"),
        ("fluid.reynolds=log:1:inf:5", "1 to inf are not finite numbers"),
        ("fluid.reynolds=1,,2", "has an empty value"),
    ],
)
def test_wrong_axes_are_refused(axis: str, said: str) -> None:
    assert said in message(lambda: parsed(axis))


def test_wrong_requests_are_refused(tmp_path: Path) -> None:
    pair = [parsed("a.x=1,2"), parsed("a.y=3")]
    assert "a.x 2, a.y 1" in message(lambda: combined(pair, True))
    assert "given twice" in message(lambda: combined(pair[:1] * 2, False))
    assert "nothing is varied" in message(lambda: requested([SOURCE]))
    many = [parsed(f"a.x{n}=lin:0:1:1000") for n in range(3)]
    assert "at most 1000000" in message(lambda: combined(many, False))
    ragged = tmp_path / "cases.csv"
    ragged.write_text("a.x,a.y\n1\n")
    assert "row 2 has not as many cells" in message(lambda: table_of_cases(ragged))
    ragged.write_text("a.x,a.x\n1,2\n")
    assert "has two columns a.x; leave one of them out" in message(lambda: table_of_cases(ragged))
    ragged.write_text("a.x,,\n1,,\n")  # empty columns, as spreadsheets write them
    assert table_of_cases(ragged) == [("a.x=1",)]
    ragged.write_text("a.x,a.y\n1,2\n")
    assert "--over a.x: the table of cases has it, too" in message(
        lambda: combined(pair[:1], False, table_of_cases(ragged))
    )
    assert "cannot be read" in message(lambda: table_of_cases(tmp_path / "absent.csv"))
    wrong = requested([SOURCE], [parsed("fluid.reynolds=1,-1")])
    assert "case 2 of 2 (fluid.reynolds=-1): --set fluid.reynolds=-1" in message(wrong.cases)
    assert "is not a time" in message(lambda: parsed_seconds("soon"))


def test_means_that_are_no_positive_numbers_are_refused() -> None:
    assert "--memory nan: is not a number" in message(lambda: Means(memory_mib=float("nan")))
    assert "--memory -1.0: is not above zero" in message(lambda: Means(memory_mib=-1.0))
    assert "--jobs 0: is not above zero" in message(lambda: Means(jobs=0))


class Counting(Silent):
    """Keeps what was counted."""

    def __init__(self) -> None:
        self.counted: list[tuple[int, int]] = []

    def count(self, what: str, done: int, total: int) -> None:
        self.counted.append((done, total))


def test_a_dry_run_of_many_cases_looks_at_a_sample_and_says_so(tmp_path: Path) -> None:
    """One case of a hundred thousand is looked at in no time at all; it stands for all, and that is told."""
    many = [parsed("fluid.reynolds=lin:1:20:1000"), parsed("contact.friction=lin:0.1:0.9:100")]
    request, voice = requested([SOURCE], many), Counting()
    sample = sampled(request, voice, longest=1e-9)
    assert (len(sample.cases), sample.of_all, voice.counted) == (1, 100_000, [(100, 100)])
    few = requested(
        [SOURCE], [parsed("fluid.reynolds=1,2,1.0"), parsed("contact.friction=0.1,0.2")]
    )
    found = sampled(few)
    assert found.is_whole and found.of_all == 4  # 1 and 1.0 are the same
    assert found.cases.keys() == {case.identity for case in few.cases()[0]}


def test_what_a_sample_says_is_taken_for_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    request = requested([SOURCE], [parsed("fluid.reynolds=lin:1:20:50")])
    file = tmp_path / "sweep.sqlite"
    whole = foretold(request, file, Means(memory_mib=1.0), 2).splitlines()
    assert whole[0].endswith("50: 0 already in " + str(file) + ", 50 to compute, 2 at a time")
    assert whole[-1].endswith("; 50 cases are too large") and len(whole) == 3
    monkeypatch.setattr("incipient.sweep.dry_run.sampled", partial(sampled, longest=1e-9))
    some = foretold(request, file, Means(memory_mib=1.0), 2).splitlines()
    assert some[0] == whole[0] and some[-1].endswith("; 50 cases are too large")
    assert some[1].startswith("sample") and "1 cases drawn at random" in some[1]


@pytest.mark.parametrize(
    ("text", "time"),
    [("8h", 28800.0), ("1h30m", 5400.0), ("90", 90.0), ("1.5d", 129600.0), ("2m5s", 125.0)],
)
def test_times_are_read(text: str, time: float) -> None:
    assert parsed_seconds(text) == time


def test_the_section_of_a_scene_says_what_is_varied(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(
        example() + '\n[sweep]\ndo = "threshold"\n[sweep.over]\nfluid.reynolds = "log:1:4:2"\n'
    )
    request = requested([Source.of(path)])
    assert (request.task, request.over) == ("threshold", (parsed("fluid.reynolds=1.0,4.0"),))
    assert load(path).fluid.reynolds == 20.0  # others pass it by
    assert (
        requested([Source.of(path)], [parsed("body.diameter=1,2")]).over[0].key == "body.diameter"
    )
    path.write_text(path.read_text().replace("do =", "to ="))
    assert "sweep.to: unknown key" in message(lambda: requested([Source.of(path)]))


def test_the_identity_hangs_on_content_and_task_alone() -> None:
    def identity(*settings: str, task: str = "run", source: Source = SOURCE) -> str:
        return resolved(source, settings, task).identity

    ways = {
        identity("fluid.reynolds=40", "contact.friction=0.4"),
        identity("contact.friction=0.4", "fluid.reynolds=40.0"),
        identity("fluid.reynolds=4e1", "contact.friction=0.4", "title=x", "output.pictures=true"),
        identity(source=Source.of(load_with("fluid.reynolds=40", "contact.friction=0.4"))),
    }
    assert len(ways) == 1
    others = {identity(), identity(task="threshold"), identity("numerics.mesh_size=2")}
    assert len(ways | others) == 4


def load_with(*overrides: str):
    from incipient.scene import loads

    return loads(example(), overrides=overrides)


def case(identity: str) -> SweepCase:
    return SweepCase(identity, "judge", "made", ("a.x=1",), "{}", "")


def test_a_case_is_computed_by_one_of_those_who_want_it(tmp_path: Path) -> None:
    path = tmp_path / "sweep.sqlite"
    with Store(path, make=True) as store:
        store.add([case("a"), case("b")], ["a.x"])
        store.add([case("a")], ["a.x", "a.y"])
        assert store.keys() == ["a.x", "a.y"]
        assert store.claim(["a"]) and not store.claim(["a"])
        store.finish({"a": CaseOutcome({"found": 1.0}, wall=2.0)})
        assert not store.claim(["a"])
        assert store.claim(["b"])
        store.give_back()
        assert store.states(["a", "b"]) == {"a": DONE, "b": WAITING}
        assert [row["tries"] for row in store.rows()] == [1, 0]


def test_what_a_killed_sweep_was_at_waits_again(tmp_path: Path) -> None:
    path = tmp_path / "sweep.sqlite"
    with Store(path, make=True) as store:
        store.add([case("a")], [])
        killed = subprocess.run([sys.executable, "-c", CLAIM, path], check=False)
        assert killed.returncode == -9
        assert store.states(["a"]) == {"a": RUNNING}
        assert store.free_abandoned() == 1 and store.claim(["a"])
        assert store.free_abandoned() == 0  # this process is at it, and alive


def test_files_of_others_are_refused(tmp_path: Path) -> None:
    text, other = tmp_path / "text.sqlite", tmp_path / "other.sqlite"
    text.write_text("not a database, but long enough to have the head of one\n" * 20)
    with sqlite3.connect(other) as base:
        base.execute("CREATE TABLE things (id TEXT)")
    for path, said in (
        (text, "is not the file of a sweep"),
        (other, "database of another program"),
    ):
        with pytest.raises(OutputError, match=said):
            Store(path, make=True)
    with pytest.raises(OutputError, match="no such file"):
        Store(tmp_path / "absent.sqlite")


def test_the_curve_beside_ours_is_that_of_soulsby_and_whitehouse() -> None:
    """As printed: 0.30/(1 + 1.2 D*) + 0.055 (1 - exp(-0.020 D*)); 0.055 for coarse grains, about 0.03 for sand."""
    reynolds, shields = soulsby_whitehouse(np.array([1e-9, 1.0, 17.0, 1e6]))
    assert shields == pytest.approx(
        [0.30, 0.30 / 2.2 + 0.055 * 0.0198013267, 0.0298, 0.055], rel=5e-3
    )
    assert reynolds == pytest.approx(np.sqrt(shields) * np.array([1e-9, 1.0, 17.0, 1e6]) ** 1.5)


def test_the_table_has_units_in_its_heads_and_numbers_to_the_right(
    tmp_path: Path, capsys: Any
) -> None:
    """Of each key the unit that `incipient new` writes beside it."""
    axes = [
        parsed("body.diameter=0.5,10"),
        parsed("bed.kind=flat"),
        parsed("contact.friction=0.25"),
    ]
    request, file = requested([SOURCE], axes), tmp_path / "sweep.sqlite"
    cases, keys = request.cases()
    with Store(file, make=True) as store:
        store.add(cases, keys)
        assert store.claim([cases[0].identity])
        store.finish({cases[0].identity: CaseOutcome({"verdict": None}, wall=2.5)})
    assert main(["table", str(file)]) == 0
    head, first, second = capsys.readouterr().out.splitlines()
    places = [head.index(word) + len(word) for word in ("body.diameter [length]", "time [s]")]
    assert first[: places[0]].endswith("  0.5") and second[: places[0]].endswith("   10")
    assert (
        first[: places[1]].endswith("  2.5")
        and "bed.kind " in head
        and "contact.friction [-]" in head
    )
    assert (
        unit_of(Scene, "gravity.acceleration") == "length/time^2"
        and unit_of(Scene, "no.such") == ""
    )
