"""A moving grain to a checkpoint and back. Every function is collective unless stated otherwise."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np

from ...body.rigidbody import MeanLoad
from ...body.state import BodyState
from ...coupled.coupling import Coupling
from ...coupled.remeshing import Remeshing
from ...coupled.rigid import End, RigidPart
from ...fluid.transient import Transient
from ...restart.checkpoint import StoredBody
from ...restart.redistribution import numbered_nodes, spread_nodes


def stored(
    part: RigidPart,
    remeshings: list[Remeshing],
    interface_iterations: list[int],
    coupling: Coupling,
    transient: Transient,
) -> StoredBody:
    """A moving grain, its coupling to the fluid and its mesh, and how it has come so far."""
    mean = part.mean_load
    nodes = numbered_nodes(coupling.fluid.domain.mesh)
    return StoredBody(
        made=nodes.joined(coupling.motion.reference),
        weights=nodes.joined(part.mesh.weights),
        made_for=BodyState.at(part.mesh.placement).packed(),
        states=np.array([one.packed() for one in part.past]),
        times=np.array([one.time for one in part.past]),
        places=nodes.joined(np.stack(coupling.places, axis=1)),
        mean_load=mean.previous,
        mean_load_order=mean.order,
        mean_load_step=mean.last_step,
        load=part.end.load,
        flow_load=part.end.flow_load,
        length=part.end.length,
        velocities=np.array([one.velocities for one in transient.past]).reshape(-1, part.body.size),
        met=coupling.met,
        remeshings=[asdict(one) for one in remeshings],
        interface_iterations=np.array(interface_iterations),
    )


def restore(part: RigidPart, body: StoredBody, coupling: Coupling) -> None:
    """Give the grain its state and past, and the mesh its places now and before."""
    mesh = coupling.fluid.domain.mesh
    part.mesh.weights[:] = spread_nodes(mesh, body.weights)
    coupling.places = list(np.moveaxis(spread_nodes(mesh, body.places), 1, 0).copy())
    part.past = [
        BodyState.unpacked(*one) for one in zip(body.states, body.times.tolist(), strict=True)
    ]
    part.state, part.met = part.past[0], body.met
    part.end = End(part.state, body.load, body.flow_load, body.length)
    part.mean_load = MeanLoad(body.mean_load_order, body.mean_load, body.mean_load_step)
