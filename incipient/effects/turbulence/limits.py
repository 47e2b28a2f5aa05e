"""Where the law of the wall does not hold in a scene, or the k-epsilon model is known to err, in words."""

from __future__ import annotations

import math
from collections.abc import Iterator

from ...planning.clearance import Surroundings
from ...planning.flow_setup import Setup
from ...planning.wall_cells import WALL_CELL, coarsening
from ...planning.wall_law import LARGEST_SHARE, LEAST

FORMS = ("sinusoidal", "half-discs", "ridges", "spheres")  # beds made of forms of one size
FINEST_FORM = 0.5  # of the law's distance: half a form at the least
SMALLEST_GRAIN = 300.0  # u* d/nu of grains below which the law of the wall is not for them
THICK = 0.05  # of a grain, from which on the layer of the law is reported: 50 nu/u* of one of u* d/nu = 1000
THICKEST = 0.5  # of a grain: a layer on both its sides as thick as itself
FEWEST_ACROSS = 6.0  # cells, of a 3-D grain, below which its loads are reported uncertain
BISECTIONS = 40
SMALLER = 'use turbulence.model = "k-omega-sst", or flow.kind = "log-law" without turbulence'


def refusals(setup: Setup) -> Iterator[str]:
    """What in a scene the law of the wall is not for, with its key. Not collective."""
    walls, bed = setup.walls, setup.scene.bed
    if why := setup.turbulence.rows_beyond(walls.number, walls.depth):
        yield why
    if (
        float(walls.law.velocity(walls.shear_velocity, setup.base_flow.viscosity, walls.distance))
        <= LEAST
    ):
        yield (
            f"turbulence.roughness: is {walls.law.roughness:g}, and the law of the wall begins within the "
            f"roughness, {walls.distance:.3g} from the wall; set wall_distance to the roughness or more, or use a "
            "smaller roughness"
        )
    if (
        bed is not None
        and bed.kind in FORMS
        and setup.geometry.bed.feature < FINEST_FORM * walls.distance
    ):
        yield (
            f"bed: has forms as fine as {2.0 * setup.geometry.bed.feature:.3g}, the law of the wall begins "
            f"{walls.distance:.3g} from them, farther than their size; use a larger fluid.reynolds, "
            'or a flat bed and turbulence.wall = "rough" with their height as roughness'
        )
    yield from (f"turbulence: {why}" for why in (too_small(setup), too_near(setup)) if why)
    yield from _through_the_top(setup)


def too_near(setup: Setup) -> str:
    """Why the law of the wall is not for a scene, or an empty string. Not collective."""
    walls = setup.walls
    share = walls.distance / walls.depth
    if share <= LARGEST_SHARE:
        return ""
    remedy = "use a larger fluid.reynolds, a smaller wall_distance or no turbulence"
    if walls.distance == walls.law.roughness:
        remedy = (
            "use a smaller roughness, from which the law begins at rough walls, or no turbulence"
        )
    return (
        f"the law of the wall would have to reach {percent(share)} of the depth, at most {percent(LARGEST_SHARE)}; "
        f"{remedy}"
    )


def too_small(setup: Setup) -> str:
    """Error message if the grain is too small for wall functions, else an empty string. Not collective."""
    if setup.scene.body is None:
        return ""
    share, number = setup.walls.distance / setup.geometry.grain.size, grain_number(setup)
    if share > THICKEST:
        return (
            f"the layer that the law of the wall covers is {percent(share)} of the grain, at most "
            f"{percent(THICKEST)}; use a smaller roughness or wall_distance, or a larger fluid.reynolds"
        )
    least = f"for the law of the wall it must be {SMALLEST_GRAIN:g} at least"
    return (
        ""
        if number >= SMALLEST_GRAIN
        else f"the grain has u* d/nu = {number:.3g}, {least}; {SMALLER}"
    )


