"""A measured profile that enters between resolved walls: rows of the model's own developed flow give that flow back."""

import numpy as np
import pytest

from incipient.errors import SceneError
from incipient.planning.flow_setup import Setup
from incipient.scene import Domain, Effects, Fluid, OpenChannel, Poiseuille, Scene, Turbulence


def scene(turbulence, flow=None):
    return Scene(
        domain=Domain(length=6.0, height=1.0),
        fluid=Fluid(reynolds=20000.0, scale="flow"),
        flow=flow or OpenChannel(),
        effects=Effects(turbulence=True),
        turbulence=turbulence,
    )


def asked(rows, **changes):
    kind = {"model": "k-omega-sst", "inflow": "profile", "profile": rows, "intensity": 1e-6, "length": 0.1}
    return Turbulence(**{**kind, **changes})


@pytest.mark.parametrize("flow", [OpenChannel(), Poiseuille()])
def test_rows_of_developed_flow_give_it_back(flow):
    """u* and, below the first row, speed, k and omega of the flow in one dimension; between rows they interpolate."""
    developed = Setup(scene(Turbulence(model="k-omega-sst"), flow)).resolved_walls
    heights = np.array([0.03, 0.06, 0.1, 0.15, 0.25, 0.4, *([0.6, 0.8] if developed.number == 1 else [])])
    if developed.number == 2:
        heights = np.concatenate([heights, 1.0 - heights[::-1]])
    places = np.zeros((3, len(heights)))
    places[1] = heights
    rows = np.column_stack(
        [heights, developed.velocity(places, 0.0)[0], np.exp(developed.logarithms(places)[0])]
    )
    found = Setup(scene(asked(rows.tolist()), flow)).resolved_walls
    assert found.shear_velocity == pytest.approx(developed.shear_velocity, rel=2e-3)
    x = np.zeros((3, 40))
    x[1] = np.geomspace(1e-4, 0.9 if developed.number == 1 else 0.45, 40)
    assert found.velocity(x, 0.0)[0] == pytest.approx(developed.velocity(x, 0.0)[0], rel=2e-2)
    near = x[1] < 0.015
    away = found.logarithms(x) - developed.logarithms(x)
    assert np.abs(away[:, near]).max() < 0.1
    # From the rows on omega is by the mixing length, kappa y, at most the one given.
    log_k, log_omega = found.logarithms(places)
    length = np.minimum(0.41 * found.from_next(places), 0.1)
    assert np.exp(log_omega) == pytest.approx(np.exp(log_k / 2) / (0.09**0.25 * length), rel=1e-6)
    x[1] = 1.0 - x[1]
    if developed.number == 2:
        assert np.abs((found.logarithms(x) - developed.logarithms(x))[:, near]).max() < 0.1


def test_what_is_not_simulated_is_refused():
    rows = [[0.1, 0.8], [0.5, 1.0]]
    with pytest.raises(SceneError, match=r'inflow: "given" in a channel'):
        scene(Turbulence(model="k-omega-sst", inflow="given", intensity=0.1, length=0.1))
    with pytest.raises(SceneError, match="between smooth walls"):
        scene(asked(rows, wall="rough", roughness=0.01))
    with pytest.raises(SceneError, match=r"has a row at 1\.2"):
        from incipient.effects.plan import make_plan

        make_plan(scene(asked([*rows, [1.2, 1.0]]), Poiseuille()))
