"""The undisturbed flow of a scene, and the boundary conditions that let it in."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..meshes.solid_region import SYMMETRY
from ..scene import Scene
from .base_flow import Velocity, inflow, undisturbed
from .cells import side_names, sides_across
from .open_channel import ends, seepage, surface_of

if TYPE_CHECKING:
    from ..fluid import Condition


def conditions(scene: Scene, held: bool = False, lid: bool = False, speed: float = 1.0) -> list[Condition]:
    """Boundary conditions in the order in which they override each other: walls last, so corners are watertight.

    With `lid` a rigid lid takes the place of a free surface. With `speed` they are those of a flow faster by that
    factor, in its own units.
    The velocity of a moving grain's surface is given within each step, or is that of time zero if it is `held`.
    """
    if scene.is_turbulent:
        from .turbulent_conditions import conditions as turbulent

        return turbulent(scene)
    from ..fluid import Carried, Open, Prescribed, Seeping, Slip, no_slip

    bottom, right, top, left = side_names(scene)
    stream = undisturbed(scene, speed)
    walls: list[str] = []
    moving: list[tuple[str, Velocity]] = []
    free: list[Condition] = []
    seeping: list[Condition] = []
    surface = scene.has_surface and not lid
    if scene.domain.kind == "channel" and surface:
        free.extend(ends(scene))
    elif scene.domain.kind == "channel":
        moving.append((left, inflow(scene, speed)))
        free.append(Open(right))
    elif scene.has_surface and surface_of(scene).ends == "wall":
        free.extend((Slip(left, axis=0), Slip(right, axis=0)))
    else:
        walls.extend((left, right))
    if scene.surface is not None and scene.surface.bottom == "slip":
        free.append(Slip(bottom, axis=scene.up))
    elif scene.surface is not None and scene.surface.seepage != "0":
        seeping.append(Seeping(bottom, seepage(scene)))
    elif _is_wall(scene):
        walls.append(bottom)
    else:
        moving.append((bottom, stream))
    if surface:
        from .surface import free_surface

        free.append(free_surface(scene))
    elif scene.top in ("slip", "free-surface"):
        free.append(Slip(top, axis=scene.up))
    elif scene.top == "wall" and scene.flow.kind != "lid":
        walls.append(top)
    else:
        moving.insert(0, (top, stream))
    for name in sides_across(scene):
        if scene.sides == "slip":
            free.append(Slip(name, axis=1))
        elif scene.sides == "wall":
            walls.append(name)
        else:
            moving.insert(0, (name, stream))
    if scene.symmetric:
        free.append(Slip(SYMMETRY, axis=1))
    if scene.body is not None and scene.body.moves and held:
        free.append(Prescribed("body", _velocity_at_first(scene)))
    elif scene.body is not None and scene.body.moves:
        free.append(Carried("body"))
    elif scene.body is not None:
        walls.append("body")
    return [*free, *(Prescribed(*one) for one in moving), *seeping, *(no_slip(name) for name in walls)]


def _velocity_at_first(scene: Scene) -> Velocity:
    """Velocity of the surface of a moving grain at time zero."""
    from ..body.state import rigid_velocity
    from .body import initial_state

    state = initial_state(scene)
    return lambda x, t: rigid_velocity(state, x[: scene.gdim].T).T


def _is_wall(scene: Scene) -> bool:
    """Whether the bottom is a wall at rest rather than part of the stream."""
    bounded = scene.domain.kind == "box" or scene.top in ("wall", "free-surface")
    bounded = bounded or scene.flow.kind in ("open-channel", "log-law")
    return bounded or scene.bed is not None
