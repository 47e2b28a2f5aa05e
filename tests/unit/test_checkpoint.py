"""Checkpoints, files of input, and who owns a directory."""

from __future__ import annotations

import errno
import json
import os
import signal
import socket
from collections.abc import Callable
from contextlib import nullcontext, suppress
from dataclasses import asdict, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import h5py
import numpy as np
import pytest
import scenes
from domains import ball_in_box, curved_box, measures, ring, unit_box
from matplotlib.figure import Figure
from mpi4py import MPI
from scenes import CASES

import incipient
from incipient.body.contact_motion import ActiveContacts
from incipient.body.rigidbody import MeanLoad
from incipient.coupled.moving_grain import MovingGrain
from incipient.errors import IncipientError, OutputError, SceneError
from incipient.files import MARK, append_row, cut_after, own, owned, write_text_atomically
from incipient.geometry.space.heightmap import HeightMap
from incipient.input_files import reading
from incipient.interrupt import SAME_WISH, Interruption
from incipient.mesh.domain import Domain
from incipient.output.ownership import locked, make_room, place_scene, refuse_foreign
from incipient.output.runs import CHECKPOINT, reopened
from incipient.pictures import style
from incipient.planning.discretisation import order_of
from incipient.restart import (
    Checkpoint,
    read,
    spread_mesh,
    stored_mesh,
    write,
)
from incipient.results.kinds import GUSTS
from incipient.scene import example
from incipient.scene.file import dumps, loads
from incipient.survey.beds import spheres_of
from incipient.survey.request import LabelledHeights
from incipient.sweep import worker
from incipient.sweep.store import Store

# What a checkpoint holds comes back on any mesh numbering; what is not whole is refused; writing is all or nothing.


COMM = MPI.COMM_SELF
SCENE = """
[domain]
kind = "box"
length = 1.0
height = 1.0
[fluid]
reynolds = 10
scale = "flow"
[flow]
kind = "lid"
velocity = 1.0
[time]
end = 2.0
step = 0.5
"""


# -- meshes and flows ------------------------------------------------------------------------------------------


def renumbered(whole: dict[str, Any]) -> dict[str, Any]:
    """The same mesh with nodes and cells in another order."""
    random = np.random.default_rng(3)
    nodes, cells = (random.permutation(len(whole[name])) for name in ("nodes", "cells"))
    new = np.argsort(nodes)
    return whole | {
        "nodes": whole["nodes"][nodes],
        "cells": new[whole["cells"]][cells],
        "facets": new[whole["facets"]],
    }


@pytest.mark.parametrize(
    "make",
    [
        lambda: unit_box(2, 4),
        lambda: curved_box(2, 3, 3),
        lambda: ring(1.0, 2.0, 16, 2),
        lambda: ring(1.0, 2.0, 16, 3),
        lambda: unit_box(3, 2),
        lambda: ball_in_box(0.3),
    ],
)
def test_a_mesh_comes_back_with_its_boundaries(make: Callable[[], Domain]) -> None:
    """Volume and the area of every named boundary, to round-off; and the same numbering from the same order."""
    domain = make()
    whole = stored_mesh(domain)
    again, shuffled = (spread_mesh(COMM, mesh) for mesh in (whole, renumbered(whole)))
    assert np.array_equal(again.mesh.geometry.x, domain.mesh.geometry.x)
    for mesh in (again, shuffled):
        assert measures(mesh) == pytest.approx(measures(domain), rel=1e-12)


# -- the file --------------------------------------------------------------------------------------------------


