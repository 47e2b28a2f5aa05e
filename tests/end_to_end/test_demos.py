"""The demo scripts run, on two ranks as well, and give the numbers pinned in demos/expected.json.

    PYTHONPATH=tests python tests/end_to_end/test_demos.py

runs them and pins the numbers anew.
"""

import ast
import json
import sys
import tempfile
from itertools import product
from pathlib import Path

import pytest
from environment import environment, finished, on_ranks
from processes import result_of

DEMOS = Path(__file__).parents[2] / "demos"
EXPECTED = DEMOS / "expected.json"
SCRIPTS = sorted(DEMOS.glob("*.py"))
COARSE = ["numerics.mesh_size=2.0"]
RUNS = {
    "cavity.py": ["100"],
    "grain_on_bed.py": ["1", "10"],
    "pothole.py": ["1", "4", "--set", *COARSE, "--set", "time.end=0.8"],
    "settling.py": [
        "disc",
        *COARSE,
        "output.every=0",
        "body.centre=[2.0, 2.0]",
        "contact.friction=0.5",
        "contact.gap=0.1",
    ],
    "shear_orbit.py": ["numerics.mesh_size=3.0", "time.step=0.5", "output.every=0"],
}
# What each prints once for every result.
SAID = {"cavity.py": "Driven cavity, Re = 100", "grain_on_bed.py": "verdict"}


def run_demo(script, ranks, directory, arguments=None):
    """Run a demo in a directory; its results by name, as they are pinned."""
    asked = arguments or RUNS[script]
    command = [*(on_ranks(ranks) if ranks > 1 else ()), sys.executable, DEMOS / script, *asked]
    done = finished(command, 240, env=environment(), cwd=directory)
    assert done.returncode == 0, done.stderr
    names = sorted(path.name for path in (Path(directory) / "results").iterdir())
    return done, {name: pinned(result_of(Path(directory) / "results" / name)) for name in names}


def pinned(result):
    """The numbers of a result that are pinned, by name."""
    numbers = {"unknowns": result["cost"]["unknowns"]}
    for name, extremum in (result["centrelines"] or {}).items():
        numbers[name] = extremum["value"]
    if path := result["trajectory"]:
        numbers |= {"x": path["place"][0], "y": path["place"][1], "angle": path["angle"]}
        numbers |= {"time": path["ended"]["time"], "remeshings": len(path["remeshings"])}
    elif result["force"] is not None:
        numbers |= {"force_x": result["force"]["flow"][0], "force_y": result["force"]["flow"][1]}
        numbers |= {"couple": result["torque"]["flow"][2], "moves": result["verdict"]["moves"]}
    return numbers


def versions():
    """Versions on which the meshes depend, and with them the last digits."""
    import dolfinx
    import gmsh

    return {"dolfinx": dolfinx.__version__, "gmsh": gmsh.__version__}


# By default one scene of those that differ by their gravity only.
FEWER = {("grain_on_bed.py", 1): (["10"], ["grain_10"])}
# Two ranks, and the other demos, are left to `make test-slow`.
DEFAULT = [("cavity.py", 1), ("grain_on_bed.py", 1), ("pothole.py", 1), ("settling.py", 1)]


@pytest.mark.parametrize(
    ("script", "ranks"),
    [
        *DEFAULT,
        *(
            pytest.param(*one, marks=pytest.mark.slow)
            for one in product(RUNS, (2,))
            if one not in DEFAULT
        ),
    ],
)
def test_demo_gives_its_numbers(script, ranks, tmp_path):
    expected = json.loads(EXPECTED.read_text())
    close = 1e-6 if versions() == expected["versions"] else 1e-3
    arguments, names = FEWER.get((script, ranks), (None, expected[script]))
    done, found = run_demo(script, ranks, tmp_path, arguments)
    assert list(found) == sorted(names)
    for name in found:
        numbers = expected[script][name]
        if close > 1e-6:
            meshes = {key: found[name][key] for key in ("unknowns", "remeshings") if key in numbers}
            numbers = {**numbers, **meshes}
        assert found[name] == pytest.approx(numbers, rel=close, abs=close), name
        assert (tmp_path / "results" / name / "fields.xdmf").exists()
    assert done.stdout.count(SAID.get(script, "it is at (")) == len(found)


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.name)
def test_demo_is_short_and_says_what_it_is(script):
    tree = ast.parse(script.read_text())
    assert sum(isinstance(node, ast.stmt) for node in ast.walk(tree)) <= 31  # the length of a page
    said = ast.get_docstring(tree) or ""
    for heading in ("Scaling:", "Cost:", "Run:"):
        assert f"\n{heading}" in said
    parallel = (
        "--scheduler" if "sweep" in script.name else f"mpirun -n 2 python demos/{script.name}"
    )
    assert parallel in said  # a sweep has workers of its own


if __name__ == "__main__":
    made = {"versions": versions()}
    for name in RUNS:
        with tempfile.TemporaryDirectory() as place:
            made[name] = run_demo(name, 2, place)[1]
    EXPECTED.write_text(json.dumps(made, indent=2) + "\n")
