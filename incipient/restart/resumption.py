"""From a run to its checkpoint, and back: into a run made anew, on any number of ranks."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

import numpy as np
from mpi4py import MPI

from ..fluid import Transient
from ..fluid.transient import Past
from ..mesh.domain import Domain
from ..scene.file import dumps
from ..scene.order import with_order
from .checkpoint import Checkpoint, Progress
from .redistribution import spread_flow, spread_mesh, spread_nodes, stored_flow, stored_mesh

if TYPE_CHECKING:
    from ..simulation.state import Run


# -- to the checkpoint ------------------------------------------------------------------------------


def collected(run: Run) -> Checkpoint:
    """All that the run needs to go on, of tables this rank's rows. Collective.

    To be called between steps, when the last one has been recorded.
    """
    assert run.march is not None
    transient = run.march.transient
    fluid = transient.fluid
    states = [fluid.state.x.array, *(one.state for one in transient.past)]
    return Checkpoint(
        # With the order that the flow has, whatever a later version would choose.
        scene=dumps(with_order(run.scene, run.plan.order)),
        progress=_progress(run, transient),
        mesh=stored_mesh(fluid.domain),
        times=np.array([fluid.time, *(one.time for one in transient.past)]),
        flow=stored_flow(fluid, states),
        **{
            name: one
            for part in run.parts
            for name, one in part.stored(run.march.coupling, transient).items()
        },
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
