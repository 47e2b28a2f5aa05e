"""A measured profile that enters between walls: rows of developed flow give that flow back."""

import numpy as np
import pytest
from turbulent import inflow_at

from incipient import make_plan
from incipient.errors import SceneError
from incipient.planning.flow_setup import Setup
from incipient.scene import Domain, Effects, Fluid, OpenChannel, Poiseuille, Scene, Turbulence

MODELS = pytest.mark.parametrize("model", ["k-omega-sst", "k-epsilon"])
ROWS = [[0.1, 0.8], [0.5, 1.0], [0.9, 1.1]]


def scene(turbulence, flow=None, reynolds=20000.0):
    return Scene(
        domain=Domain(length=6.0, height=1.0),
        fluid=Fluid(reynolds=reynolds, scale="flow"),
        flow=flow or OpenChannel(),
        effects=Effects(turbulence=True),
        turbulence=turbulence,
    )


def asked(rows, **changes):
    kind = {"model": "k-omega-sst", "inflow": "profile", "profile": rows}
    return Turbulence(**{**kind, "intensity": 1e-6, "length": 0.1, **changes})


@pytest.mark.parametrize("sand", [0.0, 0.02])
@pytest.mark.parametrize("flow", [OpenChannel(), Poiseuille()])
def test_rows_of_developed_flow_give_it_back(flow, sand):
    """u* within 6%: at y+ = 30 the law is not the model's own; omega by the mixing length at the rows."""
    wall = {"wall": "rough", "roughness": sand} if sand else {}
    developed = scene(Turbulence(model="k-omega-sst", **wall), flow)
    heights = np.array([0.03, 0.06, 0.1, 0.15, 0.25, 0.4, 0.6, 0.8])
    if flow.kind == "poiseuille":
        heights = np.concatenate([heights[:6], 1.0 - heights[5::-1]])
    speed, k, _ = inflow_at(developed, heights)
    rows = np.column_stack([heights, speed, k])
    found, was = scene(asked(rows.tolist(), **wall), flow), Setup(developed).walls
    assert Setup(found).walls.shear_velocity == pytest.approx(was.shear_velocity, rel=0.06)
    places = np.geomspace(was.nearest, 0.45, 40)
    fast, _, _ = inflow_at(found, places)
    in_developed, _, _ = inflow_at(developed, places)
    outer = places > 0.03
    assert fast[outer] == pytest.approx(in_developed[outer], rel=2e-2)
    assert np.abs(fast - in_developed).max() < 0.15 * in_developed.max()
    _, k, omega = inflow_at(found, heights)
    away = np.minimum(heights, 1.0 - heights) if flow.kind == "poiseuille" else heights
    length = np.minimum(0.41 * away, 0.1)
    by_length = np.sqrt(k) / (0.09**0.25 * length)
    assert omega[1:-1] == pytest.approx(by_length[1:-1], rel=0.04)


@MODELS
def test_rows_of_the_law_of_the_wall_give_k_in_equilibrium(model):
    """k = u*^2/C_mu^(1/2) in the logarithmic layer, where damping is none; a third column is k itself."""
    y = np.geomspace(0.02, 0.98, 9)
    law = 0.04 * (np.log(0.04e5 * y) / 0.41 + 5.2)
    rows = np.column_stack([y, law]).tolist()
    flow = scene(asked(rows, model=model, length=1.0), reynolds=1e5)
    near = np.array([0.05, 0.1])
    speed, k, second = inflow_at(flow, near)
    assert speed == pytest.approx(0.04 * (np.log(0.04e5 * near) / 0.41 + 5.2), rel=2e-3)
    assert k == pytest.approx(0.04**2 / 0.3, rel=0.02)
    omega = np.sqrt(k) / (0.09**0.25 * 0.41 * near)
    assert second == pytest.approx(omega if model == "k-omega-sst" else 0.09 * k * omega, rel=0.01)
    third = scene(asked([[*row, 0.01] for row in rows], model=model), reynolds=1e5)
    assert inflow_at(third, near)[1] == pytest.approx(0.01, rel=1e-3)


