"""Turbulent channels that tests share, and what they look at in runs of grains that move there."""

import numpy as np
import pytest
import ufl
from domains import integral
from scenes import history_of

import incipient
from incipient.forms.turbulence import KEpsilon
from incipient.scene import (
    Disc,
    Domain,
    Effects,
    Flat,
    Fluid,
    Numerics,
    OpenChannel,
    Output,
    Scene,
    Turbulence,
)
from incipient.setup.setup import Setup
from incipient.turbulence.fields import TurbulenceFields

CHANNEL = {
    "domain": Domain(length=20, height=1),
    "fluid": Fluid(reynolds=11000, scale="flow"),
    "flow": OpenChannel(),
    "effects": Effects(turbulence=True),
}


def channel(**changes):
    return Scene(**{**CHANNEL, **changes})


def stream(reynolds, domain, mesh_size, model="k-omega-sst", **changes):
    """An open channel of mean velocity 1 in a domain, half of one between walls; by order 2, without error bars."""
    sections = {
        "domain": domain,
        "fluid": Fluid(reynolds=reynolds, scale="flow"),
        "flow": OpenChannel(),
        "effects": Effects(turbulence=True),
        "turbulence": Turbulence(model=model),
        "numerics": Numerics(mesh_size=mesh_size, order=2, error_bars=False),
        "output": Output(fields=False),
    }
    return Scene(**{**sections, **changes})


def assert_alike(scene, other, rel):
    """Runs of both scenes have the same force and torque on the grain; returns those of the first."""
    result, expected = incipient.run(scene), incipient.run(other)
    for of in ("force", "torque"):
        exact = getattr(expected, of).flow
        assert getattr(result, of).flow == pytest.approx(
            exact, rel=rel, abs=1e-6 * min(1.0, 100 * rel)
        )
    return result


def inflow_at(scene, heights):
    """Speeds, k and epsilon or omega (n,) at heights (n,) of a 2-D scene's inflow."""
    inflow, x = Setup(scene).walls.inflow, np.zeros((3, len(heights)))
    x[1] = heights
    return (inflow.velocity(x)[0], *np.exp(inflow.logarithms(x)))


def k_epsilon(domain, values, inflow=(), walls=None, **changes):
    """ln k and ln epsilon on a mesh."""
    return TurbulenceFields(domain, values, inflow, walls, k_epsilon=KEpsilon(), **changes)


def k_omega(domain, values, inflow=(), walls=None, viscosity=0.01, **changes):
    """ln k and ln omega on a mesh."""
    return TurbulenceFields(domain, values, inflow, walls, viscosity, **changes)


def grain(diameter, reynolds=2e5):
    return channel(
        fluid=Fluid(reynolds=reynolds, scale="flow"), body=Disc(diameter=diameter, x=4), bed=Flat()
    )


def balance(fluid, walls):
    """What walls bear along the stream, and what the stream loses on its way through what is meshed of a channel.

    Where the stream leaves freely -p n + nu dv/dn is none; what the stress has besides is counted.
    """
    domain = fluid.domain
    v, _ = ufl.split(fluid.state)
    inertia = ufl.dot(ufl.grad(v), fluid.carrier(v))[0]
    if fluid.model.unsteady:
        past = (ufl.split(one)[0][0] for one in (fluid.state, *fluid.history))
        inertia += sum(a * u for a, u in zip(fluid.rate, past, strict=True))
    reaction = fluid.residual()[fluid.space.velocity_map[:: domain.gdim]].sum()
    carried = integral(domain, inertia * fluid.quadrature())
    n = ufl.FacetNormal(domain.mesh)
    turned = ufl.dot(ufl.grad(v).T, n)[0] - ufl.div(v) * n[0]
    leaving = integral(domain, fluid.viscosity * turned * domain.measure("outflow"))
    x = ufl.as_vector([1.0, *[0.0] * (domain.gdim - 1)])
    borne = [integral(domain, fluid.walls.power(fluid.state, x, name)) for name in walls]
    return borne, reaction - carried + leaving


def changes_by_new_meshes(directory, run_of, from_row):
    """What new meshes change in a run, and cells finer by the root of two, (2,) each; the number of new meshes.

    Both of velocities and loads, after some rows. `run_of` takes whether meshes are many, a factor of the cells, and a
    directory.
    """
    ends = []
    for number, finer in enumerate((1.0, 1.0, 0.5**0.5)):
        run_of(number == 1, finer, directory / str(number))
        names = ("velocity_x", "velocity_y", "force_x", "force_y", "meshes")
        ends.append([history_of(directory / str(number))[name][from_row:] for name in names])
    (*one, _), (*many, meshes), (*fine, _) = np.array(ends)
    changed, wrong = (np.abs(np.subtract(these, one)) for these in (many, fine))
    result = [np.array([of[:2].max(), of[2:].max()]) for of in (changed, wrong)]
    print(meshes[-1], *result)
    return *result, meshes[-1]
