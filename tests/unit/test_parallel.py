"""Ranks, memory and the environment of processes."""

from __future__ import annotations

import json
import multiprocessing
import shutil
import sys
import time
from collections import namedtuple
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
import tomli_w
from domains import curved_box, square_in_box
from environment import environment, finished, on_ranks
from kinds import every_grain_and_bed, write_files
from mpi4py import MPI
from ranks_script import box

from incipient import compat, form_cache
from incipient.accuracy.dual import goal_errors
from incipient.coupled.tractions import TractionProbe
from incipient.errors import ConvergenceError, OutputError
from incipient.fluid import FlowModel, Fluid
from incipient.fluid.conditions import Entering, Entry
from incipient.fluid.solvers.direct import Direct
from incipient.fluid.space import taylor_hood
from incipient.scene import Scene, loads
from incipient.scene.file import example
from incipient.scene.messages import tag, variants
from incipient.simulation.build import prepared

# Agreement on failure.


RANKS = """
from mpi4py import MPI
from incipient.errors import OutputError
from incipient.parallel import collectively

comm = MPI.COMM_WORLD
for number, failing in enumerate(((0, 1, 2), (1, 2), (2,), (1,))):
    try:
        with collectively(comm):
            if comm.rank in failing:
                raise (OutputError if number < 3 else ValueError)(f"rank {comm.rank} failed")
    except Exception as error:
        print(f"{number} {comm.rank}: {type(error).__name__}: {error}\\n", end="")
    comm.Barrier()
"""


def test_all_ranks_raise_the_first_error(mpirun: Any) -> None:
    """Of three ranks all fail, two, or one; a defect on one rank is told to the others."""
    expected = [
        *(f"{k} {rank}: OutputError: rank {k} failed" for k in range(3) for rank in range(3)),
        "3 0: IncipientError: rank 1 failed",
        "3 1: ValueError: rank 1 failed",
        "3 2: IncipientError: rank 1 failed",
    ]
    assert sorted(mpirun(3, RANKS, timeout=60).stdout.splitlines()) == expected


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
    first, second = sorted(mpirun(2, READING, timeout=60).stdout.splitlines())
    assert first.removeprefix("0: ") == second.removeprefix("1: ")
    assert "'reynolds': 40.0" in first and "(15.5, 0.2)" in first
    assert "; absent.toml: cannot be read" in first and "absent.csv cannot be read" in first


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
    sections = [Scene.model_fields[name].annotation for name in ("body", "bed")]
    kinds = {tag(kind) for section in sections for kind in variants(section)}
    assert kinds == {word for name in scenes for word in name.split(" on ")}
    write_files(tmp_path)
    for name, scene in scenes.items():
        (tmp_path / f"{name}.toml").write_text(tomli_w.dumps(scene))
    done = mpirun(2, EVERY_KIND, command, timeout=1200 if command == "run" else 120)
    assert json.loads((tmp_path / "failed.json").read_text()) == {}, done.stderr


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


# Two ranks give what one gives: forces, couples, norms; steady, unsteady, open and closed.


SCRIPT = Path(__file__).with_name("ranks_script.py")
# By what the iterations may leave: the direct solvers', and that of the solver by blocks.
CLOSE = {
    "open": 1e-9,
    "closed": 1e-9,
    "in_time": 1e-9,
    "turned": 1e-9,
    "stokes": 1e-7,
    "inertia": 1e-7,
    "estimated": 1e-7,
}


