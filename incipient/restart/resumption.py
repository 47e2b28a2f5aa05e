"""From a run to its checkpoint, and back: into a run made anew, on any number of ranks."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

import numpy as np

from ..body.rigidbody import MeanLoad
from ..body.state import BodyState
from ..coupled.remeshing import Remeshing
from ..coupled.rigid import End, RigidPart
from ..fluid import Transient
from ..fluid.transient import Past
from ..mesh.domain import Domain
from ..scene.file import dumps
from ..scene.order import with_order
from .checkpoint import Body, Checkpoint, Progress, Surface
from .redistribution import (
    numbered_nodes,
    spread_flow,
    spread_mesh,
    spread_nodes,
    spread_turbulence,
    stored_flow,
    stored_mesh,
    stored_turbulence,
)

if TYPE_CHECKING:
    from mpi4py import MPI

    from ..simulation.free_surface import MovingSurface
    from ..simulation.moving_grain import Trajectory
    from ..simulation.state import Run
    from ..turbulence import InTime


# -- to the checkpoint ------------------------------------------------------------------------------


def collected(run: Run) -> Checkpoint:
    """All that the run needs to go on, of tables this rank's rows. Collective.

    To be called between steps, when the last one has been recorded.
    """
    transient = run.time_stepper
    assert transient is not None
    fluid, eddies = transient.fluid, run.eddies
    states = [fluid.state.x.array, *(one.state for one in transient.past)]
    return Checkpoint(
        # With the order that the flow has, whatever a later version would choose.
        scene=dumps(with_order(run.scene, run.plan.order)),
        progress=_progress(run, transient),
        mesh=stored_mesh(fluid.domain),
        times=np.array([fluid.time, *(one.time for one in transient.past)]),
        flow=stored_flow(fluid, states),
        body=None if run.trajectory is None else _body(run.trajectory),
        surface=None if run.surface is None else _surface(run.surface),
        turbulence=None if eddies is None else stored_turbulence(eddies.turbulence.space, eddies.past),
    )


def _progress(run: Run, transient: Transient) -> Progress:
    statistics = transient.fluid.solver.statistics
    return Progress(
        number=transient.number,
        next_length=transient.next_length,
        error=transient.last_error,
        first_motion=run.first_motion,
        iterations=dict(run.accounts.iterations),
        linear=asdict(statistics),
        wall_time=dict(run.accounts.ledger.wall_time),
        total=run.accounts.ledger.total(),
    )


def _surface(surface: MovingSurface) -> Surface:
    part, coupling = surface.part, surface.coupling
    nodes = numbered_nodes(surface.fluid.domain.mesh)
    return Surface(
        made=nodes.dealt(coupling.motion.reference),
        elevations=nodes.dealt(np.stack([part.mesh.on_nodes(one) for one in part.past], axis=1)),
        times=np.array(part.times),
        places=nodes.dealt(np.stack(coupling.places, axis=1)),
    )


def _body(travel: Trajectory) -> Body:
    part, transient, coupling = travel.part, travel.transient, travel.coupling
    nodes, mean = numbered_nodes(travel.domain.mesh), part.mean_load
    size = travel.body.size
    return Body(
        made=nodes.dealt(coupling.motion.reference),
        weights=nodes.dealt(part.mesh.weights),
        made_for=BodyState.at(part.mesh.placement).packed(),
        states=np.array([one.packed() for one in part.past]),
        times=np.array([one.time for one in part.past]),
        places=nodes.dealt(np.stack(coupling.places, axis=1)),
        mean_load=mean.previous,
        mean_load_order=mean.order,
        mean_load_step=mean.last_step,
        load=part.end.load,
        flow_load=part.end.flow_load,
        length=part.end.length,
        velocities=np.array([one.velocities for one in transient.past]).reshape(-1, size),
        met=coupling.met,
        remeshings=[asdict(one) for one in travel.remeshings],
        interface_iterations=np.array(travel.interface_iterations),
    )


# -- from the checkpoint ----------------------------------------------------------------------------


def domain_of(kept: Checkpoint, comm: MPI.Comm) -> Domain:
    """The mesh, where it was when it was made. Collective."""
    domain = spread_mesh(comm, kept.mesh)
    moving = kept.body or kept.surface
    if moving is not None:
        domain.mesh.geometry.x[:] = spread_nodes(domain.mesh, moving.made)
    return domain


def put_back_costs(kept: Progress, run: Run) -> None:
    """Let the run count on from what the sessions before have cost. Not collective."""
    run.would_move(kept.first_motion)
    run.accounts.count(**kept.iterations)
    run.accounts.ledger.count(kept.wall_time, kept.total)


def put_back_flow(kept: Checkpoint, transient: Transient) -> None:
    """Give the fluid its state, and the time integration its past. Collective."""
    fluid = transient.fluid
    present, *past = spread_flow(fluid, kept.flow)
    fluid.state.x.array[:], fluid.time = present, kept.time
    velocities = np.zeros((len(past), 0)) if kept.body is None else kept.body.velocities
    pasts = [Past(*one) for one in zip(kept.times[1:].tolist(), past, velocities, strict=True)]
    meshes = [] if kept.body is None else kept.body.remeshings
    new_mesh = meshes[-1]["time"] if meshes else -np.inf
    transient.resume(kept.progress.number, kept.progress.next_length, pasts, kept.progress.error, new_mesh)
    for name, number in kept.progress.linear.items():
        setattr(fluid.solver.statistics, name, number)


def state_of_mesh(kept: Body) -> BodyState:
    """The grain's place for which the stored mesh was made, with which the coupling is to be made anew."""
    return BodyState.unpacked(kept.made_for)


