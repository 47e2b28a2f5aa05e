"""The law of the wall, smooth or rough, at any distance, and how far from walls meshes end."""

import numpy as np
import pytest
from one_dimensional import law_of_the_wall
from turbulent import channel, grain, inflow_at

from incipient import make_plan
from incipient.errors import SceneError
from incipient.scene import Flat, Fluid, OpenChannel, Poiseuille, Sinusoidal, Turbulence
from incipient.setup.setup import Setup
from incipient.turbulence.wall_law import WallLaw, shift

FLUID = Fluid(reynolds=1e6, scale="flow")


def test_a_faster_flow_is_one_of_larger_reynolds_number_and_has_the_stress_of_its_own_law():
    """tau_b = (factor V)^2 (u*/V)^2, u*/V at the larger Reynolds number."""
    scene = grain(0.2)
    twice = Setup(scene).faster(2.0).scene
    assert twice.viscosity == pytest.approx(0.5 * scene.viscosity)
    once, faster = Setup(scene).bed_stress(), Setup(scene).bed_stress(2.0)
    assert faster == pytest.approx(4.0 * Setup(twice).walls.shear_velocity ** 2)
    assert 2.0 * once < faster < 4.0 * once


def test_the_law_of_the_wall():
    """u+ = ln(y+)/0.41 + 5.2; on rough walls ln(y/k_s)/0.41 + 8.5 (Nikuradse 1933); u* from the speed and back."""
    smooth, rough = WallLaw(), WallLaw(roughness=0.2)
    assert smooth.velocity(1.0, 0.01, 1.0) == pytest.approx(np.log(100) / 0.41 + 5.2)
    assert rough.velocity(1.0, 1e-5, 1.0) == pytest.approx(np.log(5) / 0.41 + 8.5, rel=1e-12)
    for law in (smooth, rough, WallLaw(roughness=1e-3)):
        speeds = np.array([0.3, 1.0, 30.0])
        found = law.shear_velocity(speeds, 1e-4, 0.3)
        assert found * law.velocity(found, 1e-4, 0.3) == pytest.approx(speeds, rel=1e-7)


def test_between_smooth_and_rough_walls_the_law_is_nikuradse_s():
    """As `tests/one_dimensional.py` has it from the source: sand is not felt up to u* k/nu of 2.25, rough from 90."""
    sand = np.array([1.0, 2.25, 5.0, 20.0, 60.0, 90.0, 1000.0])
    found = [float(WallLaw(roughness=1e-3 * one).velocity(1.0, 1e-3, 2.0)) for one in sand]
    assert found == pytest.approx([float(law_of_the_wall(2000.0, one)) for one in sand], abs=2e-3)
    assert found[1] == pytest.approx(np.log(2000.0) / 0.41 + 5.2)


def test_in_the_viscous_sublayer_friction_is_that_of_a_linear_profile():
    """u+ = y+ below 11.06: u*^2 = nu U/y, whatever k says there (exact); u* from the speed and back."""
    law, viscosity, y = WallLaw(), 1e-3, 2e-3
    speeds = np.array([0.1, 1.0, 10.0])
    u = law.shear_velocity(speeds, viscosity, y)
    assert (u * y / viscosity < 11.06).all()
    assert u**2 == pytest.approx(viscosity * speeds / y, rel=1e-12)
    assert law.velocity(u, viscosity, y) * u == pytest.approx(speeds, rel=1e-12)
    assert law.drag(speeds, 0.0, viscosity, y) == pytest.approx(viscosity / y, rel=2e-3)


@pytest.mark.parametrize("k", [5e-4, 0.005, 0.05])
def test_rough_walls_are_as_far_as_they_are_high(k):
    """The default is the larger of 50 nu/u* and the roughness; a grain is smooth."""
    rough = Turbulence(wall="rough", roughness=k)
    walls = Setup(channel(turbulence=rough, fluid=FLUID)).walls
    assert walls.nearest == pytest.approx(max(50.0 * walls.unit, k))
    with_grain = Setup(grain(0.5, 1e6).model_copy(update={"turbulence": rough})).walls
    assert with_grain.law("body").roughness == 0.0 and with_grain.law("bed").roughness == k
    assert with_grain.distance("body") == pytest.approx(50.0 * with_grain.unit)


