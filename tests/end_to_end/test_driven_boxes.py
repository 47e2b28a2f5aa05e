"""Lid-driven boxes against spectral solutions, and what their error bars say of the difference."""

import csv
from pathlib import Path

import numpy as np
import pytest
from processes import CAVITY, settings

import incipient
from incipient.errors import SceneError
from incipient.files import plain
from incipient.mesh.sampling import sample
from incipient.reporting import part
from incipient.scene import Domain, Fluid, Lid, Numerics, Scene

REFERENCE = Path(__file__).parents[1] / "reference" / "cube_albensoeder_kuhlmann_2005.csv"
# Botella & Peyret, Benchmark spectral results on the lid-driven cavity flow, Comput. Fluids 27 (1998), Re = 1000.
BOTELLA_PEYRET = {
    "minimum of v1": -0.3885698,
    "maximum of v2": 0.3769447,
    "minimum of v2": -0.5270771,
}


def cube(reynolds: float, **numerics) -> Scene:
    return Scene(
        domain=Domain(kind="box", length=1.0, width=1.0, height=1.0),
        fluid=Fluid(reynolds=reynolds, scale="flow"),
        flow=Lid(),
        numerics=Numerics(**numerics),
    )


def spectral(line: str) -> np.ndarray:
    with REFERENCE.open(newline="") as file:
        rows = csv.DictReader(row for row in file if not row.startswith("#"))
        return np.array(
            [(float(r["position"]), float(r["value"])) for r in rows if r["line"] == line]
        ).T


@pytest.mark.parametrize("mesh_size", [1.0, 2.0])
def test_the_error_bar_of_a_cavity_holds_its_error(mesh_size, tmp_path):
    overrides = settings(numerics_mesh_size=mesh_size, numerics_order=3, fluid_reynolds=1000)
    scene = incipient.load(CAVITY, [one for one in overrides if one != "--set"])
    result = incipient.run(scene, tmp_path)
    off = max(abs(result.centrelines[name].value - value) for name, value in BOTELLA_PEYRET.items())
    # 1.4e-4 within 9.1e-4, and 1.6e-3 within 6.8e-3, when written: a bar ten times too wide would say little.
    assert off < result.error_bars.total.centreline.max() < 10.0 * off
    assert f"+- {result.error_bars.total.centreline.max():.1e}   at" in result.text()
    assert len(plain(result.to_dict())["error_bars"]["centreline"]) == 3
    assert "of velocities on centrelines" in part(tmp_path / "result.json")[0]


@pytest.mark.slow
def test_a_cube_on_its_default_cells_against_a_spectral_solution():
    result = incipient.run(cube(1000))
    (of_all,) = set(result.error_bars.total.centreline)
    for name, extreme in result.centrelines.items():
        ((place,), (value,)) = spectral(name)
        assert extreme.position == pytest.approx(place, abs=0.005), name
        # 0.5%, 0.4% and 1.6% when written
        assert extreme.value == pytest.approx(value, rel=0.02), name
        assert abs(extreme.value - value) < of_all, name
    for line, axis, component in (("v1", 2, 0), ("v3", 0, 2)):
        places, values = spectral(line)
        points = np.full((len(places), 3), 0.5)
        points[:, axis] = places
        assert sample(result.velocity, points)[:, component] == pytest.approx(values, abs=0.02), (
            line
        )


def test_without_coarser_cells_there_is_no_error_bar_and_the_run_says_why():
    result = incipient.run(cube(10, mesh_size=5.0, order=2))
    assert result.error_bars.total.centreline is None
    assert "fewer rows or columns of cells: use numerics.mesh_size = 4 or less" in result.text()


def test_a_cavity_in_time_makes_no_coarse_runs():
    overrides = settings(numerics_mesh_size=4.0, numerics_order=2, time_end=0.2, time_step=0.1)
    result = incipient.run(incipient.load(CAVITY, [one for one in overrides if one != "--set"]))
    assert result.error_bars is None and "in steady flow only" in result.without_error_bars


def test_a_cube_takes_an_accuracy_from_its_cells():
    with pytest.raises(SceneError, match=r"choose numerics\.mesh_size"):
        cube(10, accuracy=0.01)