def put_back_body(kept: Checkpoint, travel: Trajectory) -> None:
    """Move the mesh to where it was, give the grain its state and past, then the flow. Collective.

    The trajectory is one made on the stored mesh, with the grain where `state_of_mesh` says.
    """
    body, coupling = kept.body, travel.coupling
    assert body is not None
    mesh = travel.domain.mesh
    travel.part.mesh.weights[:] = spread_nodes(mesh, body.weights)
    travel.remeshings = [Remeshing(**one) for one in body.remeshings]
    travel.interface_iterations = body.interface_iterations.astype(int).tolist()
    coupling.places = list(np.moveaxis(spread_nodes(mesh, body.places), 1, 0).copy())
    _put_back_part(body, travel.part)
    if travel.surface is not None:
        put_back_surface(kept, travel.surface)
    mesh.geometry.x[:] = coupling.places[0]
    coupling.fluid.constraints.boundary_points_moved()
    if travel.eddies is not None:
        put_back_turbulence(kept, travel.eddies)
    put_back_flow(kept, travel.transient)


def put_back_surface(kept: Checkpoint, surface: MovingSurface) -> None:
    """Move the mesh to where it was, and give the surface its past. Collective."""
    stored, part, coupling = kept.surface, surface.part, surface.coupling
    assert stored is not None
    mesh = surface.fluid.domain.mesh
    part.past = [part.mesh.from_nodes(one) for one in spread_nodes(mesh, stored.elevations).T.copy()]
    part.times = stored.times.tolist()
    part.restore()
    coupling.places = list(np.moveaxis(spread_nodes(mesh, stored.places), 1, 0).copy())
    mesh.geometry.x[:] = coupling.places[0]
    coupling.fluid.constraints.boundary_points_moved()


def put_back_turbulence(kept: Checkpoint, eddies: InTime) -> None:
    """Give k and epsilon their states. Collective."""
    assert kept.turbulence is not None
    eddies.past = spread_turbulence(eddies.turbulence.space, kept.turbulence)
    eddies.turbulence.state.x.array[:] = eddies.past[0]


def _put_back_part(body: Body, part: RigidPart) -> None:
    part.past = [BodyState.unpacked(*one) for one in zip(body.states, body.times.tolist(), strict=True)]
    part.state, part.met = part.past[0], body.met
    part.end = End(part.state, body.load, body.flow_load, body.length)
    part.mean_load = MeanLoad(body.mean_load_order, body.mean_load, body.mean_load_step)
