"""Input files: pipes, devices and what libraries stumble over are one line that names the file."""

from __future__ import annotations

import errno
import json
import os
import socket
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from incipient import cli
from incipient.errors import IncipientError, OutputError, SceneError
from incipient.geometry.space.heightmap import HeightMap
from incipient.input_files import read_table, read_text, reading
from incipient.survey.beds import spheres_of
from incipient.survey.request import LabelledHeights, MeasuredEllipsoids
from incipient.sweep import cluster

CASES = Path(__file__).parents[2] / "demos" / "cases"
CASE = str(CASES / "block_on_incline.toml")
DEEP = "[" * 100_000


def message(call: Callable[[], object]) -> str:
    with pytest.raises(IncipientError) as caught:
        call()
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 500
    return str(caught.value)


@pytest.mark.parametrize(
    "order",
    [
        ["judge", "--batch", "pipe.csv"],
        ["judge", "--batch", "pipe.parquet"],
        ["judge", "--batch", "/dev/zero"],
        ["judge", CASE, "--series", "pipe.csv"],
        ["judge", CASE, "--series", "/dev/zero"],
        ["judge", CASE, "--forces", "pipe.csv", "--density", "1"],
        ["judge", "pipe.toml"],
        ["run", "pipe.toml"],
        ["sweep", "pipe.toml"],
        ["sweep", CASE, "--do", "judge", "--cases", "pipe.csv"],
        ["survey", "pipe.toml"],
    ],
    ids=" ".join,
)
def test_pipes_and_devices_are_refused_by_every_command(
    order: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    """A pipe that nobody writes to was waited for without end, and /dev/zero read until the memory was full."""
    monkeypatch.chdir(tmp_path)
    for kind in ("csv", "parquet", "toml"):
        os.mkfifo(f"pipe.{kind}")
    assert cli.main(order) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "is a pipe or a device; give" in said


@pytest.mark.parametrize(
    ("raised", "said"),
    [
        (RecursionError("maximum recursion depth"), "(it is nested too deeply); mend it"),
        (MemoryError(), "(it does not fit into the memory); mend it"),
        (ZeroDivisionError("a\nb"), "(a b); mend it"),
        (OSError("corrupt file?"), "(corrupt file?); mend it"),
        (OSError(errno.EIO, os.strerror(errno.EIO)), "(Input/output error); mend it"),
        (KeyError("data"), "('data'); mend it"),
        (UnicodeDecodeError("utf-8", b"ab\xff", 2, 3, "x"), "is not UTF-8 text at byte 2; save"),
    ],
)
def test_whatever_a_library_raises_is_one_line(
    raised: Exception, said: str, tmp_path: Path
) -> None:
    (tmp_path / "file").touch()
    for kind in (SceneError, OutputError):
        with pytest.raises(kind) as caught, reading(tmp_path / "file", "mend it", error=kind):
            raise raised
        assert said in str(caught.value) and str(tmp_path / "file") in str(caught.value)


def test_names_that_are_too_long_or_no_names_are_refused(tmp_path: Path) -> None:
    assert "File name too long" in message(
        lambda: read_text(tmp_path / ("a" * 300), "give another")
    )
    assert "null byte" in message(lambda: read_text(Path("a\0b"), "give another"))
    assert "Is a directory" in message(lambda: read_text(tmp_path, "give another"))


@pytest.mark.parametrize("command", ["show", "report", "table", "resume"])
def test_long_names_are_one_line_for_every_command(command: str, capsys: Any) -> None:
    assert cli.main([command, "a" * 300]) == 5
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "File name too long" in said


@pytest.mark.parametrize("name", ["result", "gusts", "judgement", "series", "entrainment"])
def test_a_result_of_brackets_is_reported_in_one_line(
    name: str, tmp_path: Path, capsys: Any
) -> None:
    (tmp_path / f"{name}.json").write_text(DEEP)
    assert cli.main(["report", str(tmp_path)]) == 5
    said = capsys.readouterr().err
    assert (
        said.count("\n") == 1 and f"{name}.json: cannot be read (it is nested too deeply)" in said
    )


def test_arrays_and_images_that_are_none_are_refused(tmp_path: Path) -> None:
    """An archive of arrays; a header of 1e14 numbers; one of brackets; an image of 9e8 pixels in 74 bytes."""
    with (tmp_path / "zip.npy").open("wb") as stream:
        np.savez(stream, a=np.ones((60, 60)))
    header = b"{'descr': '<i8', 'fortran_order': False, 'shape': (1000000, 100000000), }"
    for name, text in (("lie", header), ("paren", b"(" * 100)):
        padded = text.ljust(117) + b"\n"
        (tmp_path / f"{name}.npy").write_bytes(b"\x93NUMPY\1\0\x76\0" + padded + bytes(800))
    (tmp_path / "bomb.png").write_bytes(
        bytes.fromhex(
            "89504e470d0a1a0a0000000d494844520000753000007530080000000043 4ca766"
            "0000001149444154789c63601805a360140c77000003e80001b3a6d346"
            "0000000049454e44ae426082"
        )
    )
    np.save(tmp_path / "flat.npy", np.zeros((60, 60)))
    for name in ("zip.npy", "lie.npy", "paren.npy", "bomb.png"):
        path = tmp_path / name
        assert name in message(lambda path=path: HeightMap.from_file(path, (0.1, 0.1)))  # type: ignore[misc]
        bed = LabelledHeights(kind="labels", heights="flat.npy", labels=name, cell=(1.0, 1.0))
        assert name in message(lambda bed=bed: spheres_of(bed, tmp_path))  # type: ignore[misc]


@pytest.mark.parametrize("cell", ["1_2", "٣", "", "x"])
def test_measured_grains_are_plain_numbers(cell: str, tmp_path: Path) -> None:
    rows = "".join(f"{k},0,0,2,{cell if k == 1 else 1},1\n" for k in range(3))
    (tmp_path / "grains.csv").write_text("Xc,Yc,Zc,Dmax,Dmed,Dmin\n" + rows, encoding="utf-8")
    bed = MeasuredEllipsoids(kind="ellipsoids", file="grains.csv")
    assert "has a cell that is not a number" in message(lambda: spheres_of(bed, tmp_path))


def test_tables_with_other_cells_than_names_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "cases.csv"
    path.write_bytes(b'\xef\xbb\xbfa , b\r\n\r\n1,"x\r\ny"\r\n')
    assert read_table(path, "") == (["a", "b"], [["1", "x\ny"]])
    path.write_text("a,b\n1,2\n3\n")
    assert "row 3 has a different number of cells from the first" in message(
        lambda: read_table(path, "")
    )


def test_a_scheduler_that_accepts_and_says_nothing_is_given_up(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Dask bounds the time to connect, and not the time until the other side says who it is."""
    monkeypatch.setattr(cluster, "START", 0.5)
    with socket.create_server(("127.0.0.1", 0)) as server:
        held: list[socket.socket] = []
        answering = threading.Thread(target=lambda: held.append(server.accept()[0]), daemon=True)
        answering.start()
        address = f"127.0.0.1:{server.getsockname()[1]}"
        said = message(lambda: cluster.client_of(address).__enter__())
        assert f"{address}: no scheduler answers (TimeoutError after 0.5 s)" in said
    for text in ("{", DEEP, json.dumps({"id": 1}), json.dumps([1])):
        (tmp_path / "scheduler.json").write_text(text)
        said = message(lambda: cluster.client_of(f"{tmp_path}/scheduler.json").__enter__())
        assert "scheduler.json: cannot be read" in said


def test_a_shortage_of_memory_and_a_full_disk_are_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    for raised, said in (
        (
            MemoryError("Unable to allocate 89.0 GiB"),
            "too small (Unable to allocate 89.0 GiB); reduce",
        ),
        (  # of `ulimit -v 400000`, when gmsh is imported
            OSError("libgmsh.so.4.8: failed to map segment from shared object"),
            "too small (libgmsh.so.4.8: failed to map segment from shared object); reduce",
        ),
        (
            ImportError("libvtk.so: failed to map segment from shared object"),
            "too small (libvtk.so: failed to map segment from shared object); reduce",
        ),
        (
            OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "out/a.png"),
            "out/a.png: No space left on device; choose",
        ),
    ):

        def failing(*_: object, raised: Exception = raised) -> int:
            raise raised

        monkeypatch.setattr("incipient.commands.writing.schema", failing)
        assert cli.main(["schema"]) == 5
        complaint = capsys.readouterr().err
        assert complaint.count("\n") == 1 and said in complaint


@pytest.mark.parametrize("closed", ["2>&-", ">&-", "<&- >&- 2>&-"])
def test_closed_standard_streams_do_not_stop_a_command(closed: str, tmp_path: Path) -> None:
    """Without a standard error a command ended before its first line: what it opens first would get that number."""
    order = f"{sys.executable} -m incipient judge {CASE} --out {tmp_path} {closed}"
    done = subprocess.run(["sh", "-c", order], timeout=120, capture_output=True, check=False)
    assert done.returncode == 0
    assert json.loads((tmp_path / "judgement.json").read_text())["verdict"]
