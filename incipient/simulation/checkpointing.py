"""Checkpoint of a run."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from ..fluid.transient import Transient
from ..planning.discretisation import with_order
from ..restart import Checkpoint, Progress, StoredMotion, numbered_nodes, stored_flow, stored_mesh
from ..scene.file import dumps
from .state import Run


def collected(run: Run) -> Checkpoint:
    """Checkpoint of a run between steps, complete on rank 0. Collective."""
    assert run.march is not None
    transient, coupling = run.march.transient, run.march.coupling
    fluid = transient.fluid
    states = [fluid.state.x.array, *(one.state for one in transient.past)]
    parts: dict[str, Any] = {**stored_flow(fluid, states)}
    for part in run.parts:
        parts |= part.stored(transient)
    motion = None
    if coupling is not None:
        nodes = numbered_nodes(fluid.domain.mesh)
        places = nodes.joined(np.stack(coupling.places, axis=1))
        motion = StoredMotion(nodes.joined(coupling.motion.reference), places)
    return Checkpoint(
        # Later versions may choose another order.
        scene=dumps(with_order(run.scene, run.plan.order)),
        progress=_progress(run, transient),
        mesh=stored_mesh(fluid.domain),
        times=np.array([fluid.time, *(one.time for one in transient.past)]),
        motion=motion,
        **parts,
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
