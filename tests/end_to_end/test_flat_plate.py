"""A plate in a uniform turbulent stream by the k-omega SST model: against two programs, and Blasius."""

from pathlib import Path

import boundary_layer
import numpy as np
import pytest
from scenes import message

import incipient
from incipient.scene import (
    Disc,
    Domain,
    Effects,
    Flat,
    Numerics,
    OpenChannel,
    Output,
    Scene,
    Sinusoidal,
    Time,
    Turbulence,
)
from incipient.scene.file import load

SCENE = Path(__file__).parents[2] / "demos/scenes/flat_plate.toml"
# C_f at x = 0.970084 by CFL3D and FUN3D on their finest grids (benchmarks/reference/k_omega_sst.csv).
PLACE, FRICTION = 0.970084, 0.00269
REYNOLDS = 5e6
BLASIUS = 0.664


def plate(mesh_size, **changes):
    """The scene of the demo, without error bars."""
    numerics = Numerics(mesh_size=mesh_size, order=2, error_bars=False)
    return load(SCENE).model_copy(
        update={"numerics": numerics, "output": Output(fields=False)} | changes
    )


def friction(result, places):
    along = result.turbulence.along["bed"]
    return np.interp(places, along["x"], along["friction"])


def test_a_plate_on_few_cells():
    """C_f on 3,000 unknowns a component, where its mesh errs by 2.3%; ahead of the turbulent layer that of Blasius."""
    result = incipient.run(plate(2.0))
    found = float(friction(result, PLACE))
    laminar = np.array([2e3, 4e3])
    ratio = friction(result, laminar / REYNOLDS) / (BLASIUS / np.sqrt(laminar))
    print(found, found / FRICTION, ratio)
    assert found == pytest.approx(FRICTION, rel=0.03)
    assert ratio == pytest.approx(1.0, abs=0.05)
    assert not result.turbulence.backward


@pytest.mark.slow
def test_a_plate_is_that_of_two_programs():
    """Within 1% on 11,000 unknowns a component; extrapolated within 0.5%, also of the boundary-layer equations."""
    found = []
    for mesh_size in (2.0, 2.0**0.5, 1.0):
        result = incipient.run(plate(mesh_size))
        found.append(float(friction(result, PLACE)))
        unknowns = result.velocity.function_space.dofmap.index_map.size_global
        print(mesh_size, found[-1], unknowns, result.turbulence.lines())
    assert unknowns <= 15_000
    assert found[-1] == pytest.approx(FRICTION, rel=0.01)
    assert result.turbulence.applicable
    first, second = np.diff(found)
    assert 0.0 < 1.5 * second < first
    limit = found[-1] + second**2 / (first - second)
    layer = boundary_layer.friction(1.0 / REYNOLDS, 1.0, 1.125 / REYNOLDS, 125.0)
    of_layer = float(np.interp(PLACE, *layer))
    print(limit, of_layer)
    assert limit == pytest.approx(FRICTION, rel=0.005)
    assert limit == pytest.approx(of_layer, rel=0.005)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"bed": None}, 'bed: is missing; give kind = "flat", the plate'),
        (
            {"bed": Sinusoidal(amplitude=0.01, wavelength=1.0)},
            'bed.kind: "sinusoidal" below a uniform turbulent',
        ),
        (
            {"bed": Flat(leading_edge=3.0)},
            "bed.leading_edge: is 3, not within the domain from -0.333 to 2",
        ),
        (
            {"body": Disc(diameter=0.1, centre=(1.0, 1.0))},
            '"uniform" is not simulated with turbulence past a grain',
        ),
        (
            {"turbulence": Turbulence(model="k-omega-sst")},
            "turbulence.inflow: developed flow is no uniform stream",
        ),
        (
            {"domain": Domain(length=2.0, height=1.0, origin=(-0.5, 0.0), top="wall")},
            'domain.top: "wall" contradicts a uniform stream',
        ),
        ({"time": Time(end=1.0, step=0.1)}, "time: along a plate is not simulated by this version"),
        (
            {"numerics": Numerics(accuracy=0.01)},
            "numerics.accuracy: in a uniform stream is not simulated by this version",
        ),
        (
            {"flow": OpenChannel(), "turbulence": Turbulence(model="k-omega-sst")},
            'bed.leading_edge: contradicts flow.kind = "open-channel"; leave it out',
        ),
        (
            {"effects": Effects(), "turbulence": None},
            "bed.leading_edge: is read only with turbulence; leave it out",
        ),
        (
            {"turbulence": Turbulence()},
            'flow.kind: "uniform" with turbulence is not simulated by this version',
        ),
    ],
)
def test_what_contradicts_a_plate_is_told_in_one_line(changes, words):
    scene = load(SCENE)
    sections = {name: getattr(scene, name) for name in type(scene).model_fields}
    assert words in message(lambda: Scene(**{**sections, **changes}))
