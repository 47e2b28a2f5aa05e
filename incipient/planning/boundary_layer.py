"""Cells at a grain in space, which follow its boundary layer."""

import numpy as np

from .flow_setup import Setup
from .numbers import speed_past_grain

# Cells at the grain's surface over its size, for mesh_size = 1 (docs/space.md), by the order of the velocity.
GRAIN_CELL = {2: 0.15, 3: 0.22, 4: 0.3}
# The boundary layer of a held grain thins as Re^-1/2: from this Reynolds number on cells at the grain do, to this part.
LAYERED, THINNEST = 50.0, 0.2


def thinner(setup: Setup) -> float:
    """The factor by which the boundary layer of a held grain makes the cells at it smaller. Not collective."""
    geometry, base_flow = setup.geometry, setup.base_flow
    if geometry.grain is None or geometry.moves or base_flow.creeping or setup.is_averaged:
        return 1.0
    reynolds = speed_past_grain(setup) * geometry.grain.size / base_flow.viscosity
    return float(np.clip((LAYERED / max(reynolds, LAYERED)) ** 0.5, THINNEST, 1.0))


def is_convected(setup: Setup, reynolds: float | None) -> bool:
    """Whether in a step in time convection outweighs rate and viscosity in the cells at a grain.

    That is |c|/h against 3/(2 dt) + nu/h^2, the speed by the grain's Reynolds number. Not collective.
    """
    scene, grain = setup.scene, setup.geometry.grain
    if scene.time is None or grain is None or not reynolds or scene.gdim == 2:
        return False
    cell = scene.numerics.mesh_size * thinner(setup) * GRAIN_CELL[setup.order.number] * grain.size
    viscosity = setup.base_flow.viscosity
    return reynolds * viscosity / grain.size / cell > 1.5 / scene.time.step + viscosity / cell**2
