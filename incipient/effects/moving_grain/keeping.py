"""A moving grain to a checkpoint and back. Every function is collective unless said otherwise."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

import numpy as np

from ...body.rigidbody import MeanLoad
from ...body.state import BodyState
from ...coupled.coupling import Coupling
from ...coupled.remeshing import Remeshing
from ...coupled.rigid import End
from ...fluid import Transient
from ...restart.checkpoint import Body, Checkpoint
from ...restart.redistribution import numbered_nodes, spread_nodes

if TYPE_CHECKING:
    from .part import MovingGrain


def stored(grain: MovingGrain, coupling: Coupling, transient: Transient) -> Body:
    """The grain, its coupling to the fluid and its mesh."""
    part, mean = grain.part, grain.part.mean_load
    nodes = numbered_nodes(coupling.fluid.domain.mesh)
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
        velocities=np.array([one.velocities for one in transient.past]).reshape(-1, grain.body.size),
        met=coupling.met,
        remeshings=[asdict(one) for one in grain.remeshings],
        interface_iterations=np.array(grain.interface_iterations),
    )


def restore(grain: MovingGrain, body: Body, coupling: Coupling) -> None:
    """Give the grain its state and past, and the mesh its places now and before."""
    part, mesh = grain.part, coupling.fluid.domain.mesh
    part.mesh.weights[:] = spread_nodes(mesh, body.weights)
    grain.remeshings = [Remeshing(**one) for one in body.remeshings]
    grain.interface_iterations = body.interface_iterations.astype(int).tolist()
    coupling.places = list(np.moveaxis(spread_nodes(mesh, body.places), 1, 0).copy())
    part.past = [BodyState.unpacked(*one) for one in zip(body.states, body.times.tolist(), strict=True)]
    part.state, part.met = part.past[0], body.met
    part.end = End(part.state, body.load, body.flow_load, body.length)
    part.mean_load = MeanLoad(body.mean_load_order, body.mean_load, body.mean_load_step)


def state_of_mesh(kept: Checkpoint) -> BodyState:
    """The grain's state for which the mesh of a checkpoint was made. Not collective."""
    assert kept.body is not None
    return BodyState.unpacked(kept.body.made_for)
