"""Folders of compiled forms: whole or not there, whoever is killed, whatever is damaged."""

from __future__ import annotations

import multiprocessing
import shutil
import time
from collections import namedtuple
from pathlib import Path
from typing import Any

import pytest
from mpi4py import MPI

from incipient import form_cache
from incipient.errors import OutputError

COMM, NAME = MPI.COMM_SELF, "0123456789"


class Compiler:
    """Stands for the form compiler: writes a file where there is none, and reads it where there is."""

    def __init__(self, code: str = "code"):
        self.code, self.built, self.loaded = code, 0, 0

    def __call__(self, folder: Path) -> str:
        made = folder / "form.so"
        if made.exists():
            self.loaded += 1
            if made.read_text() != self.code:
                raise ImportError("invalid ELF header")
        else:
            self.built += 1
            made.write_text(self.code)
        return made.read_text()


def test_a_form_is_compiled_once_and_then_loaded(tmp_path: Path) -> None:
    build = Compiler()
    found = [form_cache.compiled(tmp_path, NAME, COMM, build) for _ in range(3)]
    assert found == ["code"] * 3 and (build.built, build.loaded) == (1, 2)
    assert sorted(path.name for path in tmp_path.iterdir()) == [NAME, "locks"]


@pytest.mark.parametrize("damage", ["co", "junk", "co\0\0"])
def test_a_damaged_form_is_compiled_anew(tmp_path: Path, damage: str) -> None:
    """Without being loaded first: a library that was cut short ends the process (SIGBUS)."""
    form_cache.compiled(tmp_path, NAME, COMM, Compiler())
    (tmp_path / NAME / "form.so").write_text(damage)
    build = Compiler()
    assert form_cache.compiled(tmp_path, NAME, COMM, build) == "code"
    assert (build.built, build.loaded) == (1, 0)
    assert form_cache.compiled(tmp_path, NAME, COMM, build) == "code" and build.built == 1


def test_a_form_that_cannot_be_loaded_is_compiled_anew(tmp_path: Path) -> None:
    """As one of another version of Python, whole as it is."""
    form_cache.compiled(tmp_path, NAME, COMM, Compiler("other"))
    build = Compiler()
    assert form_cache.compiled(tmp_path, NAME, COMM, build) == "code"
    assert (build.built, build.loaded) == (1, 1)
    assert form_cache.compiled(tmp_path, NAME, COMM, build) == "code" and build.built == 1


def test_an_interrupted_compilation_leaves_nothing(tmp_path: Path) -> None:
    def interrupted(folder: Path) -> str:
        (folder / "form.c").touch()
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        form_cache.compiled(tmp_path, NAME, COMM, interrupted)
    assert [path.name for path in tmp_path.iterdir()] == ["locks"]


def test_what_a_killed_process_leaves_is_removed(tmp_path: Path) -> None:
    (tmp_path / f"{NAME}.left").mkdir()
    (tmp_path / f"{NAME}.left" / "form.so").write_text("half")
    assert form_cache.compiled(tmp_path, NAME, COMM, Compiler()) == "code"
    assert sorted(path.name for path in tmp_path.iterdir()) == [NAME, "locks"]


def test_without_rights_the_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(
        OutputError, match=r"^/proc/forms: compiled forms cannot be kept .*set XDG_CACHE_HOME"
    ):
        form_cache.compiled(Path("/proc/forms"), NAME, COMM, Compiler())


def test_a_full_disk_is_named(tmp_path: Path, monkeypatch: Any) -> None:
    def failing(folder: Path) -> str:
        raise RuntimeError("gcc failed with exit code 1")

    with pytest.raises(RuntimeError, match="gcc"):
        form_cache.compiled(tmp_path, NAME, COMM, failing)
    usage = namedtuple("usage", "total used free")(2**30, 2**30, 0)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage)
    with pytest.raises(OutputError, match=f"^{tmp_path}: the disk is full, .* XDG_CACHE_HOME"):
        form_cache.compiled(tmp_path, NAME, COMM, failing)


def compiled_slowly(root: Path, log: Path) -> None:
    def build(folder: Path) -> None:
        if not (folder / "form.so").exists():
            with log.open("a") as lines:
                lines.write("built\n")
            (folder / "form.so").write_text("c")
            time.sleep(0.3)
            (folder / "form.so").write_text("code")
        assert (folder / "form.so").read_text() == "code"

    form_cache.compiled(root, NAME, COMM, build)


def test_of_four_at_once_one_compiles_and_the_others_wait(tmp_path: Path) -> None:
    log = tmp_path / "log"
    them = [
        multiprocessing.get_context("fork").Process(
            target=compiled_slowly, args=(tmp_path / "forms", log)
        )
        for _ in range(4)
    ]
    for one in them:
        one.start()
    for one in them:
        one.join(60)
    assert [one.exitcode for one in them] == [0] * 4
    assert log.read_text() == "built\n"


RANKS = """
import os
from pathlib import Path
from mpi4py import MPI

rank, base = MPI.COMM_WORLD.rank, Path("CACHE")
os.environ["XDG_CACHE_HOME"] = str(base / ("no_directory/of_rank" if rank == 2 else "cache"))
import dolfinx, ufl
from incipient import compat

if rank == 0:
    (base / "no_directory").touch()
space = compat.space(dolfinx.mesh.create_unit_square(MPI.COMM_WORLD, 4, 4), ("Lagrange", 1))
compat.form(ufl.TestFunction(space) * ufl.dx)
if rank == 0:
    print(sorted(path.name for path in base.iterdir()), len(list((base / "cache").rglob("*.so"))))
"""


@pytest.mark.slow
def test_ranks_with_caches_of_their_own_use_the_first(mpirun: Any, tmp_path: Path) -> None:
    """The cache of one rank of three cannot be written: forms are compiled, and loaded, where the first rank says.

    Once compiled, they were looked for in each rank's own cache, and two ranks waited for the third without end.
    """
    (tmp_path / "caches").mkdir()
    said = set()
    for _ in range(2):
        done = mpirun(3, RANKS.replace("CACHE", str(tmp_path / "caches")), timeout=60)
        assert done.returncode == 0, done.stderr
        said.add(done.stdout)
    assert len(said) == 1  # the second time nothing is compiled


def test_a_folder_that_one_rank_cannot_write_is_refused_before_it_is_built(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="set XDG_CACHE_HOME to a directory that can be written"):
        form_cache._require_writable(tmp_path / "file" / NAME)