@pytest.mark.parametrize("sand", [3.0, 11.0, 40.0, 300.0])
def test_a_rough_wall_in_the_viscous_sublayer_is_a_smooth_one_farther_away(sand):
    """Where u+ is what Nikuradse's roughness takes away: none below u* k/nu = 5, 8.5 at 32.6ths of the roughness."""
    lost = 5.2 - 8.5 + np.log(sand) / 0.41
    if sand < 90.0:
        lost *= np.sin(0.4258 * (np.log(sand) - 0.811))
    y = shift(sand)
    bent = 1.0 - np.exp(-y / 11.0) - y / 11.0 * np.exp(-y / 3.0)
    reichardt = np.log1p(0.41 * y) / 0.41 + (5.2 - np.log(0.41) / 0.41) * bent
    assert reichardt == pytest.approx(max(lost, 0.0), abs=2e-3)
    rough = Turbulence(model="k-omega-sst", wall="rough", roughness=sand / 2000.0)
    walls = Setup(channel(fluid=Fluid(reynolds=35000, scale="flow"), turbulence=rough)).walls
    beyond = walls.from_origin("bottom") - walls.nearest
    assert beyond == pytest.approx(shift(walls.roughness / walls.unit) * walls.unit)
    assert walls.law("bottom").roughness == 0.0


def test_walls_are_never_farther_than_a_part_of_the_depth_a_grain_and_forms():
    """However slow the flow is: a fifth of the depth, half a grain, twice the smallest length of forms."""
    slow = Fluid(reynolds=500, scale="flow")
    bed = Sinusoidal(amplitude=0.004, wavelength=0.04)
    assert Setup(channel(fluid=slow)).walls.nearest == pytest.approx(0.2)
    assert Setup(grain(0.05, 500.0)).walls.distance("body") == pytest.approx(0.025)
    found = Setup(channel(fluid=slow, bed=bed))
    assert found.walls.nearest == pytest.approx(2.0 * found.scene.bed_shape.feature)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"turbulence": {"wall_distance": 0.3}},
            r"wall_distance: is 0.3, at most 0.2 in this depth",
        ),
        (
            {"turbulence": {"wall": "rough", "roughness": 0.3}},
            "roughness: is 0.3, 30% of the depth",
        ),
    ],
)
def test_walls_that_are_too_far_or_too_rough_are_refused(changes, words):
    with pytest.raises(SceneError, match=words):
        make_plan(channel(fluid=FLUID, **changes))
    with pytest.raises(SceneError, match=r"roughness: is 0\.1, 50% of the depth or the grain"):
        make_plan(
            grain(0.2).model_copy(update={"turbulence": Turbulence(wall="rough", roughness=0.1)})
        )


@pytest.mark.parametrize("bed", [None, Flat()])
@pytest.mark.parametrize("model", ["k-epsilon", "k-omega-sst"])
@pytest.mark.parametrize("flow", [OpenChannel(velocity=3.0), Poiseuille(velocity=3.0)])
def test_the_mean_velocity_that_enters_is_that_of_the_flow(flow, model, bed):
    """With what flows between the mesh and plane walls, by the law."""
    found = channel(flow=flow, turbulence=Turbulence(model=model), bed=bed)
    walls = Setup(found).walls
    inner = np.linspace(walls.nearest, 1 - (walls.number - 1) * walls.nearest, 20001)
    y = (np.arange(20000) + 0.5) / 20000 * walls.nearest
    u = walls.shear_velocity
    below = walls.number * walls.nearest * u * WallLaw().velocity(u, found.viscosity, y).mean()
    speeds, k, second = inflow_at(found, 0.5 * (inner[1:] + inner[:-1]))
    assert speeds.mean() * (inner[-1] - inner[0]) + below == pytest.approx(3.0, rel=1e-4)
    assert (k > 0).all() and (second > 0).all()
