"""A free surface to a checkpoint and back. Every function is collective."""

from __future__ import annotations

import numpy as np

from ...coupled.coupling import Coupling
from ...coupled.surface import SurfacePart
from ...restart.checkpoint import StoredSurface
from ...restart.redistribution import numbered_nodes, spread_nodes


def stored(part: SurfacePart, coupling: Coupling) -> StoredSurface:
    """Elevations now and before, and the places of the mesh."""
    nodes = numbered_nodes(coupling.fluid.domain.mesh)
    return StoredSurface(
        made=nodes.joined(coupling.motion.reference),
        elevations=nodes.joined(np.stack([part.mesh.on_nodes(one) for one in part.past], axis=1)),
        times=np.array(part.times),
        places=nodes.joined(np.stack(coupling.places, axis=1)),
    )


def restore(part: SurfacePart, kept: StoredSurface, coupling: Coupling) -> None:
    """Give the surface its elevations, and the mesh its places, now and before."""
    mesh = coupling.fluid.domain.mesh
    part.past = [part.mesh.from_nodes(one) for one in spread_nodes(mesh, kept.elevations).T.copy()]
    part.times = kept.times.tolist()
    part.restore()
    coupling.places = list(np.moveaxis(spread_nodes(mesh, kept.places), 1, 0).copy())