def sample(time: float = 1.0, met: bool = False) -> Checkpoint:
    """Something of every kind that a checkpoint may hold."""
    numbers = np.random.default_rng(1).standard_normal
    cells = np.array([[0, 1, 2]])
    mesh = {
        "degree": 2,
        "nodes": numbers((4, 2)),
        "cells": cells,
        "facets": np.array([[0, 1]]),
        "tags": np.array([7]),
        "names": {"bed": 7},
    }
    velocity = {"points": numbers((4, 3)), "values": numbers((4, 2, 2))}
    pressure = {"points": numbers((3, 3)), "values": numbers((3, 2, 1))}
    body = {
        "weights": numbers((4, 3)),
        "states": numbers((2, 6)),
        "times": numbers(2),
        "mean_load": vars(MeanLoad(2, numbers(3), 0.1)),
        "load": numbers(3),
        "length": 0.1,
        "velocities": numbers((0, 3)),
        "met": met,
        "interface_iterations": [1, 2],
        "remeshings": [{"time": 0.1, "cells": 5}],
        "contacts": vars(ActiveContacts.none(2)),
    }
    progress = {"number": 2, "next_length": 0.1 + 0.2, "error": None, "wall_time": {"flow": 0.3}}
    times = np.array([time, 0.5])
    motion = {"made": numbers((4, 3)), "places": numbers((4, 2, 3))}
    return Checkpoint(dumps(loads(SCENE)), progress, mesh, times, velocity, pressure, motion, body)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A checkpoint in a directory with its scene."""
    result = tmp_path / CHECKPOINT
    write(result, sample(), COMM)
    (tmp_path / "scene.toml").write_text(SCENE)
    return result


@pytest.mark.parametrize("body", [True, False])
def test_what_was_written_is_read(path: Path, body: bool) -> None:
    given = sample() if body else replace(sample(), body=None)
    write(path, given, COMM)
    np.testing.assert_equal(asdict(read(path, COMM)), asdict(given))


def test_nothing_may_be_missing(path: Path) -> None:
    """Whatever dataset or group is taken out is missed by its name."""
    names: list[str] = []
    with h5py.File(path) as file:
        file.visit(names.append)
    assert len(names) > 40
    for name in names:
        write(path, sample(), COMM)
        with h5py.File(path, "r+") as file:
            del file[name]
        said = rf"checkpoint\.h5: {name}(/\w+)? is missing; start a new run"
        with pytest.raises(OutputError, match=said):
            read(path, COMM)


DAMAGED = "cannot be read: it is damaged or incomplete; start a new run"


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        ({"version": 99, "program": "incipient 9.9"}, r"of version 99, .* \(incipient 9\.9\)"),
        ({"format": "else"}, "is not a checkpoint; give the directory of a run"),
        (None, "is set; start a new run"),
        ("a byte", DAMAGED),
        *((length, DAMAGED) for length in (0, 10, 1000, 10_000)),
    ],
)
def test_what_is_no_whole_checkpoint_of_this_version_is_refused(
    path: Path, damage: Any, said: str
) -> None:
    """Other attributes; none; one byte of a number, which HDF5's checksum notices; a file cut after so many bytes."""
    if isinstance(damage, dict):
        with h5py.File(path, "r+") as file:
            file.attrs.update(damage)
    elif damage == "a byte":
        content = path.read_bytes()
        at = content.index(sample().velocity["values"].tobytes())
        path.write_bytes(content[: at + 6] + b"\x55" + content[at + 7 :])
    else:
        path.unlink() if damage is None else os.truncate(path, damage)
    kind = SceneError if damage is None else OutputError
    with pytest.raises(kind, match=rf"checkpoint\.h5: .*{said}"):
        read(path, COMM)


# -- the history -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "time", "least", "left"),
    [
        ("t,x\n1.0,5\n2.0,5\n3.0,5\n4", 2.0, 2, "t,x\n1.0,5\n2.0,5\n"),  # half a row goes as well
        ("t,x\n1.0,5\n2.0,5\n3.0,5\n4", 0.5, 0, "t,x\n"),
        ("t,x\n1.0,5\n2.0", 2.0, 2, None),
        ("", 2.0, 2, None),
    ],
)
def test_a_history_is_cut_back_and_stays_where_it_lacks_rows(
    tmp_path: Path, text: str, time: float, least: int, left: str | None
) -> None:
    path = tmp_path / "history.csv"
    path.write_text(text)
    said = r"history\.csv: has lost some of its 2 rows; restore the"
    with nullcontext() if left is not None else pytest.raises(OutputError, match=said):
        cut_after(path, time, least)
    assert path.read_text() == (text if left is None else left)


# -- opening a run again ---------------------------------------------------------------------------------------


def test_a_state_before_the_first_step_has_no_mean_load(monkeypatch: pytest.MonkeyPatch) -> None:
    """Earlier programs stored null: the first mean load is that at the end of the step, as of BDF1."""
    monkeypatch.setattr("incipient.restart.spread_nodes", lambda mesh, values: values)
    kept = sample()
    kept.body["flow_load"] = kept.body["load"]
    kept.body["mean_load"] = {"order": 2, "previous": None, "last_step": None}
    domain = SimpleNamespace(mesh=None)
    grain: Any = SimpleNamespace(
        mesh=SimpleNamespace(weights=np.zeros_like(kept.body["weights"])),
        fluid=SimpleNamespace(domain=domain),
    )
    MovingGrain.resume(grain, kept)
    assert grain.mean_load.mean([3.0, 4.0, 5.0], 0.1).tolist() == [3.0, 4.0, 5.0]


