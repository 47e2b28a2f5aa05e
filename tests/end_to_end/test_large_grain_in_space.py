"""A large grain on the bed of a turbulent stream in space: its loads, and where they come from."""

import dolfinx
import pytest
import ufl
from mpi4py import MPI

import incipient
from incipient import compat
from incipient.scene import (
    Contact,
    Domain,
    Effects,
    Flat,
    Fluid,
    Gravity,
    Numerics,
    OpenChannel,
    Output,
    Scene,
    Sphere,
)
from incipient.simulation.assemble import outcome
from incipient.simulation.build import prepared


def stone(mesh_size=5.0, **changes):
    """A sphere of 0.4 of the depth on a level bed, u* d/nu about 3200; mean velocity and depth are 1."""
    sections = {
        "domain": Domain(length=2.0, width=1.2, height=1.0),
        "fluid": Fluid(reynolds=2e5, scale="flow"),
        "flow": OpenChannel(),
        "body": Sphere(diameter=0.4, x=0.8, density=2.65),
        "bed": Flat(),
        "gravity": Gravity(acceleration=10.0),
        "contact": Contact(friction=0.6, gap=0.03),
        "effects": Effects(turbulence=True),
        "numerics": Numerics(mesh_size=mesh_size, error_bars=False),
        "output": Output(fields=False),
    }
    return Scene(**{**sections, **changes})


def integral(domain, integrand):
    return domain.comm.allreduce(dolfinx.fem.assemble_scalar(compat.form(integrand)), op=MPI.SUM)


def balance(fluid, walls=("body", "bed")):
    """What walls bear along the stream, and what the stream loses on its way through what is meshed of a channel."""
    domain = fluid.domain
    v, _ = ufl.split(fluid.state)
    reaction = fluid.residual()[fluid.space.velocity_map[:: domain.gdim]].sum()
    carried = integral(domain, ufl.dot(ufl.grad(v), v)[0] * fluid.quadrature())
    n = ufl.FacetNormal(domain.mesh)
    turned = ufl.dot(ufl.grad(v).T, n)[0] - ufl.div(v) * n[0]
    leaving = integral(domain, fluid.viscosity * turned * domain.measure("outflow"))
    x = ufl.as_vector([1.0, *[0.0] * (domain.gdim - 1)])
    borne = [integral(domain, fluid.walls.power(fluid.state, x, name)) for name in walls]
    return borne, reaction - carried + leaving


def test_what_grain_and_bed_bear_is_what_the_stream_loses():
    """Balance of momentum along half of the channel, with the eddies of the inflow: to the tolerance of the flow.

    Force and couple are those of the whole grain; across the stream they vanish.
    """
    with prepared(stone(), MPI.COMM_SELF) as run:
        assert run.fluid.solve(1e-7).converged
        borne, lost = balance(run.fluid)
        force, result = run.probe.resultant(), outcome(run)
    assert sum(borne) == pytest.approx(lost, rel=1e-5)
    assert force.force[0] == pytest.approx(2.0 * borne[0], rel=1e-10)
    assert force.force[1] == force.couple[0] == force.couple[2] == 0.0
    assert result.turbulence.applicable and result.verdict["moves"]
