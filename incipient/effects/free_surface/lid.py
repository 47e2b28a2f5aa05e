"""Error of a rigid lid: rise of a free surface by the pressure under the lid."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from ...fluid.space import boundary_blocks
from ...planning.flow_setup import Setup
from ..run_part import Solving


def rise_under_lid(run: Solving) -> float:
    """Largest pressure head under the lid, relative to the outflow or, in a closed domain, the mean. Collective."""
    scene, fluid, comm = run.scene, run.fluid, run.comm
    space, gravity = fluid.space.pressure, scene.gravity_vector
    nodes = boundary_blocks(space, fluid.domain.facets_of(Setup(scene).sides.top))
    own = nodes[nodes < space.dofmap.index_map.size_local]
    away = space.tabulate_dof_coordinates()[own, 0] - scene.domain.right
    # The omitted hydrostatic pressure varies along an inclined lid.
    heads = (fluid.pressure.x.array[own] + gravity[0] * away) / abs(gravity[scene.up])
    if fluid.constraints.closed:
        total, count = comm.allreduce(np.array([heads.sum(), len(heads)]))
        heads -= total / max(count, 1)
    return float(comm.allreduce(float(np.abs(heads).max(initial=0.0)), op=MPI.MAX))