@pytest.mark.parametrize(("stored", "given"), [(2, "auto"), (3, "auto"), (3, 3), ("auto", 3)])
def test_the_order_is_that_of_the_stored_flow(path: Path, stored: Any, given: Any) -> None:
    """Where "auto" means another one now, and where what it means is said."""
    order = '"auto"' if stored == "auto" else stored
    write(path, replace(sample(), scene=f"{SCENE}[numerics]\norder = {order}\n"), COMM)
    scene, _ = reopened(path.parent, [f"numerics.order={given}"], COMM)
    assert order_of(scene) == (2 if stored == 2 else 3)


@pytest.mark.parametrize(
    ("changes", "met", "told"),
    [
        (
            ["fluid.reynolds=20"],
            False,
            r"scene\.toml: fluid\.reynolds is 20\.0, but the run to resume has 10\.0",
        ),
        (
            ["time.scheme=bdf1"],
            False,
            r"time\.scheme is bdf1, .* has bdf2; keep that value \(only time\.end, .* may change\)",
        ),
        (["numerics.order=2"], False, r"numerics\.order is 2, but the run to resume has 3; "),
        (
            ["output.fields=false"],
            False,
            r"output\.fields is False, but the run to resume has True",
        ),
        (
            ["time.end=1.0"],
            False,
            r"has already reached t = 1, and time\.end is 1; .* --set time\.end=2",
        ),
        (
            [],
            True,
            r"its grain reached the bed or a wall; to resume it set a smaller contact\.gap",
        ),
    ],
)
def test_what_cannot_go_on_is_refused_by_name(
    path: Path, changes: list[str], met: bool, told: str
) -> None:
    """Another scene, and a grain that has met something."""
    write(path, sample(met=met), COMM)
    with pytest.raises(SceneError, match=told):
        reopened(path.parent, changes, COMM)


# -- interrupts ------------------------------------------------------------------------------------------------


def test_the_first_signal_is_a_wish_a_later_one_an_interrupt(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    now = 0.0
    monkeypatch.setattr("incipient.interrupt.time.monotonic", lambda: now)
    with Interruption(COMM) as interruption:
        interruption.armed = True
        assert not interruption.asked()
        os.kill(os.getpid(), signal.SIGTERM)
        assert interruption.asked()
        now = 0.9 * SAME_WISH
        os.kill(os.getpid(), signal.SIGINT)  # as mpirun passes one on
        now = 1.1 * SAME_WISH
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
    assert capfd.readouterr().err == "stopping after this step; once more to stop at once\n"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_before_the_first_step_a_signal_interrupts_at_once(number: int) -> None:
    before = [signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)]
    with pytest.raises(KeyboardInterrupt), Interruption(COMM):
        os.kill(os.getpid(), number)
    assert [signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)] == before


# Input files: pipes, devices and what libraries stumble over are one line that names the file.


CASE = str(CASES / "block_on_incline.toml")
DEEP = "[" * 100_000


def message(call: Callable[[], object]) -> str:
    said = scenes.message(call, IncipientError)
    assert len(said) < 500
    return said


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
    order: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, said_by: Any
) -> None:
    """A pipe that nobody writes to was waited for without end, and /dev/zero read until the memory was full."""
    monkeypatch.chdir(tmp_path)
    for kind in ("csv", "parquet", "toml"):
        os.mkfifo(f"pipe.{kind}")
    said = said_by(*order, code=2)
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
@pytest.mark.parametrize("kind", [SceneError, OutputError])
def test_whatever_a_library_raises_is_one_line(
    raised: Exception, said: str, kind: type[Exception], tmp_path: Path
) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(kind) as caught, reading(tmp_path / "file", "mend it", error=kind):
        raise raised
    assert said in str(caught.value) and str(tmp_path / "file") in str(caught.value)


@pytest.mark.parametrize("command", ["show", "report", "table", "resume"])
def test_long_names_are_one_line_for_every_command(command: str, said_by: Any) -> None:
    said = said_by(command, "a" * 300, code=5)
    assert said.count("\n") == 1 and "File name too long" in said