@pytest.fixture(scope="module")
def readings(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    """What one rank and two find, by case: all cases in one start of the ranks, which takes longer than they do."""
    result = []
    for ranks in (1, 2):
        command = [*on_ranks(ranks), sys.executable, SCRIPT, *CLOSE]
        surroundings = environment() | {"PYTHONPATH": str(SCRIPT.parents[1])}
        done = finished(command, 240, env=surroundings, cwd=tmp_path_factory.mktemp("ranks"))
        result.append(json.loads(done.stdout))
    return result


@pytest.mark.parametrize("case", CLOSE)
def test_two_ranks_agree_with_one(readings: list[dict[str, Any]], case: str) -> None:
    alone, together = (dict(result[case]) for result in readings)
    assert (alone.pop("ranks"), together.pop("ranks")) == (1, 2)
    for name, value in alone.items():
        close = {"rel": CLOSE[case], "abs": CLOSE[case] * np.abs(value).max()}
        assert np.asarray(together[name]) == pytest.approx(np.asarray(value), **close), name


# What fails while it is being made gives back the memory that PETSc has lent it.


def made_in_vain() -> None:
    Fluid(square_in_box(0.3, 0.5), FlowModel(order=2), box(), 20.0)


def estimated_in_vain() -> None:
    fluid = Fluid(square_in_box(0.3, 0.5), FlowModel(order=2), box(), 20.0)
    with fluid, goal_errors(fluid, "body", (0.8, 0.55)):
        pass


def prepared_in_vain() -> None:
    with prepared(loads(example(), overrides=["numerics.mesh_size=6"]), MPI.COMM_SELF):
        raise AssertionError("prepared all the same")


@pytest.mark.parametrize(
    ("owner", "name", "act", "orders"),
    [
        # The finer elements' memory goes, then that of the flow itself.
        (Fluid, "correct", estimated_in_vain, [3, 2]),
        (Direct, "__init__", made_in_vain, [2]),
        (TractionProbe, "__init__", prepared_in_vain, [3]),
    ],
)
def test_what_fails_while_it_is_made_gives_its_memory_back(
    owner: type, name: str, act: Any, orders: list[int]
) -> None:
    """Matrices and vectors: the handle of what has been destroyed is null."""
    with (
        patch.object(owner, name, side_effect=ConvergenceError("no solution")),
        patch.object(Fluid, "destroy", autospec=True, side_effect=Fluid.destroy) as destroy,
        pytest.raises(ConvergenceError),
    ):
        act()
    destroyed = [call.args[0] for call in destroy.call_args_list]
    assert [one.space.order for one in destroyed] == orders
    lent = ("_matrix", "_vector", "_correction")
    assert not any(getattr(one, held) for one in destroyed for held in lent)


# Folders of compiled forms: whole or not there, whoever is killed, whatever is damaged.


COMM_OF_CACHE, NAME = MPI.COMM_SELF, "0123456789"


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


@pytest.mark.parametrize(("damage", "loads"), [("co", 0), ("junk", 0), ("co\0\0", 0), ("", 1)])
def test_a_damaged_form_is_compiled_anew(tmp_path: Path, damage: str, loads: int) -> None:
    """Without being loaded first: a library that was cut short ends the process (SIGBUS).

    One that cannot be loaded, whole as it is, may be of another version of Python.
    """
    form_cache.compiled(tmp_path, NAME, COMM_OF_CACHE, Compiler("code" if damage else "other"))
    if damage:
        (tmp_path / NAME / "form.so").write_text(damage)
    build = Compiler()
    assert form_cache.compiled(tmp_path, NAME, COMM_OF_CACHE, build) == "code"
    assert (build.built, build.loaded) == (1, loads)
    assert form_cache.compiled(tmp_path, NAME, COMM_OF_CACHE, build) == "code" and build.built == 1


def test_a_folder_that_another_process_renames_meanwhile_is_passed_over(tmp_path: Path) -> None:
    (tmp_path / f"{NAME}.of_another").symlink_to("renamed")  # is listed, then no longer there
    assert form_cache.compiled(tmp_path, NAME, COMM_OF_CACHE, Compiler()) == "code"
    assert (tmp_path / NAME).is_dir()


def test_a_full_disk_is_named(tmp_path: Path, monkeypatch: Any) -> None:
    def failing(folder: Path) -> str:
        raise RuntimeError("gcc failed with exit code 1")

    with pytest.raises(RuntimeError, match="gcc"):
        form_cache.compiled(tmp_path, NAME, COMM_OF_CACHE, failing)
    usage = namedtuple("usage", "total used free")(2**30, 2**30, 0)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage)
    with pytest.raises(OutputError, match=f"^{tmp_path}: the disk is full, .* XDG_CACHE_HOME"):
        form_cache.compiled(tmp_path, NAME, COMM_OF_CACHE, failing)


