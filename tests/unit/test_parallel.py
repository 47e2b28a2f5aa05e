"""Agreement on failure."""

from __future__ import annotations

import json
import pickle
from pathlib import Path
from typing import Any

import pytest
import tomli_w
from kinds import every_grain_and_bed, write_files
from mpi4py import MPI

from incipient.errors import IncipientError, MeshError, OutputError
from incipient.parallel import collectively
from incipient.scene import Scene, load
from incipient.scene.file import example
from incipient.scene.messages import tag, variants

SCENES = Path(__file__).parents[2] / "demos" / "scenes"
COMM = MPI.COMM_WORLD


def test_nothing_happens_when_nothing_fails() -> None:
    with collectively(COMM):
        value = 1
    assert value == 1


@pytest.mark.parametrize("kind", [MeshError, OutputError, IncipientError])
def test_own_errors_keep_type_and_message(kind: type[IncipientError]) -> None:
    with pytest.raises(kind, match=r"^the disk is full$"), collectively(COMM):
        raise kind("the disk is full")


def test_defects_of_the_program_keep_their_type() -> None:
    """They are reported with a traceback where they happened."""
    with pytest.raises(ZeroDivisionError), collectively(COMM):
        1 / 0  # noqa: B018


def test_interrupts_pass() -> None:
    """Ctrl-C reaches every rank by itself: nothing must be waited for."""
    with pytest.raises(KeyboardInterrupt), collectively(COMM):
        raise KeyboardInterrupt


RANKS = """
import sys
from mpi4py import MPI
from incipient.errors import IncipientError, OutputError
from incipient.parallel import collectively

comm, kind = MPI.COMM_WORLD, {"own": OutputError, "other": ValueError}[sys.argv[1]]
for failing in map(int, sys.argv[2:]):
    try:
        with collectively(comm):
            if comm.rank >= failing:
                raise kind(f"rank {comm.rank} failed")
    except Exception as error:
        print(f"{failing} {comm.rank}: {type(error).__name__}: {error}\\n", end="")
    comm.Barrier()
"""


def test_all_ranks_raise_the_first_error(mpirun: Any) -> None:
    """Of three ranks all fail, two, or one."""
    done = mpirun(3, RANKS, "own", 0, 1, 2, timeout=60)
    assert done.returncode == 0, done.stderr
    expected = [
        f"{failing} {rank}: OutputError: rank {failing} failed"
        for failing in range(3)
        for rank in range(3)
    ]
    assert sorted(done.stdout.splitlines()) == expected


def test_a_defect_on_one_rank_is_told_to_the_others(mpirun: Any) -> None:
    done = mpirun(2, RANKS, "other", 1, timeout=60)
    assert done.returncode == 0, done.stderr
    expected = ["1 0: IncipientError: rank 1 failed", "1 1: ValueError: rank 1 failed"]
    assert sorted(done.stdout.splitlines()) == expected


# The second rank works where no file is, as on a machine without the disk of the first.
READING = """
import os, sys
from mpi4py import MPI
from incipient import SceneError, load

comm = MPI.COMM_WORLD
if comm.rank:
    os.chdir("/")
told = [str(load("scene.toml", ["fluid.reynolds=40"], comm).model_dump())]
for path, overrides in (("absent.toml", []), ("scene.toml", ["bed.file=absent.csv"])):
    try:
        load(path, overrides, comm)
    except SceneError as error:
        told.append(str(error))
print(f"{comm.rank}: " + "; ".join(told) + "\\n", end="")
"""


def test_one_rank_reads_a_scene_and_its_files_for_all(mpirun: Any, tmp_path: Path) -> None:
    (tmp_path / "bed.csv").write_text("x,y\n0,0\n15,0\n15.5,0.2\n16,0\n24,0\n")
    text = example().replace('"flat"', '"polyline"\nfile = "bed.csv"')
    (tmp_path / "scene.toml").write_text(text)
    done = mpirun(2, READING, timeout=60)
    assert done.returncode == 0, done.stderr
    first, second = sorted(done.stdout.splitlines())
    assert first.removeprefix("0: ") == second.removeprefix("1: ")
    assert "'reynolds': 40.0" in first and "(15.5, 0.2)" in first
    assert "; absent.toml: cannot be read" in first and "absent.csv cannot be read" in first


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(
            name, marks=pytest.mark.slow if name == "pebble" else ()
        )  # which takes seconds to settle
        for name in sorted(path.stem for path in SCENES.glob("*.toml"))
    ],
)
def test_scenes_can_be_sent_to_other_ranks(name: str) -> None:
    scene = load(SCENES / f"{name}.toml")
    assert pickle.loads(pickle.dumps(scene)) == scene


# What commands do on all ranks, in one start of them; the first rank reads and plans for the other.
EVERY_KIND = """
import json, sys
from pathlib import Path
from mpi4py import MPI
from incipient.cli import main

comm, failed = MPI.COMM_WORLD, {}
for path in sorted(Path(".").glob("*.toml")):
    options = ["--out", f"results/{path.stem}"] if sys.argv[1] == "run" else []
    if code := main([sys.argv[1], str(path), *options]):
        failed[path.stem] = code
if comm.rank == 0:
    Path("failed.json").write_text(json.dumps(failed))
"""


@pytest.mark.slow
@pytest.mark.parametrize("command", ["plan", pytest.param("run", marks=pytest.mark.slow)])
def test_each_kind_of_grain_and_bed_on_two_ranks(command: str, mpirun: Any, tmp_path: Path) -> None:
    """Scenes go from the first rank to the others, with grains whose curves are functions of an angle."""
    scenes = every_grain_and_bed()
    kinds = {tag(kind) for name in ("body", "bed") for kind in _kinds(name)}
    assert kinds == {word for name in scenes for word in name.split(" on ")}
    write_files(tmp_path)
    for name, scene in scenes.items():
        (tmp_path / f"{name}.toml").write_text(tomli_w.dumps(scene))
    done = mpirun(2, EVERY_KIND, command, timeout=1200 if command == "run" else 120)
    assert done.returncode == 0, done.stderr
    assert json.loads((tmp_path / "failed.json").read_text()) == {}, done.stderr


def _kinds(section: str) -> list[Any]:
    return list(variants(Scene.model_fields[section].annotation))


LEAVING = """
import os, subprocess, sys
from mpi4py import MPI
from incipient.parallel import leave_parallel_run
os.environ["SLURM_PROCID"] = "1"
def names():
    said = subprocess.check_output([sys.executable, "-c", "import os; print(*os.environ)"])
    return [name for name in said.decode().split() if name.startswith(("PMIX_", "PMI_", "OMPI_MCA_ess", "SLURM_"))]
before = names()
leave_parallel_run()
print(len(before) > 0, names(), MPI.COMM_WORLD.size)
"""


def test_children_of_a_rank_start_alone(mpirun: Any) -> None:
    """Also without the variables that the MPI library has set behind Python's back."""
    done = mpirun(1, LEAVING)
    assert done.stdout.split() == ["True", "[]", "1"], done.stderr
