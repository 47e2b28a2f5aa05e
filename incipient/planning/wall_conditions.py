"""Boundary conditions of a mean flow, whose walls resist it by a law a distance beyond the mesh."""

from __future__ import annotations

from functools import partial
from types import SimpleNamespace

import ufl

from ..fluid.conditions import Condition, Friction, Open, Prescribed, Slip
from ..meshes import SYMMETRY
from .cells import CLOSED
from .flow_setup import Setup

UFL = SimpleNamespace(log=ufl.ln, larger=ufl.max_value, sin=ufl.sin, cos=ufl.cos, sqrt=ufl.sqrt)


def conditions(setup: Setup) -> list[Condition]:
    """Boundary conditions of a turbulent flow. Not collective."""
    walls, sides, geometry = setup.walls, setup.sides, setup.geometry
    closing = CLOSED if setup.scene.closes_contacts else ()
    rubbing: list[Condition] = [
        Friction(
            name,
            walls.slip(name),
            partial(walls.law(name).drag, functions=UFL),
            geometry.up if walls.is_beyond(name) else None,
            moves=name == "body" and geometry.moves,
        )
        for name in (*walls.names, *closing)
    ]
    lids: list[Condition] = []
    if sides.top not in walls.names:
        lids.append(Slip(sides.top, axis=geometry.up))
    across = (*sides.across, SYMMETRY) if geometry.symmetric else sides.across
    lids += [Slip(name, axis=1) for name in across]
    return [Open(sides.right), *rubbing, *lids, Prescribed(sides.left, walls.inflow.velocity)]
