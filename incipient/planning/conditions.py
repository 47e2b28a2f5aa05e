"""The boundary conditions of a flow, by which the base flow enters."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..meshes.solid_region import SYMMETRY
from .base_flow import Velocity
from .flow_setup import Setup

if TYPE_CHECKING:
    from ..fluid import Condition


def conditions(setup: Setup, held: bool = False, lid: bool = False, speed: float = 1.0) -> list[Condition]:
    """Boundary conditions in the order in which they override each other: walls last, so corners are watertight.

    With `lid` a rigid lid takes the place of a free surface. With `speed` they are those of a flow faster by that
    factor, in its own units.
    The velocity of a moving grain's surface is given within each step, or is that of time zero if it is `held`.
    """
    scene, geometry, sides = setup.scene, setup.geometry, setup.sides
    if setup.has_wall_layer:
        from . import wall_conditions

        return wall_conditions.conditions(setup)
    from ..fluid import Carried, Open, Prescribed, Seeping, Slip, no_slip

    if scene.has_surface:
        from . import surface_conditions

    bottom, right, top, left = sides.around
    base_flow = setup.base_flow_at(speed)
    walls: list[str] = []
    moving: list[tuple[str, Velocity]] = []
    free: list[Condition] = []
    seeping: list[Condition] = []
    surface = scene.has_surface and not lid
    if scene.domain.kind == "channel" and surface:
        free.extend(surface_conditions.ends(setup))
    elif scene.domain.kind == "channel":
        enters = setup.resolved_walls.velocity if setup.resolves_walls else base_flow.entering
        moving.append((left, enters))
        free.append(Open(right))
    elif scene.has_surface and setup.surface.ends == "wall":
        free.extend((Slip(left, axis=0), Slip(right, axis=0)))
    else:
        walls.extend((left, right))
    if scene.surface is not None and scene.surface.bottom == "slip":
        free.append(Slip(bottom, axis=geometry.up))
    elif scene.surface is not None and scene.surface.seepage != "0":
        seeping.append(Seeping(bottom, surface_conditions.seepage(setup.surface, geometry.up)))
    elif _is_wall(setup):
        walls.append(bottom)
    else:
        moving.append((bottom, base_flow.velocity))
    if sides.ahead:
        free.append(Slip(sides.ahead, axis=geometry.up))
    if surface:
        free.append(surface_conditions.free_surface(setup))
    elif geometry.top in ("slip", "free-surface"):
        free.append(Slip(top, axis=geometry.up))
    elif geometry.top == "wall" and scene.flow.kind != "lid":
        walls.append(top)
    else:
        moving.insert(0, (top, base_flow.velocity))
    for name in sides.across:
        if geometry.sides == "slip":
            free.append(Slip(name, axis=1))
        elif geometry.sides == "wall":
            walls.append(name)
        else:
            moving.insert(0, (name, base_flow.velocity))
    if geometry.symmetric:
        free.append(Slip(SYMMETRY, axis=1))
    if geometry.moves and held:
        from .body import velocity_at_first

        assert scene.body is not None and geometry.placement is not None
        first = velocity_at_first(scene.body, geometry.placement, geometry.symmetric)
        free.append(Prescribed("body", first))
    elif geometry.moves:
        free.append(Carried("body"))
    elif geometry.grain is not None:
        walls.append("body")
    return [*free, *(Prescribed(*one) for one in moving), *seeping, *(no_slip(name) for name in walls)]


def _is_wall(setup: Setup) -> bool:
    """Whether the bottom is a wall at rest rather than part of the base flow."""
    geometry = setup.geometry
    bounded = geometry.domain.kind == "box" or geometry.top in ("wall", "free-surface")
    bounded = bounded or setup.base_flow.flow.kind in ("open-channel", "log-law")
    return bounded or geometry.bed is not None
