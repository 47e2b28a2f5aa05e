"""The boundary conditions of a flow that sticks to its walls, by which the base flow enters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from ..fluid.conditions import Carried, Condition, Open, Prescribed, Slip, no_slip
from ..meshes import SYMMETRY
from .base_flow import BaseFlow, Velocity
from .flow_setup import Setup

# In which conditions override each other: walls last, so corners are watertight. Base flow is prescribed on sides,
# then above, then at the ends and below.
FREE, SIDES, ABOVE, AROUND, WALL = range(5)
Ranked = Iterator[tuple[int, Condition]]
OfSurface = Mapping[str, list[Condition]]  # conditions that a free surface decides, by place


def conditions(setup: Setup, held: bool, lid: bool, speed: float) -> list[Condition]:
    """The conditions in the order in which they override each other. Arguments: see `conditions.conditions`."""
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
    return [one for _, one in sorted(ranked, key=lambda pair: pair[0])]


def _at_ends(setup: Setup, base_flow: BaseFlow, of_surface: OfSurface) -> Ranked:
    """Conditions upstream and downstream."""
    left, right = setup.sides.left, setup.sides.right
    if "ends" in of_surface:
        yield from ((FREE, one) for one in of_surface["ends"])
    elif setup.scene.domain.kind == "channel":
        yield AROUND, Prescribed(left, base_flow.entering)
        # A flow that reverses enters through this end, and without its momentum energy comes from nowhere.
        yield FREE, Open(right, base_flow.velocity if base_flow.changes else None)
    else:
        yield from ((WALL, no_slip(name)) for name in (left, right))


def _below(setup: Setup, velocity: Velocity, of_surface: OfSurface) -> Ranked:
    bottom = setup.sides.bottom
    if "below" in of_surface:
        yield from ((FREE, one) for one in of_surface["below"])
    elif _is_wall(setup):
        yield WALL, no_slip(bottom)
    else:
        yield AROUND, Prescribed(bottom, velocity)


def _above(setup: Setup, velocity: Velocity, of_surface: OfSurface) -> Ranked:
    """The condition on top: of a free surface, a lid, a wall, or the base flow."""
    top, geometry = setup.sides.top, setup.geometry
    if "above" in of_surface:
        yield from ((FREE, one) for one in of_surface["above"])
    elif geometry.top in ("slip", "free-surface"):
        yield FREE, Slip(top, axis=geometry.up)
    elif geometry.top == "wall" and setup.scene.flow.kind != "lid":
        yield WALL, no_slip(top)
    else:
        yield ABOVE, Prescribed(top, velocity)


def _across(setup: Setup, velocity: Velocity) -> Ranked:
    """Conditions on the sides, in 3-D."""
    for name in setup.sides.across:
        if setup.geometry.sides == "slip":
            yield FREE, Slip(name, axis=1)
        elif setup.geometry.sides == "wall":
            yield WALL, no_slip(name)
        else:
            yield SIDES, Prescribed(name, velocity)
    if setup.geometry.symmetric:
        yield FREE, Slip(SYMMETRY, axis=1)


def _on_grain(setup: Setup, held: bool) -> Ranked:
    geometry, body = setup.geometry, setup.scene.body
    if geometry.moves and held:
        from .body import velocity_at_first

        assert body is not None and geometry.placement is not None
        yield (
            FREE,
            Prescribed("body", velocity_at_first(body, geometry.placement, geometry.symmetric)),
        )
    elif geometry.moves:
        yield FREE, Carried("body")
    elif geometry.grain is not None:
        yield WALL, no_slip("body")


def _is_wall(setup: Setup) -> bool:
    """Whether the bottom is a wall at rest rather than part of the base flow."""
    geometry = setup.geometry
    bounded = geometry.domain.kind == "box" or geometry.top in ("wall", "free-surface")
    bounded = bounded or setup.base_flow.flow.kind in ("open-channel", "log-law")
    return bounded or geometry.bed is not None