def test_pictures_of_an_interrupted_run_need_its_end(tmp_path: Path, said_by: Any) -> None:
    for name in ("scene.toml", "checkpoint.h5"):
        (tmp_path / name).touch()
    remedy = f"the run is not finished; continue it with: incipient resume {tmp_path}\n"
    assert remedy in said_by("show", tmp_path, code=2)


def array_file(header: bytes) -> bytes:
    """A .npy file with a header and a hundred numbers."""
    return b"\x93NUMPY\1\0\x76\0" + header.ljust(117) + b"\n" + bytes(800)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("archive.npy", b"PK\5\6" + bytes(18)),  # of no arrays
        (
            "lie.npy",  # of 1e14 numbers
            array_file(
                b"{'descr': '<i8', 'fortran_order': False, 'shape': (1000000, 100000000), }"
            ),
        ),
        ("brackets.npy", array_file(b"(" * 100)),
        (
            "bomb.png",  # 9e8 pixels in 74 bytes
            bytes.fromhex(
                "89504e470d0a1a0a0000000d494844520000753000007530080000000043 4ca766"
                "0000001149444154789c63601805a360140c77000003e80001b3a6d346"
                "0000000049454e44ae426082"
            ),
        ),
    ],
)
def test_arrays_and_images_that_are_none_are_refused(
    name: str, content: bytes, tmp_path: Path
) -> None:
    (tmp_path / name).write_bytes(content)
    assert name in message(lambda: HeightMap.from_file(tmp_path / name, (0.1, 0.1)))
    np.save(tmp_path / "flat.npy", np.zeros((60, 60)))
    bed = LabelledHeights(kind="labels", heights="flat.npy", labels=name, cell=(1.0, 1.0))
    assert name in message(lambda: spheres_of(bed, tmp_path))


