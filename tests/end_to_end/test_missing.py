"""Where mpi4py, dolfinx or what they need, is not installed: what can be done is done, the rest named."""

from __future__ import annotations

import ctypes
import subprocess
import sys
from pathlib import Path

import pytest
from environment import environment, on_ranks
from processes import CAVITY, GRAIN_ON_BED, SCENES, Finished, settings

from incipient import MissingError
from incipient.installed import COMPILER, LIBRARIES, MODULES, missing, required

ROOT = Path(__file__).parents[2]
CASE = SCENES.parent / "cases" / "disc_in_pocket.toml"
COARSE = settings(numerics_order=2, numerics_mesh_size=4)
# The command where some modules cannot be found.
WITHOUT = """
import sys

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in sys.argv[1].split(","):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Finder())
from incipient.cli import main
raise SystemExit(main(sys.argv[2:]))
"""


def without(modules: str, *arguments: object, ranks: int = 1, **variables: str) -> Finished[str]:
    """`incipient ARGUMENTS` in a process, or ranks, of its own that cannot find the modules."""
    return subprocess.run(
        [
            *(on_ranks(ranks) if ranks > 1 else []),
            sys.executable,
            "-c",
            WITHOUT,
            modules,
            *map(str, arguments),
        ],
        env=environment() | variables,
        capture_output=True,
        text=True,
        timeout=120,
    )


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--help"], "judge forces from another program"),
        (["plan", GRAIN_ON_BED], "memory are not known: gmsh is not installed"),
        (["judge", CASE], "The grain stays at rest"),
        (["schema"], '"properties"'),
    ],
    ids=lambda value: value[0].strip("-") if isinstance(value, list) else "",
)
def test_what_needs_no_flow_works_without_its_libraries(arguments: list[object], said: str) -> None:
    done = without(",".join(MODULES), *arguments)
    assert done.returncode == 0, done.stderr
    assert said in done.stdout


@pytest.mark.parametrize("module", ["mpi4py", "dolfinx", "h5py", "gmsh"])
def test_a_run_names_the_missing_module(module: str, tmp_path: Path) -> None:
    done = without(module, "run", CAVITY, *COARSE, "--out", tmp_path)
    assert_one_line(done, f"{module} is not installed", "apt-get install python3-dolfinx")


@pytest.mark.slow
def test_a_module_that_one_rank_misses_ends_both(tmp_path: Path) -> None:
    """gmsh is for the first rank only."""
    done = without("gmsh", "run", CAVITY, *COARSE, "--out", tmp_path, ranks=2)
    assert_one_line(done, "gmsh is not installed", "pip install 'incipient[dolfinx]'")


@pytest.mark.parametrize("ranks", [pytest.param(1, marks=pytest.mark.slow), 2])
def test_a_missing_compiler_is_named(ranks: int, tmp_path: Path) -> None:
    elsewhere = {"CC": "no-such-compiler", "XDG_CACHE_HOME": str(tmp_path)}
    done = without("", "run", CAVITY, *COARSE, "--out", tmp_path / "x", ranks=ranks, **elsewhere)
    assert_one_line(done, "needs a C compiler and Python's headers", "gcc libc6-dev python3-dev")


def assert_one_line(done: Finished[str], what: str, remedy: str) -> None:
    assert done.returncode == MissingError.exit_code, done.stderr
    (line,) = [line for line in done.stderr.splitlines() if line.startswith("incipient: ")]
    assert what in line and remedy in line
    assert "Traceback" not in done.stderr


def test_a_missing_library_is_named() -> None:
    with (
        pytest.raises(
            MissingError, match=r"libNone\.so\.7 is not installed: .*apt-get install libglu1-mesa"
        ),
        required(),
    ):
        ctypes.CDLL("libNone.so.7")


@pytest.mark.parametrize("text", ["docs/install.md", ".ci/debian13"])
def test_what_the_system_must_have_is_the_same_wherever_it_is_said(text: str) -> None:
    said = set((ROOT / text).read_text().replace("`", " ").split())
    assert {*LIBRARIES.split(), *COMPILER.split()} <= said


def test_other_errors_pass() -> None:
    with pytest.raises(ModuleNotFoundError, match="nowhere"), required():
        import nowhere  # noqa: F401
    assert missing(OSError("No space left on device")) is None
