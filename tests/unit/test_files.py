"""Files that are written and the memory that is free."""

import csv
import json
import resource
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import numpy as np
import pytest

from incipient.errors import OutputError
from incipient.files import MARK, append_row, write_json, write_text_atomically
from incipient.installed import free_bytes

# Files are whole or absent, numbers survive, and errors name cause and remedy.


ROW = {"time [scene units]": 0.1, "drag [scene units, + downstream]": np.float64(1 / 3)}


@contextmanager
def files_limited_to(size):
    """Writing beyond `size` bytes fails in this process, as on a full disk."""
    old = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, old[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, old)


def test_text_replaces_the_old_file_and_a_failed_write_keeps_it(tmp_path):
    path = tmp_path / "result.json"
    write_text_atomically(path, "old")
    write_text_atomically(path, "π = 3\n")
    with (
        files_limited_to(100),
        pytest.raises(OutputError, match=r"result\.json: .*file too large; raise"),
    ):
        write_text_atomically(path, "x" * 1000)
    assert path.read_text(encoding="utf-8") == "π = 3\n"
    assert sorted(tmp_path.iterdir()) == [tmp_path / MARK, path]


@pytest.mark.parametrize(
    ("place", "remedy"),
    [
        ("absent/result.json", "make the directory first"),
        ("a-file/result.json", "a file stands where a directory is needed"),
        ("a-directory", "a directory has the name of the file"),
    ],
)
def test_errors_say_what_to_do(tmp_path, place, remedy):
    (tmp_path / "a-file").touch()
    (tmp_path / "a-directory").mkdir()
    with pytest.raises(OutputError, match=remedy):
        write_text_atomically(tmp_path / place, "text")


class Mode(Enum):
    SLIDES = "slides"


@dataclass
class Load:
    force: np.ndarray
    mode: Mode


def test_json_of_everything_a_result_holds(tmp_path):
    """Members of enumerations by their name, as modes and statuses of results are."""
    data = {
        "load": Load(np.array([1.5, np.nan, -np.inf]), Mode.SLIDES),
        "count": np.int64(3),
        "moves": np.bool_(True),
        "margin": float("inf"),
        "file": Path("a/b"),
        "pair": (1, 2.5),
        "none": None,
    }
    write_json(tmp_path / "result.json", data)
    assert json.loads((tmp_path / "result.json").read_text()) == {
        "load": {"force": [1.5, None, None], "mode": "SLIDES"},
        "count": 3,
        "moves": True,
        "margin": None,
        "file": "a/b",
        "pair": [1, 2.5],
        "none": None,
    }


def test_json_refuses_what_it_cannot_say(tmp_path):
    with pytest.raises(TypeError, match="function has no counterpart"):
        write_json(tmp_path / "result.json", {"f": test_json_refuses_what_it_cannot_say})
    assert not list(tmp_path.iterdir())


def test_rows_are_on_disk_at_once_with_one_header_and_all_digits(tmp_path):
    """Half a row of a full disk is taken back."""
    path = tmp_path / "history.csv"
    append_row(path, ROW)
    before = path.read_text()
    with files_limited_to(len(before) + 5), pytest.raises(OutputError, match="file too large"):
        append_row(path, ROW)
    assert path.read_text() == before and before.count("\n") == 2
    append_row(path, ROW)
    header, *rows = csv.reader(path.read_text().splitlines())
    assert header == list(ROW)
    assert [float(value) for row in rows for value in row] == [0.1, 1 / 3, 0.1, 1 / 3]


# How much memory is free, beside what Linux tells of the machine.


def test_no_more_is_free_than_the_system_has_and_what_files_take_counts():
    """MemAvailable is what may be taken without swapping; MemFree leaves out what files take (proc(5))."""
    lines = Path("/proc/meminfo").read_text().splitlines()
    told = {line.split(":")[0]: 1024 * float(line.split()[1]) for line in lines}
    assert 0.0 < free_bytes() <= told["MemTotal"]
    if not Path("/sys/fs/cgroup/memory.max").exists():
        assert free_bytes() == pytest.approx(told["MemAvailable"], rel=0.2)
