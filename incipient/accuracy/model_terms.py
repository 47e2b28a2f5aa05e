"""Errors of what stands for the true geometry and flow, as terms of error bars: gap, sides, datum, level ground."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np

from ..arrays import Floats
from ..errors import ConvergenceError, IncipientError
from ..planning.flow_setup import Setup
from ..planning.meshed_bed import resolved_bed
from ..results.errorbars import Loads, Term
from ..scene import Contact, Scene
from ..scene.model import WIDEST_GAP
from .coarse_runs import FARTHER, changed, coarse, farther
from .kept_runs import Solve

DECAY = 2.0  # the influence of sides is taken to fall off like their distance to this power
DECAY_OVER_FORMS = (
    1.5  # there, with a base flow that suits them: 1.6 to 1.8 were measured (docs/accuracy.md)
)
SLOWEST_DECAY = (
    0.75  # part of it that is believed where loads fall off more slowly (make calibration)
)
# The slowest decay that the three distances are taken to tell; a still slower one is that of their meshes.
SLOWEST_SEEN = 1.0 / 3.0
NO_LIMIT = (
    "the sides 1.5 times as far change the force by {:.2g}, 2.25 times as far by {:.2g} more: it has no limit; use a "
    "larger domain, or a flow that does not depend on its size"
)
# How much larger the bed's part meshed as it is becomes, and the decay of what the rest changes (docs/space.md).
WIDER, DECAY_OF_GROUND = 1.5, 1.0
LARGER, SMALLER = (1.0, 2.0, 4.0), (0.25, 0.5, 1.0)  # gaps of three runs, relative to the scene's
CLOSED_WIDER = 4.0  # how much wider the space next to contacts is that is closed in a coarse run
# Weights of the values with one, two and four times a gap in that of a parabola through them without one.
PARABOLA = (8 / 3, -2.0, 1 / 3)
ORDERS = (0.3, 2.0)  # between which the order in the gap is believed
TOO_LITTLE = 1e-6  # of the largest of three loads: changes that tell no order
SAME_DATUM = 1e-6  # of the height of the forms
GROUND, MODEL = "level ground", "turbulence model"
NO_MORE_BED = "not estimated with numerics.accuracy, but without it; a larger numerics.meshed_bed has less of it"
NO_CONTACT = "does not apply: no grain rests on a bed"
MOVES = "does not apply: the grain moves, and contact.gap says where it stops"


def of_gap(scene: Scene, solve: Solve, computed: Loads | None = None) -> Term:
    """What closing the gap between grain and bed would change, from coarse runs with larger gaps.

    If the gap is already wide, the runs have smaller gaps, because larger ones are not allowed. Force and couple are
    corrected by the change that a parabola through the three gives; a power of the gap is the other way to estimate it.
    """
    contact = scene.contact or Contact(friction=0.0)  # friction plays no part in the flow
    if scene.closes_contacts:
        return _of_closing(scene, contact, solve)
    wide = 4.0 * contact.gap > WIDEST_GAP
    sections = [
        {**contact.model_dump(), "gap": k * contact.gap} for k in (SMALLER if wide else LARGER)
    ]
    loads = [solve(coarse(scene, contact=section)) for section in sections]
    values = [np.concatenate([one.force, one.couple]) for one in loads]
    # With smaller gaps, found is the change from the smallest one: the way there from the scene's is added.
    here, way = (2, values[0] - values[2]) if wide else (0, np.zeros(6))
    by_power = np.array([_to_zero(*three) for three in zip(*values, strict=True)])
    told = "1/4, 1/2 and 1" if wide else "1, 2 and 4"
    how = f"coarse runs with {told} times the gap, extrapolated to none"
    near, far = (float(np.linalg.norm(loads[i + 1].force - loads[i].force)) for i in (0, 1))
    errors, order = np.abs(by_power) + np.abs(way), _order_in_gap(near, far)
    # What the runs themselves still change by is extrapolated with them.
    errors += (loads[0].unsteady + loads[1].unsteady) / (2.0**order - 1.0)
    errors += (loads[0].unsteady + loads[2].unsteady) * wide
    term = Term("gap", errors[:3], errors[3:], how, power=order)
    if not is_corrected(scene):
        return term
    by_parabola = np.asarray(PARABOLA) @ values - values[0]
    left = np.abs(by_parabola - by_power) + _noise(loads[here], computed)
    return term.corrected(by_parabola + way, left)


def _noise(coarse: Loads, computed: Loads | None) -> Floats:
    """(6,) what coarse runs on meshes of their own differ by for that alone: at least one of them is off so far.

    On one mesh, moved, all have its errors alike.
    """
    if coarse.moved or computed is None:
        return np.zeros(6)
    return np.abs(np.concatenate([coarse.force - computed.force, coarse.couple - computed.couple]))


def _of_closing(scene: Scene, contact: Contact, solve: Solve) -> Term:
    """What closing less of the space next to contacts would change, from a coarse run in which more of it is closed.

    The fluid in a wedge hardly moves, and its pressure is that of the wedge's mouth: what closing a space of some width
    changes falls faster than the width, and less of it cannot change as much.
    """
    wide = CLOSED_WIDER * contact.gap > WIDEST_GAP
    factor = 1.0 / CLOSED_WIDER if wide else CLOSED_WIDER
    other = {**contact.model_dump(), "gap": factor * contact.gap}
    how = f"a coarse run with the contacts closed {'1/' if wide else ''}{CLOSED_WIDER:g} times as widely"
    at = [solve(coarse(scene, contact=section)) for section in (contact.model_dump(), other)]
    return Term.of_difference("gap", at[0], at[1], 1.0, how)


def _to_zero(at_one: float, at_two: float, at_four: float) -> float:
    """Value without gap - value at the gap, for a value that goes as a power of the gap."""
    near, far = at_two - at_one, at_four - at_two
    if abs(near) <= TOO_LITTLE * max(abs(at_one), abs(at_two), abs(at_four)):
        return -near
    return -near / (2.0 ** _order_in_gap(near, far) - 1.0)


def _order_in_gap(near: float, far: float) -> float:
    """The power of the gap from what two doublings of it change."""
    return float(np.clip(np.log2(max(far / near, 1e-3)), *ORDERS)) if near else ORDERS[0]


def no_gap(scene: Scene) -> str:
    """Why there is no term of the gap, or nothing."""
    if scene.body is not None and scene.body.moves:
        return MOVES
    return "" if scene.rests else NO_CONTACT


def has_no_far_sides(scene: Scene) -> str:
    """Why there is no term of the domain, or nothing."""
    if (scene.is_averaged and scene.body is None) or scene.has_separation:
        return "does not apply: how long the channel is, and what enters, belong to the scene"
    if scene.domain.kind == "box":
        return "does not apply: the domain is closed by walls"
    if scene.bed is not None and scene.bed.kind in ("polyline", "height-map", "mesh"):
        return "not estimated: the bed is known only as far as its points reach"
    if scene.has_surface and scene.surface is not None and scene.surface.outflow == "wall":
        return "does not apply: the channel is closed by a wall"
    return ""


def of_domain(
    scene: Scene, solve: Solve, decay: float | None = None, computed: Loads | None = None
) -> Term:
    """What sides that stand for an endless flow change, from a coarse run with all of them farther away.

    Their influence falls off like their distance to the power `decay`; None: 2, over a bed with forms 1.5. Force and
    couple of a grain that is held are corrected, with sides farther away still: these are the other way to estimate it.
    """
    decay = (
        (DECAY_OVER_FORMS if Setup(scene).base_flow.over_forms else DECAY)
        if decay is None
        else decay
    )
    how = f"a coarse run with sides {FARTHER:g} times as far, decay with distance to the power {decay:.2g}"
    share = 1.0 / (1.0 - FARTHER**-decay)
    here, far = solve(coarse(scene)), solve(coarse(farther(scene)))
    term = Term.of_difference("domain", far, here, share, how)
    if not (is_corrected(scene) and len(here.force)):
        return term
    try:
        farthest = solve(coarse(farther(scene, FARTHER**2)))
    except IncipientError as error:
        return replace(
            term, how=f"{how}; not corrected, sides {FARTHER**2:.3g} times as far: {error}"
        )
    values = [np.concatenate([one.force, one.couple]) for one in (here, far, farthest)]
    noise = _noise(here, computed)
    change, left = _to_endless(values, decay, float(np.linalg.norm(noise[:3])))
    times = f"{FARTHER:g} and {FARTHER**2:.3g} times as far"
    how = f"coarse runs with sides {times}, decay with distance to the power {decay:.2g} or slower"
    return replace(term, how=how).corrected(change, left + noise)


def _to_endless(values: list[Floats], decay: float, noise: float) -> tuple[Floats, Floats]:
    """The change of loads (6,) to endless sides, from those with three distances, and how far that may be off.

    The power of the decay is that seen in the forces, between a part of the expected one and that. Doubt is what the
    expected power would give, what the two nearer distances give, what a slower decay that is seen would give, and what
    sides change in their own influence: as much as in the load.

    Raises:
        ConvergenceError: the second enlargement changes the force by more than the first one, and by more than `noise`.
    """
    near, far = (float(np.linalg.norm((two - one)[:3])) for one, two in pairwise(values))
    if far > max(near, noise):
        raise ConvergenceError(NO_LIMIT.format(near, far))
    seen = math.log(near / far) / math.log(FARTHER) if near and far else decay
    powers = (
        min(max(seen, SLOWEST_DECAY * decay), decay),
        decay,
        min(max(seen, SLOWEST_SEEN), decay),
    )
    by_seen, by_decay, by_slower = (1.0 / (1.0 - FARTHER**-power) for power in powers)
    change = values[1] + by_seen * (values[2] - values[1]) - values[0]
    others = (
        values[1] + by_decay * (values[2] - values[1]) - values[0],
        by_seen * (values[1] - values[0]),
        values[1] + by_slower * (values[2] - values[1]) - values[0],
    )
    share = np.linalg.norm(change[:3]) / max(float(np.linalg.norm(values[0][:3])), 1e-300)
    return change, np.max([np.abs(one - change) for one in others], axis=0) + share * np.abs(change)


def is_corrected(scene: Scene) -> bool:
    """Whether loads are corrected by what is known of their errors: of a grain that is held. Not collective.

    In turbulent flow, and below a free surface, estimates have not shown what they are worth.
    """
    held = scene.body is not None and not scene.body.moves
    return scene.numerics.correction and held and not (scene.is_averaged or scene.has_surface)


def of_datum(scene: Scene, other: Scene, solve: Solve) -> Term:
    """The error of the datum, from a coarse run of a scene whose base flow starts at another height."""
    height = Setup(other).base_flow.datum - other.domain.bottom
    how = f"a coarse run with flow.datum = {height:.4g}, which may suit the bed as well"
    return Term.of_difference("datum", solve(coarse(other)), solve(coarse(scene)), 1.0, how)


def with_other_datum(scene: Scene, speed: float = 1.0) -> Scene | None:
    """The scene with a datum as far beyond the bed's effective height as that may be off, seen from its own datum.

    None where there is no such height, or the scene's is that for certain, or the stream with its turbulence enters at
    the bed's own height. At `speed` the flow is faster by a factor.
    """
    base_flow = Setup(scene).base_flow_at(speed)
    if scene.is_averaged or has_no_far_sides(scene) or not base_flow.over_forms:
        return None
    found, datum = base_flow.effective_height, base_flow.datum
    bottom, crest = scene.domain.bottom, scene.bed_shape.crest
    off = bottom + found.height - datum
    other = min(datum + off + math.copysign(found.uncertainty, off), crest)
    if abs(other - datum) < SAME_DATUM * (crest - bottom):
        return None
    return changed(scene, flow={"datum": other - bottom})


def of_level_ground(wider: Scene, computed: Loads, solve: Solve) -> Term:
    """What a bed that is meshed as it is everywhere would change, from a run with more of it, or all, meshed so."""
    how = f"a run with the bed meshed {WIDER:g} times as far, decay with distance to the power {DECAY_OF_GROUND:g}"
    share = 1.0 / (1.0 - WIDER**-DECAY_OF_GROUND)
    if not _has_level_ground(Setup(wider)):
        how, share = "a run with the bed meshed as it is everywhere", 1.0
    return Term.of_difference(GROUND, solve(wider), computed, share, how)


def on_more_bed(scene: Scene) -> Scene | None:
    """The scene with more of its bed meshed as it is; None where there is no more, or its influence is not asked for.

    A steady flow in space on a mesh of default sizes has such a bed: away from the grain it goes over to level ground.
    """
    if scene.numerics.accuracy is not None or not _has_level_ground(Setup(scene)):
        return None
    return changed(
        scene, numerics={"meshed_bed": WIDER * scene.numerics.meshed_bed, "error_bars": False}
    )


def _has_level_ground(setup: Setup) -> bool:
    """Whether the bed of a steady flow in space goes over to level ground away from the grain."""
    if setup.scene.gdim != 3 or setup.scene.time is not None:
        return False
    return resolved_bed(setup.geometry, setup.scene.placement, setup.base_flow.datum) is not None


def of_the_model(
    scene: Scene, speed: float = 1.0, computed: Loads | None = None
) -> dict[str, Callable[[Solve], Term]]:
    """How the terms of the model are estimated that a scene has, by name; its flow may be faster. Not collective.

    `computed` are the loads of the run itself, which tell how far coarse runs are off.
    """
    found: dict[str, Callable[[Solve], Term]] = {}
    other = with_other_datum(scene, speed)
    if not no_gap(scene):
        found["gap"] = partial(of_gap, scene, computed=computed)
    if not has_no_far_sides(scene):
        # Far sides otherwise tell of how slowly a stream adapts that does not suit its bed.
        suits = getattr(scene.flow, "datum", "auto") in ("auto", "effective")
        found["domain"] = partial(of_domain, scene if suits else other or scene, computed=computed)
    if other is not None:
        found["datum"] = partial(of_datum, scene, other)
    return found


def not_there(scene: Scene) -> dict[str, str]:
    """Why a scene has no term of gap, domain, level ground or model of turbulence, by name. Not collective."""
    reasons = {"gap": no_gap(scene), "domain": has_no_far_sides(scene)}
    if scene.is_averaged:
        seen = "vary constants and wall_distance of [turbulence] to see it"
        reasons[MODEL] = (
            f"not estimated: {'no other one reaches the walls' if scene.resolves_walls else seen}"
        )
    if scene.numerics.accuracy is not None and _has_level_ground(Setup(scene)):
        reasons[GROUND] = NO_MORE_BED
    return {name: reason for name, reason in reasons.items() if reason}