def compiled_slowly(root: Path) -> None:
    def build(folder: Path) -> None:
        if not (folder / "form.so").exists():
            (folder / "form.so").write_text("c")
            time.sleep(0.3)
            (folder / "form.so").write_text("code")
        assert (folder / "form.so").read_text() == "code"

    form_cache.compiled(root, NAME, COMM_OF_CACHE, build)


def test_of_four_that_compile_at_once_each_gets_the_whole_form(tmp_path: Path) -> None:
    fork = multiprocessing.get_context("fork")
    them = [fork.Process(target=compiled_slowly, args=(tmp_path,)) for _ in range(4)]
    for one in them:
        one.start()
    for one in them:
        one.join(60)
    assert [one.exitcode for one in them] == [0] * 4
    assert [path.name for path in tmp_path.iterdir()] == [NAME]


RANKS_OF_CACHE = """
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
        done = mpirun(3, RANKS_OF_CACHE.replace("CACHE", str(tmp_path / "caches")), timeout=60)
        said.add(done.stdout)
    assert len(said) == 1  # the second time nothing is compiled


# The layer between dolfinx's versions, as far as flows do not show it.


LOGGING = """
import logging, sys
logging.basicConfig(level=logging.INFO, stream=sys.stdout)
from mpi4py import MPI  # first: of PyPI's packages it finds the library
import dolfinx, ufl
from incipient import compat
mesh = dolfinx.mesh.create_unit_square(MPI.COMM_SELF, 1, 1)
u = dolfinx.fem.Function(compat.space(mesh, ("Lagrange", 1)))
compat.interpolate(dolfinx.fem.Function(u.function_space), 2.0 * u)
compat.form(u**2 * ufl.dx(metadata={"quadrature_degree": 30}))
logging.getLogger().info("mine")
logging.getLogger("ffcx").warning("also mine")
logging.getLogger().setLevel(logging.WARNING)
compat.form(u**3 * ufl.dx)
assert logging.getLogger().level == logging.WARNING
"""


def test_a_program_that_logs_hears_nothing_of_builds(
    mpirun: Any, tmp_path: Path, monkeypatch: Any
) -> None:
    """A quadrature of degree 30 has 256 points, of which the form compiler warns; nothing is in the cache yet."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    done = mpirun(1, LOGGING)
    assert (done.stdout.splitlines(), done.stderr) == (
        ["INFO:root:mine", "WARNING:ffcx:also mine"],
        "",
    )


# What enters a channel below a free surface: the discharge asked for, whatever the depth.


@pytest.mark.parametrize("rise", [0.0, 0.25, -0.5])
@pytest.mark.parametrize(
    ("profile", "discharge"),
    [
        (lambda y, t: (1.0 + t) * y * (2.0 - y), 1.0),  # 1.5 times 2/3
        (lambda y, t: np.cos(np.pi * y), 0.0),  # above a bottom at which the fluid sticks
    ],
)
def test_the_discharge_is_that_through_the_end_as_it_was_made(rise, profile, discharge):
    """A profile, on an end of the unit square whose height changes, is stretched; also where its discharge vanishes."""
    domain, velocity = curved_box(2, 3, 2), lambda x, t: profile(x[1], t)
    condition = Entering("left", 0, velocity, 0.4)
    made = Entry(domain, taylor_hood(domain.mesh, 2), condition, ("bottom",))
    made.update(0.5, domain.mesh.geometry.x)
    first = made.influx
    domain.mesh.geometry.x[:, 1] *= 1.0 + rise
    made.update(0.5, domain.mesh.geometry.x)
    assert made.influx == pytest.approx(first, rel=1e-13)
    assert not discharge or first == pytest.approx(discharge, rel=1e-14)
    on = np.setdiff1d(
        *(compat.nodes_on(made.space, domain.facets_of(n)) for n in ("left", "bottom"))
    )
    height = made.space.tabulate_dof_coordinates()[on, 1] / (1.0 + rise)
    exact = profile(height, 0.5) / (1.0 + rise)
    assert made.values.x.array[on] == pytest.approx(exact, abs=1e-14)
