"""Cells at a grain and its boundary layer, which those in 3-D follow."""

import math

import numpy as np

from .flow_setup import Setup
from .numbers import numbers_of, speed_past_grain, time_of_change

# Cells at the grain's surface over its size, for mesh_size = 1 (docs/contribute/defaults.md), by the order of the
# velocity.
GRAIN_CELL = {2: 0.05, 3: 0.1, 4: 0.15}
GRAIN_CELL_IN_SPACE = {2: 0.15, 3: 0.22, 4: 0.3}
# The boundary layer of a held grain thins as Re^-1/2: from this Reynolds number on cells at the grain do, to this part.
LAYERED, THINNEST = 50.0, 0.2


def thinner(setup: Setup) -> float:
    """The factor by which the boundary layer of a held grain makes the cells at it smaller. Not collective."""
    geometry, base_flow = setup.geometry, setup.base_flow
    if geometry.grain is None or geometry.moves or base_flow.creeping or setup.is_averaged:
        return 1.0
    reynolds = speed_past_grain(setup) * geometry.grain.size / base_flow.viscosity
    return float(np.clip((LAYERED / max(reynolds, LAYERED)) ** 0.5, THINNEST, 1.0))


def is_resolved(setup: Setup) -> bool:
    """Whether a cell at the grain, of second order, is within the boundary layer of an unsteady flow. Not collective.

    The layer has the thickness sqrt(nu t): t is the time since the start or, where they are shorter, the times in which
    the flow changes or passes the grain. Of higher orders as many nodes are within it.
    """
    scene, grain, viscosity = setup.scene, setup.geometry.grain, setup.base_flow.viscosity
    if scene.time is None or grain is None:
        return True
    reynolds, change = numbers_of(setup).grain_reynolds, time_of_change(setup.base_flow, scene.time)
    times = [scene.time.end]
    if change is not None:
        times.append(change)
    if reynolds and not setup.base_flow.creeping:
        times.append(grain.size**2 / (viscosity * reynolds))
    between_nodes = _cell(setup) * grain.size / setup.order.number
    return 2.0 * between_nodes <= math.sqrt(viscosity * min(times))


def _cell(setup: Setup) -> float:
    """Size of the cells at the grain over its own."""
    scene, order = setup.scene, setup.order.number
    if scene.gdim == 2:
        return scene.numerics.mesh_size * GRAIN_CELL[order]
    return scene.numerics.mesh_size * thinner(setup) * GRAIN_CELL_IN_SPACE[order]
