"""Tutorials and demo scripts."""

from __future__ import annotations

import json
import re
import sys
import tempfile
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from environment import environment, finished, on_ranks
from processes import result_of
from pytest import approx
from scenes import ROOT

import incipient
from incipient.scene import loads

# The numbers that the tutorials print are those that their scenes give. The pages are the source of both.


# Meshes of another gmsh change loads by some 1e-4, safety factors and thresholds alike.
SHOWN = 2e-3


def scene_of(page: str, *overrides: str) -> incipient.Scene:
    """The scene that a tutorial tells its reader to write."""
    computed = re.search(r"as `(\w+)\.toml`:\n\n```toml\n(.*?)^```", text_of(page), re.M | re.S)
    assert computed
    return loads(computed[2], Path(), list(overrides), name=computed[1])


def text_of(page: str) -> str:
    return (ROOT / f"docs/tutorials/{page}.md").read_text()


def numbers(pattern: str, page: str) -> list[float]:
    """The numbers that the first match of a pattern in a tutorial has."""
    computed = re.search(pattern, text_of(page))
    assert computed, pattern
    return [float(group) for group in computed.groups()]


def test_the_first_verdict() -> None:
    """Loads within their bars, the range to a fifth: gmsh makes another mesh on another kind of processor."""
    result = incipient.run(scene_of("verdict"))
    x, y, turning = numbers(
        r"force of the flow +\(([\d.]+), ([\d.]+)\).* +torque about the centre of mass (-[\d.]+)",
        "verdict",
    )
    assert result.force and result.torque and result.verdict
    assert result.error_bars and result.error_bars.safety
    bars = result.error_bars.total.load[[0, 1, -1]]
    computed = np.array([*result.force.flow[:2], result.torque.flow[-1]])
    assert (np.abs(computed - [x, y, turning]) < bars).all()
    shown = r"certain [\w ]+: it rests; safety factor ([\d.]+), between ([\d.]+) and ([\d.]+)"
    bar = result.error_bars.safety
    on_page = tuple(numbers(shown, "verdict"))
    assert (bar.value, bar.low, bar.high) == approx(on_page, abs=0.2 * (bar.high - bar.low))
    assert bar.certain and not result.verdict["moves"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("page", "overrides", "pattern", "bound"),
    [
        (
            "verdict",  # of a lighter grain
            ["gravity.acceleration=1"],
            r"begins to move \(pivoting\), safety factor ([\d.]+)",
            {"rel": SHOWN},
        ),
        ("flume", [], r"a safety factor of ([\d.]+)\. ", {"abs": 0.02}),
    ],
)
def test_grains_that_pivot(page: str, overrides: list[str], pattern: str, bound: Any) -> None:
    verdict = incipient.run(scene_of(page, *overrides)).verdict
    assert verdict and verdict["mode"] == "pivoting"
    assert [verdict["safety_factor"]] == approx(numbers(pattern, page), **bound)


@pytest.mark.slow
def test_the_threshold() -> None:
    """The range to a fifth of its width: gmsh makes another mesh on another kind of processor."""
    critical = incipient.threshold(scene_of("verdict"))
    shown = numbers(r"threshold +([\d.]+) \(([\d.]+) to ([\d.]+)\)", "threshold")
    ends = critical.ranges["factor"]
    assert ends
    assert [critical.factor, *ends] == approx(shown, abs=0.2 * (shown[2] - shown[1]))
    (shields,) = numbers(r"Shields number +([\d.]+)", "threshold")
    assert critical.shields == approx(shields, rel=SHOWN)


@pytest.mark.slow
@pytest.mark.parametrize("reynolds", [1, 10, 100])
def test_the_curve(reynolds: int) -> None:
    """Each point of the page's table, within the error that stands beside it."""
    critical = incipient.threshold(scene_of("verdict", f"fluid.reynolds={reynolds}"))
    shields, error = numbers(rf"\| {reynolds} \| ([\d.]+) ± ([\d.]+)", "threshold")
    assert critical.shields == approx(shields, abs=error)


def test_the_shear_velocity_of_the_flume() -> None:
    """By its plan; by hand u* d/nu = 60 and a Shields number of 0.0278 are wanted."""
    said = incipient.make_plan(scene_of("flume")).text()
    (line,) = re.findall(r"Re\* [\d.]+, Shields number [\d.]+", said)
    assert line in text_of("flume")
    assert [float(word) for word in re.findall(r"[\d.]+", line)] == approx([60.0, 0.0278], rel=5e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("duration", "leaves"), [(2.0, True), (1.0, False)])
def test_a_grain_that_leaves_its_pocket(duration: float, leaves: bool) -> None:
    """By the gust of the page, and not by half of it, as the page says."""
    scene = scene_of("moving", f"flow.gust.duration={duration}", "output.every=0")
    trajectory = incipient.run(scene).trajectory
    assert trajectory
    on_bed = trajectory["on_bed"]
    assert (on_bed["left_pocket"] is not None) is leaves
    assert on_bed["first_motion"] is not None


# The demo scripts run, on two ranks as well, and give the numbers pinned in demos/expected.json.
#
#     PYTHONPATH=tests python tests/end_to_end/test_demos.py
#
# runs them and pins the numbers anew.


EXPECTED = ROOT / "demos" / "expected.json"
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
    command = [
        *(on_ranks(ranks) if ranks > 1 else ()),
        sys.executable,
        ROOT / "demos" / script,
        *asked,
    ]
    done = finished(command, 240, env=environment(), cwd=directory)
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

    from incipient.meshes.session import gmsh

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
    """To 1e-6 on the same meshes; other versions, and gmsh on another kind of processor, make others."""
    expected = json.loads(EXPECTED.read_text())
    arguments, names = FEWER.get((script, ranks), (None, expected[script]))
    done, computed = run_demo(script, ranks, tmp_path, arguments)
    assert list(computed) == sorted(names)
    same = versions() == expected["versions"]
    for name in computed:
        numbers = expected[script][name]
        meshes = {key: computed[name][key] for key in ("unknowns", "remeshings") if key in numbers}
        close = 1e-6 if same and meshes == {key: numbers[key] for key in meshes} else 1e-3
        assert not same or meshes["unknowns"] == approx(numbers["unknowns"], rel=0.01)
        numbers = {**numbers, **meshes}
        assert computed[name] == pytest.approx(numbers, rel=close, abs=close), name
        assert (tmp_path / "results" / name / "fields.xdmf").exists()
    assert done.stdout.count(SAID.get(script, "it is at (")) == len(computed)


if __name__ == "__main__":
    made = {"versions": versions()}
    for name in RUNS:
        with tempfile.TemporaryDirectory() as place:
            made[name] = run_demo(name, 2, place)[1]
    EXPECTED.write_text(json.dumps(made, indent=2) + "\n")
