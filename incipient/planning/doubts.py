"""The warnings of a plan."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from ..scene.sections import WIDE_GAP
from ..setup.setup import Setup
from .discretisation import velocity_order
from .sizes import WALL_CELL, coarsening, meshed_bed

NEAR_CRITICAL = 0.95, 1.3  # Froude numbers of channels with a free surface of which a plan warns
FREE_OF_INFLOW = 1.0  # grain sizes before a grain, below which a plan warns
# Over a grain, from which on the distance of the walls from the mesh is reported: 50 nu/u* of one of u* d/nu = 1000.
THICK = 0.05
FEWEST_ACROSS = 6.0  # cells, of a 3-D grain, below which its loads are reported uncertain
SMALL = (
    0.2  # roughness over the smallest length of bedforms up to which it is small compared with them
)


def _gap(setup: Setup) -> Iterator[str]:
    scene, body = setup.scene, setup.scene.body
    if body is None:
        return
    gap = scene.contact.gap if scene.contact is not None and not scene.closes_contacts else 0.0
    if gap > WIDE_GAP and (scene.rests or body.moves):
        yield (
            f"contact.gap = {gap:g} is wide: loads are computed for a grain {gap:g} of its size above the bed; "
            f"give {WIDE_GAP:g} or less"
        )
    if body.motion != "released":
        return
    begins, kept = setup.geometry.stance.gap, gap * setup.scene.grain.size
    if begins < 0.95 * kept:
        yield (
            f"the grain starts {begins:.3g} from its bed, closer than its gap of {kept:.3g}, because it touches on one "
            "side only; the first step corrects this: set body.settle = true"
        )


def _near_inflow(setup: Setup) -> Iterator[str]:
    placement, domain = setup.scene.placement, setup.scene.domain
    if placement is None or domain.kind == "box" or setup.scene.flow.at_rest:
        return
    away = (placement.centre[0] - domain.left) / setup.scene.grain.size - 0.5
    if away < FREE_OF_INFLOW:
        yield (
            f"the grain is {max(away, 0.0):.2g} of its size from the inflow, where the velocity is prescribed: that "
            f"changes its load; leave {FREE_OF_INFLOW:g} of its size at the least, by body.x or domain.origin"
        )


def _near_critical(setup: Setup) -> Iterator[str]:
    low, high = NEAR_CRITICAL
    if not setup.scene.has_surface or setup.scene.domain.kind != "channel":
        return
    if low <= (number := setup.numbers.froude or 0.0) <= high:
        yield (
            f"the Froude number, {number:.3g}, is between {low:g} and {high:g}: long waves hardly leave near-critical "
            "flow, so that its level depends on the ends and on the length of the run; compare with a larger "
            "domain.length and time.end, or choose another gravity.acceleration or flow.velocity"
        )


def _turbulence(setup: Setup) -> Iterator[str]:
    if not setup.is_averaged:
        return
    from ..turbulence.wall_law import SMOOTH_TO

    walls, scene, size, gap, feature = setup.walls, setup.scene, math.inf, math.inf, math.inf
    if scene.grain is not None:
        size, gap = scene.grain.size, setup.geometry.stance.gap
    if scene.bed_shape is not None:
        feature = scene.bed_shape.feature
    rough, within = walls.roughness, walls.distance("body") / size
    doubts = (
        (
            not walls.is_resolved and within > THICK,
            f"the grain has u* d/nu = {size / walls.unit:.3g}: the layer that the law of the wall stands for is "
            f"{100 * within:.0f}% of it; it is thin up to {100 * THICK:.0f}%",
        ),
        (
            setup.turbulence.model == "k-epsilon" and scene.grain is not None,
            "the k-epsilon model is far from measured loads on smooth round bodies, by more than error bars tell: drag "
            "on a sphere on a bed a third too small, on a hump a quarter to two fifths of it, lift there a quarter to "
            "a third too large; another program with this model has 1.1 to 1.6 times the drag, 0.5 to 0.9 of the lift",
        ),
        (
            0.0 < rough < SMOOTH_TO * walls.unit,
            f"the walls are hydraulically smooth, u* k_s/nu about {rough / walls.unit:.2g}: their roughness changes "
            "nothing",
        ),
        (
            rough > SMALL * feature,
            f"the roughness of the bed, {rough:.3g}, is {100 * rough / feature:.0f}% of the smallest length of its "
            f"forms, {feature:.3g}: the model assumes that it is small compared with them, as it is up to "
            f"{100 * SMALL:.0f}%",
        ),
        (
            rough > gap,
            f"the roughness of the bed, {rough:.3g}, is higher than the gap below the grain, {gap:.3g}: flow in the "
            "gap is not resolved, since the model assumes a roughness smaller than all meshed lengths",
        ),
        (
            walls.is_resolved and _cut_at_inflow(setup),
            "the inflow cuts bedforms, next to which k may diverge, since the inflow profile has developed over "
            "a planar bed: put the grain farther downstream of the inflow",
        ),
        (
            walls.is_laminar,
            f"the inflow is laminar by the k-omega model, u* h/nu = {walls.depth / walls.unit:.3g}: k decays to "
            "nothing there, and loads are those of laminar flow",
        ),
    )
    yield from (text for holds, text in doubts if holds)
    if scene.body is None or scene.placement is None or walls.is_resolved:
        return
    if scene.gdim == 3:
        yield from _coarse(setup)
    # The law of each wall ignores the other: friction in a gap is too small.
    least = 2.0 * walls.distance("body")
    near = setup.clearance(scene.placement)
    held = scene.body.centre is not None and not scene.body.moves
    if held and near.other in walls.names and near.distance < least:
        yield (
            f"the grain is held {near.distance:.3g} from the {near.other}, twice the distance of the law of the wall "
            f"is {least:.3g}: flow in the gap is not resolved; hold it farther away, or let it touch by body.x"
        )


def _cut_at_inflow(setup: Setup) -> bool:
    """Whether the inflow cuts bedforms, which are meshed there."""
    scene, bed, placement = setup.scene, setup.scene.bed_shape, setup.scene.placement
    if scene.gdim == 2 or bed is None or placement is None or math.isinf(bed.feature):
        return False
    meshed = meshed_bed(setup, placement)
    nearest = np.array([[scene.domain.left, placement.centre[1]]])
    return meshed is None or bool(meshed.share(nearest)[0] < 1.0)


def _coarse(setup: Setup) -> Iterator[str]:
    asked, walls = setup.scene.numerics.mesh_size, setup.walls
    size = WALL_CELL * coarsening(walls, velocity_order(setup)[0]) * walls.nearest * asked
    across = setup.scene.grain.size / size
    if across < FEWEST_ACROSS:
        yield (
            f"the grain is {across:.2g} cells across: with 3 of them drag was a fifth too large and a safety factor a "
            f"quarter off; use numerics.mesh_size = {asked * across / FEWEST_ACROSS:.2g} or less"
        )


# Each gives warnings in words; it raises SceneError where an effect that is present cannot be simulated in the scene.
DOUBTS: tuple[Callable[[Setup], Iterator[str]], ...] = (
    _gap,
    _near_inflow,
    _near_critical,
    _turbulence,
)
