"""Errors of waves from runs in longer steps, which the order of the steps alone underestimates (docs/surface.md)."""

from __future__ import annotations

import math
from dataclasses import replace

from ..planning.flow_setup import Setup, order_of
from ..planning.open_channel import LEVEL
from ..results.errorbars import Loads, Term
from ..scene import Scene

LONGER_STEP = 2.0  # at least so much longer are the steps that a run is compared with
# Error of elevations over what the order of the steps makes of a change in longer ones, the largest that was measured:
# with a few dozen steps a period the error does not yet go as their square.
OF_FEW_STEPS = 1.6
# Error of a stream's level over what elements of one order more change on the default mesh for them, likewise measured
# (docs/channels.md).
OF_STREAM = 1.6
# By how much estimated errors of `LARGE` and more of the largest elevation are too small, the most that was measured,
# less below (docs/surface.md, tests/convergence/test_errors_of_waves.py).
UNSEEN_OF_LARGE, LARGE = 0.35, 0.06
OUT_OF_PHASE = 0.7  # of the largest elevation
# Second differences of an elevation in longer steps, over its largest value: one where a period has six of them.
COARSE, COARSEST = 1.0, 4.0


def least_share(computed: Loads, in_longer: Loads, order: int) -> float:
    """How much of what longer steps change counts at the least: nothing where they resolve the waves. Not collective.

    Waves that are out of phase come no farther apart, and those in very long steps are damped, so that the order says
    nothing. Then it is as if the steps were only `LONGER_STEP` times as long; in still longer ones all counts.
    """
    one, other = computed.elevations, in_longer.elevations
    if one is None or other is None:
        return 0.0
    # Longer steps damp what they do not resolve: their second differences are better seen in those of the run.
    ratio = other.step / one.step if one.step > 0.0 else 1.0
    sharpness = max(other.sharpness, ratio**2 * one.sharpness)
    if sharpness > COARSEST:
        return 1.0
    apart = float(one.apart(other).max(initial=0.0))
    resolved = sharpness <= COARSE and apart <= OUT_OF_PHASE * one.largest
    return 0.0 if resolved else 1.0 / (LONGER_STEP**order - 1.0)


def of_large_errors(term: Term, computed: Loads) -> float:
    """The factor by which estimated errors of elevations are too small where they are large. Not collective.

    What extrapolation leaves out is in proportion to the errors themselves.
    """
    if term.elevation is None or computed.elevations is None or computed.elevations.largest == 0.0:
        return 1.0
    relative = float(term.elevation.max(initial=0.0)) / computed.elevations.largest
    return 1.0 + UNSEEN_OF_LARGE * min(relative / LARGE, 1.0)


def is_stream(scene: Scene) -> bool:
    """Whether a flow enters below a free surface. Not collective."""
    return scene.has_surface and scene.domain.kind == "channel" and scene.flow.kind != "still"


def doubt_of_stream(scene: Scene) -> str:
    """Why the estimated errors of a channel's level may be too small, or an empty string. Not collective.

    The zone at the inflow is a cell long at the least, which no comparison of meshes shows.
    """
    if not is_stream(scene):
        return ""
    order = order_of(scene).number
    cells = Setup(scene).far_cells
    largest = cells.largest if scene.gdim == 2 else cells.largest_in_space(order)
    most = LEVEL * scene.domain.height / largest
    if scene.numerics.mesh_size <= most:
        return ""
    return (
        "the zone at the inflow that levels the surface is one cell long where cells are larger than "
        f"{LEVEL:g} of the depth; use numerics.mesh_size = {math.floor(100.0 * most) / 100.0:g} or less"
    )


def enlarged(term: Term, factor: float) -> Term:
    """The term with larger errors of elevations, the same where there are none. Not collective."""
    if term.elevation is None or term.level is None:
        return term
    return replace(term, elevation=factor * term.elevation, level=factor * term.level)


def error_over_change(scene: Scene) -> float:
    """Error of elevations over what elements of one order more change. Not collective."""
    return OF_STREAM if is_stream(scene) and order_of(scene).number == 2 else 1.0