def test_a_scheduler_that_does_not_answer_is_given_up(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Dask bounds the time to connect, and not the time until the other side says who it is."""
    monkeypatch.setattr(worker, "START", 0.5)

    def said(address: object) -> str:
        return scenes.message(worker.client_of(str(address)).__enter__, SceneError)

    with socket.create_server(("127.0.0.1", 0)) as server:  # which accepts and is silent
        address = f"127.0.0.1:{server.getsockname()[1]}"
        assert f"{address}: no scheduler answers (TimeoutError after 0.5 s)" in said(address)
    assert "tcp://127.0.0.1:9: no scheduler answers" in said("tcp://127.0.0.1:9")
    for text in ("{", DEEP, json.dumps({"id": 1}), json.dumps([1])):
        (tmp_path / "scheduler.json").write_text(text)
        assert "scheduler.json: cannot be read" in said(tmp_path / "scheduler.json")


@pytest.mark.parametrize(
    ("raised", "said"),
    [
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
    ],
)
def test_a_shortage_of_memory_and_a_full_disk_are_one_line(
    raised: Exception, said: str, monkeypatch: pytest.MonkeyPatch, said_by: Any
) -> None:
    def failing(*_: object) -> int:
        raise raised

    monkeypatch.setattr("incipient.commands.showing.schema", failing)
    complaint = said_by("schema", code=5)
    assert complaint.count("\n") == 1 and said in complaint


# What commands may replace in a directory, and who may work there: only their own files, one run at a time.


FOREIGN = {
    "fields": None,
    "result.json": json.dumps({"status": "complete", "energy": 3.0}),
    "history.csv": "time,energy\n0,1\n",
    "fields.xdmf": "numbers",
    "report.html": "<html>quarterly figures</html>",
    "checkpoint.h5": "something else",
    "scene.toml": example(),
}


# -- files of others -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FOREIGN)
def test_what_others_wrote_is_refused_and_stays(tmp_path: Path, name: str) -> None:
    """Also in a directory where incipient has written other files, and also a folder."""
    write_text_atomically(tmp_path / "threshold.json", "{}")
    path, text = tmp_path / name, FOREIGN[name]
    path.mkdir() if text is None else path.write_text(text)
    refused = f"{name}: was not written by incipient; choose another directory"
    for call in (
        lambda: locked(tmp_path, COMM).__enter__(),
        *(
            (lambda: write_text_atomically(path, "ours"), lambda: append_row(path, {"time": 0.0}))
            if text
            else ()
        ),
    ):
        assert refused in message(call)
    assert text is None or path.read_text() == text


def test_a_run_that_makes_room_leaves_files_of_others(tmp_path: Path) -> None:
    """Beside its files and pictures, within its folder of fields, and where a mark of somebody else names them."""
    (tmp_path / "precious").write_text("mine")
    out = tmp_path / "out"
    (out / "fields").mkdir(parents=True)
    for path in (out / "result.json", out / "flow.png", out / "fields" / "000000.h5"):
        write_text_atomically(path, "ours")
    own(out / "fields")
    for path in (out / "notes.txt", out / "fields" / "notes.txt"):
        path.write_text("mine")
    with (out / "fields" / MARK).open("a") as mark:
        mark.write("../../precious\n")
    make_room(out, overwrite=True)
    left = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file()}
    assert left == {"precious", f"out/{MARK}", "out/notes.txt", "out/fields/notes.txt"}


def test_results_of_another_scene_make_room(tmp_path: Path) -> None:
    """A search of gusts beside a run that can be resumed: the run moves with its scene, and can be resumed there."""
    directory = tmp_path / "x"
    directory.mkdir()
    of_run, of_gusts = dumps(loads(example())), dumps(loads(example(in_space=True)))
    place_scene(directory, of_run)
    for name in ("checkpoint.h5", "gusts.json"):
        write_text_atomically(directory / name, name)
    place_scene(directory, of_run, GUSTS.files)  # of one scene all may be in one place
    assert (directory / "checkpoint.h5").exists()
    place_scene(directory, of_gusts, GUSTS.files)
    assert (directory / "scene.toml").read_text() == of_gusts
    assert {path.name for path in directory.iterdir()} == {MARK, "scene.toml", "gusts.json"}
    assert (tmp_path / "x.1" / "scene.toml").read_text() == of_run
    assert (tmp_path / "x.1" / "checkpoint.h5").read_text() == "checkpoint.h5"
    refuse_foreign(tmp_path / "x.1")


@pytest.mark.parametrize("name", ["result.json", "result.json.part", "fields", "flow.png", MARK])
def test_nothing_is_written_through_links(tmp_path: Path, name: str) -> None:
    target, out = tmp_path / "elsewhere", tmp_path / "out"
    target.write_text("precious")
    out.mkdir()
    (out / name).symlink_to(target)
    with pytest.raises(OutputError, match=f"{name}: is a link"), locked(out, COMM):
        pass
    with suppress(OutputError):  # half a file of an earlier call is removed
        write_text_atomically(out / "result.json", "{}")
    with suppress(OutputError):
        append_row(out / name, {"time": 0.0})
    with suppress(OutputError):
        style.save(Figure(), out / name)
    assert target.read_text() == "precious"


def test_a_mark_that_is_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / MARK)
    with pytest.raises(OutputError, match=MARK), locked(tmp_path, COMM):
        pass


def test_a_survey_beside_its_bed_leaves_the_bed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, said_by: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bed.toml").write_text('[bed]\nkind = "spheres"\nfile = "spheres.csv"\n[flow]\n')
    (tmp_path / "spheres.csv").write_text("0,0,0,1\n")
    assert "spheres.csv: was not written by incipient" in said_by(
        "survey", "bed.toml", "--out", ".", code=5
    )
    own(tmp_path / "spheres.csv")  # that of an earlier survey
    assert "spheres.csv: is read and would be replaced" in said_by(
        "survey", "bed.toml", "--out", ".", code=5
    )
    assert (tmp_path / "spheres.csv").read_text() == "0,0,0,1\n"


# -- one run at a time -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [OutputError, ZeroDivisionError, KeyboardInterrupt, SystemExit])
def test_the_lock_goes_with_an_error(tmp_path: Path, kind: type[BaseException]) -> None:
    assert "new: no such directory; give" in message(locked(tmp_path / "new", COMM).__enter__)
    for _ in range(2):
        with pytest.raises(kind), locked(tmp_path / "new", COMM, make=True):
            raise kind
    assert owned(tmp_path / "new") == set()


def test_the_file_of_a_sweep_is_no_target(tmp_path: Path) -> None:
    with Store(tmp_path / "s.sqlite", make=True):
        pass
    before = (tmp_path / "s.sqlite").read_bytes()
    with pytest.raises(OutputError, match=r"s\.sqlite: is not a valid name for this file"):
        incipient.report(tmp_path / "s.sqlite", tmp_path / "s.sqlite")
    assert (tmp_path / "s.sqlite").read_bytes() == before
