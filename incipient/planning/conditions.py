"""The boundary conditions of a scene's flow."""

from __future__ import annotations

from collections.abc import Iterator

from ..fluid.conditions import Carried, Condition, Open, Prescribed, Slip, no_slip
from ..meshes import SYMMETRY
from ..setup.base_flow import BaseFlow, Velocity
from ..setup.setup import Setup

# In which conditions override each other: walls last, so corners are watertight. Base flow is prescribed on sides,
# then above, then at the ends and below.
FREE, SIDES, ABOVE, AROUND, WALL = range(5)
Ranked = Iterator[tuple[int, Condition]]


def conditions(
    setup: Setup, held: bool = False, lid: bool = False, speed: float = 1.0
) -> list[Condition]:
    """Boundary conditions in the order in which they override each other: walls last, so corners are watertight.

    With `lid` a rigid lid replaces a free surface; with `speed` the flow is faster by that factor, in its own units.
    The velocity of a moving grain's surface is given within each step, or is that of time zero if it is `held`.
    """
    if setup.is_averaged:
        from . import wall_conditions

        return wall_conditions.conditions(setup)
    base_flow = setup.base_flow_at(speed)
    ranked = [
        *_at_ends(setup, base_flow, lid),
        *_below(setup, base_flow.velocity),
        *_above(setup, base_flow.velocity, lid),
        *_across(setup, base_flow.velocity),
        *_on_grain(setup, held),
    ]
    return [condition for _, condition in sorted(ranked, key=lambda pair: pair[0])]


def _at_ends(setup: Setup, base_flow: BaseFlow, lid: bool) -> Ranked:
    left, right, scene = setup.sides.left, setup.sides.right, setup.scene
    if scene.domain.kind == "channel" and scene.has_surface and not lid:
        from .surface_conditions import ends

        yield from ((FREE, end) for end in ends(setup))
    elif scene.domain.kind == "channel":
        yield AROUND, Prescribed(left, base_flow.entering)
        if scene.flow.oscillates:
            yield AROUND, Prescribed(right, base_flow.entering)
            return
        # A flow that reverses enters through this end, and without its momentum energy comes from nowhere.
        yield FREE, Open(right, base_flow.velocity if scene.flow.changes else None)
    elif scene.has_surface:
        yield from ((FREE, Slip(name, axis=0)) for name in (left, right))
    else:
        yield from ((WALL, no_slip(name)) for name in (left, right))


def _below(setup: Setup, velocity: Velocity) -> Ranked:
    bottom, scene = setup.sides.bottom, setup.scene
    wall = scene.domain.kind == "box" or scene.top in ("wall", "free-surface")
    if scene.has_surface and setup.surface.bottom == "slip":
        yield FREE, Slip(bottom, axis=scene.up)
    elif wall or scene.flow.wall_below or scene.bed_shape is not None:
        yield WALL, no_slip(bottom)
    else:
        yield AROUND, Prescribed(bottom, velocity)


def _above(setup: Setup, velocity: Velocity, lid: bool) -> Ranked:
    top, scene = setup.sides.top, setup.scene
    if scene.has_surface and not lid:
        from .surface_conditions import free_surface

        yield FREE, free_surface(setup)
    elif scene.has_surface or scene.top == "slip":
        yield FREE, Slip(top, axis=scene.up)
    elif scene.top == "wall" and not scene.flow.moves_top:
        yield WALL, no_slip(top)
    else:
        yield ABOVE, Prescribed(top, velocity)


def _across(setup: Setup, velocity: Velocity) -> Ranked:
    for name in setup.sides.across:
        if setup.scene.sides == "slip":
            yield FREE, Slip(name, axis=1)
        elif setup.scene.sides == "wall":
            yield WALL, no_slip(name)
        else:
            yield SIDES, Prescribed(name, velocity)
    if setup.symmetric:
        yield FREE, Slip(SYMMETRY, axis=1)


def _on_grain(setup: Setup, held: bool) -> Ranked:
    scene, body = setup.scene, setup.scene.body
    if scene.moves and held:
        from ..body.state import rigid_velocity
        from ..setup.body import initial_state

        assert body is not None and scene.placement is not None
        state = initial_state(body, scene.placement, setup.symmetric)
        yield FREE, Prescribed("body", lambda x, t: rigid_velocity(state, x[: scene.gdim].T).T)
    elif scene.moves:
        yield FREE, Carried("body")
    elif scene.grain is not None:
        yield WALL, no_slip("body")