def test_below_the_rows_the_bed_upstream_may_be_rough():
    """The law of sand holds down to smooth walls, u* is the one of rough walls."""
    rough = Setup(scene(asked(ROWS, wall="rough", roughness=0.02))).walls
    flow = scene(asked(ROWS)).model_copy(
        update={"turbulence": asked(ROWS, upstream_roughness=0.02)}
    )
    found = Setup(flow).walls
    assert found.roughness == 0.0 and found.is_resolved
    assert found.shear_velocity == pytest.approx(rough.shear_velocity, rel=1e-8)


@pytest.mark.parametrize("over_sand", [5.0, 20.0])
def test_a_row_over_rough_sand_has_the_shear_velocity_of_the_law_of_nikuradse(over_sand):
    """1/0.41 ln(y/k_s) + 8.5 (Schlichting & Gersten 2017, section 17.1.2), where u* k_s/nu is 300."""
    speed = 0.05 * (np.log(over_sand) / 0.41 + 8.5)
    rows = [[0.01 * over_sand, speed], [0.9, 1.1]]
    walls = Setup(
        scene(asked(rows, wall="rough", roughness=0.01), reynolds=300.0 / 0.01 / 0.05)
    ).walls
    assert walls.shear_velocity == pytest.approx(0.05, rel=1e-6)


@MODELS
@pytest.mark.parametrize("flow", [OpenChannel(velocity=3.0), Poiseuille(velocity=3.0)])
def test_a_uniform_flow_enters_beyond_thin_layers_at_walls(flow, model):
    """Its mean is V, its k 3/2 of the square of the intensity, its mixing length as given or kappa y."""
    given = Turbulence(model=model, inflow="given", intensity=0.05, length=0.1)
    made = scene(given, flow, reynolds=2e5)
    y = (np.arange(4001) + 0.5) / 4001
    speed, k, second = inflow_at(made, y)
    assert speed.mean() == pytest.approx(3.0, rel=5e-3)
    beyond = (y > 0.1) & (y < 0.9)
    assert np.ptp(speed[beyond]) < 0.01 * 3.0
    assert k[2000] == pytest.approx(1.5 * 0.15**2, rel=0.05)
    omega = second[2000] if model == "k-omega-sst" else second[2000] / (0.09 * k[2000])
    assert k[2000] ** 0.5 / omega / 0.09**0.25 == pytest.approx(0.1, rel=1e-3)
    developed = scene(Turbulence(model=model), flow, reynolds=2e5)
    assert Setup(made).bed_stress() == pytest.approx(Setup(developed).bed_stress(), rel=1e-9)


def test_rows_beyond_a_wall_are_refused():
    for rows, words in (
        ([*ROWS[:2], [1.2, 1.0]], "has a row at 1.2"),
        ([*ROWS[:2], [1.0, 1.0]], "has a row at 1, the wall on top is 1 above that below"),
    ):
        with pytest.raises(SceneError, match=words):
            make_plan(scene(asked(rows), Poiseuille()))


@pytest.mark.filterwarnings("error")
@MODELS
def test_a_row_at_the_water_surface_is_a_row_like_others(model):
    """There is no wall to take a u* of; speeds between rows are the ones with a row just below it."""
    heights = np.array([0.3, 0.7, 0.95])
    found = [
        inflow_at(scene(asked([[0.1, 0.7], [0.5, 0.9], [top, 1.0]], model=model)), heights)[0]
        for top in (1.0, 1.0 - 1e-9)
    ]
    assert found[0] == pytest.approx(found[1], rel=1e-6)


@MODELS
def test_the_stress_on_the_bed_is_that_of_the_lower_row(model):
    """Between walls, below a profile that is fast at the upper one; cells are made for the larger u*."""
    rows = [[0.1, 0.5], [0.5, 1.0], [0.9, 1.0]]
    between = Setup(scene(asked(rows, model=model), Poiseuille(), reynolds=2e5))
    below = Setup(scene(asked(rows, model=model), reynolds=2e5))
    assert between.bed_stress() == pytest.approx(below.bed_stress(), rel=0.02)
    assert between.walls.shear_velocity**2 > 2.0 * between.bed_stress()