def grain_number(setup: Setup) -> float:
    """u* d/nu of the scene's grain, d its largest diameter and u* estimated. Not collective."""
    return float(setup.geometry.grain.size * setup.walls.shear_velocity / setup.base_flow.viscosity)


def _through_the_top(setup: Setup) -> Iterator[str]:
    """Refuse a grain that reaches the layer below a wall on top that the mesh leaves out."""
    body, placement = setup.scene.body, setup.geometry.placement
    if body is None or placement is None:
        return
    grain, sides = setup.surroundings.grain, setup.surroundings.sides
    top = next(side for side in sides if side.axis == setup.geometry.up and side.inwards < 0)
    found = Surroundings(grain, (top,)).clearance(placement)
    if found.distance <= 0.0:
        key = "centre" if body.centre is not None else "x"
        yield (
            f"body.{key}: the grain reaches {top.place - found.distance:.6g}, the mesh ends at {top.place:.6g}, the "
            "distance of the law of the wall below the wall on top; move the grain, make it smaller or raise "
            "domain.height"
        )


def doubts(setup: Setup) -> Iterator[str]:
    """What is to be known of the model and of the law of the wall in a scene. Not collective."""
    grain = setup.geometry.grain if setup.scene.body is not None else None
    if grain is not None and (share := setup.walls.distance / grain.size) > THICK:
        yield (
            f"the grain has u* d/nu = {grain_number(setup):.3g}: the layer that the law of the wall stands for is "
            f"{percent(share)} of it; it is thin up to {percent(THICK)}"
        )
    yield from _narrow_gap(setup)
    if grain is None:
        return
    if setup.geometry.gdim == 3:
        yield from _coarse(setup)
    yield (
        "the k-epsilon model is far from measured loads on smooth round bodies, by more than error bars tell: drag on "
        "a sphere on a bed a third too small, on a hump a quarter to two fifths of it, lift there a quarter to a third "
        "too large; another program with this model has 1.1 to 1.6 times the drag and 0.5 to 0.9 of the lift"
    )


def _coarse(setup: Setup) -> Iterator[str]:
    """How few cells a 3-D grain has."""
    asked = setup.scene.numerics.mesh_size
    size = WALL_CELL * coarsening(setup.order.number) * setup.walls.distance * asked
    if (across := setup.geometry.grain.size / size) < FEWEST_ACROSS:
        yield (
            f"the grain is {across:.2g} cells across: with 3 of them drag was a fifth too large and a safety factor a "
            f"quarter off; use numerics.mesh_size = {asked * across / FEWEST_ACROSS:.2g} or less"
        )


def _narrow_gap(setup: Setup) -> Iterator[str]:
    """Warn of narrow gaps: the law of each wall ignores the other, and friction in the gap is too small."""
    body, placement = setup.scene.body, setup.geometry.placement
    if body is None or body.centre is None or body.moves or placement is None:
        return
    nearest, least = setup.surroundings.clearance(placement), 2.0 * setup.walls.distance
    lid = setup.sides.top if setup.base_flow.flow.kind == "open-channel" else ""
    open_sides = (setup.sides.right, setup.sides.left, lid, *setup.sides.across)
    if nearest.other in open_sides or nearest.distance >= least:
        return
    yield (
        f"the grain is held {nearest.distance:.3g} from the {nearest.other}, twice the distance of the law of the wall "
        f"is {least:.3g}: flow in the gap is not resolved; hold it farther away, or let it touch by body.x"
    )


def slowest(setup: Setup) -> float:
    """The factor of the slowest flow in which the law of the wall is for grain and depth. Not collective."""
    low, high = 1e-6, 1.0
    for _ in range(BISECTIONS):
        middle = math.sqrt(low * high)
        trial = setup.faster(middle)
        low, high = (low, middle) if not (too_near(trial) or too_small(trial)) else (middle, high)
    return high


def percent(share: float) -> str:
    """0.25 as 25%."""
    return f"{100 * share:.0f}%"
