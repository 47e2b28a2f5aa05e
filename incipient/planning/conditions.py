"""The boundary conditions of a scene's flow."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from ..fluid.conditions import Carried, Condition, Open, Prescribed, Slip, no_slip
from ..meshes import SYMMETRY
from ..setup.base_flow import BaseFlow, Velocity
from ..setup.setup import Setup

# In which conditions override each other: walls last, so corners are watertight. Base flow is prescribed on sides,
# then above, then at the ends and below.
FREE, SIDES, ABOVE, AROUND, WALL = range(5)
Ranked = Iterator[tuple[int, Condition]]
OfSurface = Mapping[str, list[Condition]]  # conditions that a free surface decides, by place


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
    of_surface: OfSurface = {}
    if setup.scene.has_surface:
        from . import surface_conditions

        of_surface = surface_conditions.by_place(setup, lid)
    base_flow = setup.base_flow_at(speed)
    ranked = [
        *_at_ends(setup, base_flow, of_surface),
        *_below(setup, base_flow.velocity, of_surface),
        *_above(setup, base_flow.velocity, of_surface),
        *_across(setup, base_flow.velocity),
        *_on_grain(setup, held),
    ]
    return [condition for _, condition in sorted(ranked, key=lambda pair: pair[0])]


def _at_ends(setup: Setup, base_flow: BaseFlow, of_surface: OfSurface) -> Ranked:
    left, right = setup.sides.left, setup.sides.right
    if "ends" in of_surface:
        yield from ((FREE, one) for one in of_surface["ends"])
    elif setup.scene.domain.kind == "channel":
        yield AROUND, Prescribed(left, base_flow.entering)
        if base_flow.flow.oscillates:
            yield AROUND, Prescribed(right, base_flow.entering)
            return
        # A flow that reverses enters through this end, and without its momentum energy comes from nowhere.
        yield FREE, Open(right, base_flow.velocity if base_flow.flow.changes else None)
    else:
        yield from ((WALL, no_slip(name)) for name in (left, right))


def _below(setup: Setup, velocity: Velocity, of_surface: OfSurface) -> Ranked:
    bottom, scene = setup.sides.bottom, setup.scene
    wall = scene.domain.kind == "box" or scene.top in ("wall", "free-surface")
    wall = wall or scene.flow.wall_below or scene.bed_shape is not None
    if "below" in of_surface:
        yield from ((FREE, one) for one in of_surface["below"])
    elif wall:
        yield WALL, no_slip(bottom)
    else:
        yield AROUND, Prescribed(bottom, velocity)


def _above(setup: Setup, velocity: Velocity, of_surface: OfSurface) -> Ranked:
    top, scene = setup.sides.top, setup.scene
    if "above" in of_surface:
        yield from ((FREE, one) for one in of_surface["above"])
    elif scene.top in ("slip", "free-surface"):
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
        from ..setup.body import velocity_at_first

        assert body is not None and scene.placement is not None
        yield (
            FREE,
            Prescribed("body", velocity_at_first(body, scene.placement, setup.symmetric)),
        )
    elif scene.moves:
        yield FREE, Carried("body")
    elif scene.grain is not None:
        yield WALL, no_slip("body")
