"""Boundary conditions of a mean flow, with laws of the wall a distance beyond the mesh."""

from __future__ import annotations

from functools import partial
from types import SimpleNamespace

import ufl

from ..fluid.conditions import Condition, Friction, Open, Prescribed, Slip
from ..meshes import SYMMETRY
from ..setup.geometry import CLOSED
from ..setup.setup import Setup

UFL = SimpleNamespace(log=ufl.ln, larger=ufl.max_value, sin=ufl.sin, cos=ufl.cos, sqrt=ufl.sqrt)


def conditions(setup: Setup) -> list[Condition]:
    """Boundary conditions of a turbulent flow."""
    walls, sides, scene = setup.walls, setup.sides, setup.scene
    closing = CLOSED if setup.scene.closes_contacts else ()
    rubbing: list[Condition] = [
        Friction(
            name,
            walls.slip(name),
            partial(walls.law(name).drag, functions=UFL),
            scene.up if walls.is_beyond(name) else None,
            moves=name == "body" and scene.moves,
        )
        for name in (*walls.names, *closing)
    ]
    lids: list[Condition] = []
    if sides.top not in walls.names:
        lids.append(Slip(sides.top, axis=scene.up))
    across = (*sides.across, SYMMETRY) if setup.symmetric else sides.across
    lids += [Slip(name, axis=1) for name in across]
    return [Open(sides.right), *rubbing, *lids, Prescribed(sides.left, walls.inflow.velocity)]
