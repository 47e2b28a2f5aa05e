"""The mesh and the flow of a run that resumes from a checkpoint, on any number of ranks."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from ..fluid.transient import Past, Transient
from ..mesh.domain import Domain
from .checkpoint import Checkpoint
from .redistribution import spread_flow, spread_mesh, spread_nodes


def domain_of(kept: Checkpoint, comm: MPI.Comm) -> Domain:
    """The mesh, where it was when it was made. Collective."""
    domain = spread_mesh(comm, kept.mesh)
    moving = kept.body or kept.surface
    if moving is not None:
        domain.mesh.geometry.x[:] = spread_nodes(domain.mesh, moving.made)
    return domain


def put_back_flow(kept: Checkpoint, transient: Transient) -> None:
    """Give the fluid its state, and the time integration its past. Collective."""
    fluid = transient.fluid
    present, *past = spread_flow(fluid, kept.flow)
    fluid.state.x.array[:], fluid.time = present, kept.time
    velocities = np.zeros((len(past), 0)) if kept.body is None else kept.body.velocities
    pasts = [Past(*one) for one in zip(kept.times[1:].tolist(), past, velocities, strict=True)]
    meshes = [] if kept.body is None else kept.body.remeshings
    new_mesh = meshes[-1]["time"] if meshes else -np.inf
    transient.resume(
        kept.progress.number, kept.progress.next_length, pasts, kept.progress.error, new_mesh
    )
    for name, number in kept.progress.linear.items():
        setattr(fluid.solver.statistics, name, number)
