"""Rules of a scene `s` between its sections."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Floats, spatial
from ..errors import SceneError
from ..geometry.placement import Placement
from .expression import Expression, expressions
from .flows import kinds
from .messages import either
from .section import Rule, when
from .sections import FREE, OF_GRAIN, OF_SURFACE, OF_WALLS
from .units import derived

if TYPE_CHECKING:
    from .model import Scene

FEWEST_STEPS = 2  # of time, in the duration of a gust
# u* k_s/nu up to which the mean profile follows the measured one (docs/contribute/defaults.md).
_ROUGHEST = 500.0
_NOT_MODELLED = "with turbulence is not simulated by this version"
# Distances in grain sizes: from the bed, where cells get as small as the gap; from a side, where they do not.
TOUCHING, NEARLY_TOUCHING = 1e-6, 1e-3
FARTHEST = 1e6  # extents of the domain, in sizes of grain or bedforms
_SAME = 1e-9  # of an extent of the domain
CELLS_OF_A_FORM = 20  # at the least
_SIDES = (
    ("left side", "right side"),
    ("side at least y", "side at largest y"),
    ("lower side", "top"),
)


# -- conditions of rules ---------------------------------------------------------------------------


def _unsteady(s: Scene) -> bool:
    return s.flow.by_formulas and s.flow.changes


def _leaves_upstream(s: Any) -> bool:
    """Whether a steady flow leaves a channel through its inflow, so that an unknown flow enters at the other end."""
    if not s.flow.by_formulas or s.flow.changes or s.domain.kind == "box":
        return False
    grid = s.domain.grid(1, *[201] * s.up)
    try:
        speeds = expressions(s.flow.components, "flow.components")[0](spatial(grid).T)
    except SceneError:  # infinite somewhere, which is refused if the run comes there
        return False
    return float(speeds.sum()) < -_SAME * float(np.abs(speeds).sum())


def _gust(s: Scene) -> Any:
    return getattr(s.flow, "gust", None)


def _datum(s: Scene) -> Any:
    return getattr(s.flow, "datum", "auto")


def _stream(s: Scene) -> bool:
    return s.has_surface and s.flow.below_surface and s.domain.kind == "channel"


def _touches(s: Scene) -> bool:
    return s.body is not None and s.body.touches


def _too_rough(s: Scene) -> float:
    without_scale = s.fluid.scale == "grain" and s.body is None
    if s.flow.kind != "log-law" or s.domain.kind == "box" or without_scale:
        return 0.0
    number = s.flow.shear_velocity * s.flow.roughness / s.viscosity
    return number if number > _ROUGHEST else 0.0


def _needs_verdict(s: Any) -> bool:
    return s.body is not None and None in (s.body.x, s.bed, s.contact, s.mass)


# -- conditions on sizes and positions -------------------------------------------------------------


def _coarse(s: Any, least: float) -> list[Any]:
    """Sides of the domain whose numbers do not resolve the tolerance of contact, or `least` if that is larger."""
    finest = max(least, s.contact.tolerance if s.grain and s.contact else 1e-6)
    size = s.grain.size if s.grain else math.inf
    sides = [
        (
            name if abs(start) <= extent else "origin",
            math.ulp(abs(start) + extent),
            finest * min(extent, size),
        )
        for (name, extent), start in zip(s.domain.sizes.items(), s.domain.origin, strict=True)
    ]
    return [side for side in sides if 4.0 * side[1] > side[2]]


def _vast(s: Any) -> list[Any]:
    sizes = [(min(s.domain.sizes.values()), "the smallest extent")]
    sizes += [(s.grain.size, "the grain")] if s.grain else []
    sizes += [(s.bed_shape.feature, "a bedform")] if s.gdim == 3 and s.bed else []
    size, what = min(sizes)
    sides = s.domain.sizes.items()
    return [(key, side, side / size, what) for key, side in sides if side > FARTHEST * size]


def _many_forms(s: Any) -> Any:
    """Number of bedforms to be meshed, in 3-D of those below the grain, if too many."""
    extent, where = math.prod(high - low for low, high in s.domain.spans), "in the domain"
    if s.gdim == 2 and not s.bed_shape.period:
        return False
    if s.gdim == 3 and s.grain and s.grain.size**2 < extent:
        extent, where = s.grain.size**2, "under the grain"
    forms = extent / (2.0 * s.bed_shape.feature) ** s.up
    return forms * CELLS_OF_A_FORM > s.numerics.max_cells and (forms, where)


def _short(s: Any) -> list[Any]:
    reaches: Any = s.bed_shape.extent if s.gdim == 3 else ()
    slack, remedy = _SAME, "enlarge its cell, change its offset or shrink the domain"
    if s.bed.kind == "polyline":
        reaches, slack = ((s.bed.points[0][0], s.bed.points[-1][0]),), 0.0
        remedy = "add points or shorten the domain"
    return [
        (axis, first, last, low, high, remedy)
        for axis, (first, last), (low, high) in zip("xy", reaches, s.domain.spans, strict=False)
        if low < first - slack * (high - low) or high > last + slack * (high - low)
    ]


def _steps_at_ends(s: Any) -> list[float]:
    (ends,) = s.domain.spans
    return [x for x in s.bed.steps if min(abs(x - end) for end in ends) <= _SAME * s.domain.length]


def _datum_off_bed(s: Any) -> Any:
    """Range of the bed's heights above its base, if it excludes the datum: a layer of fluid would be at rest."""
    lowest, highest = (height - s.domain.bottom for height in s.bed_heights)
    slack = _SAME * s.domain.height
    return not lowest - slack <= s.flow.datum <= highest + slack and (lowest, highest)


def _outside(s: Any) -> list[Any]:
    return [
        (number, axis, value, low, high)
        for number, place in enumerate(s.surface.places())
        for axis, value, (low, high) in zip("xy", place, s.domain.spans, strict=False)
        if not low <= value <= high
    ]


def _low_surface(s: Any) -> Any:
    across = s.domain.grid(*[201] * len(s.domain.spans))
    depths = s.domain.ceiling + s.surface.height(spatial(across).T) - s.bed_height(across)
    place = zip("xy", across[int(np.argmin(depths))], strict=False)
    return depths.min() <= 0.0 and ", ".join(f"{axis} = {value:g}" for axis, value in place)


def _key_along(axis: str, s: Any) -> str:
    """The key of the grain's position along an axis."""
    return "y" if s.body.x is not None and axis == "y" and s.gdim == 3 else s.body.place


def _away(s: Any) -> list[Any]:
    centre = (s.body.x, getattr(s.body, "y", None)) if s.body.centre is None else s.body.centre
    axes = zip("xy", centre, s.domain.spans, strict=False)
    return [
        (axis, value, low, high, _key_along(axis, s))
        for axis, value, (low, high) in axes
        if value is not None and not low < value < high
    ]


def distances_from_sides(
    s: Any, placement: Placement, ceiling: float
) -> dict[tuple[int, int], tuple[Floats, float]]:
    """By axis and end of it, -1 or 1: the point of the placed grain that is farthest there, and its distance."""
    box, distances = (*s.domain.spans, (s.domain.bottom, ceiling)), {}
    for (axis, ends), end in product(enumerate(box), (-1, 1)):
        towards = end * np.eye(s.gdim)[axis] @ placement.rotation
        point = placement.to_scene([s.grain.extreme(towards)])[0]
        distances[axis, end] = point, end * (ends[end > 0] - float(point[axis]))
    return distances


def _narrow(s: Any) -> list[Any]:
    """Extents of the domain, by key, that the grain exceeds or nearly fills, and its own."""
    near, extents = distances_from_sides(s, s.placement, s.domain.ceiling), s.domain.sizes.items()
    rooms = [near[axis, -1][1] + near[axis, 1][1] for axis in range(s.gdim)]
    return [
        (key, extent, extent - room)
        for (key, extent), room in zip(extents, rooms, strict=True)
        if room < 2.0 * NEARLY_TOUCHING * s.grain.size
        and not (s.body.shape == "cylinder" and key == "width")
    ]


def _sides(s: Any) -> list[Any]:
    """Axis, extreme coordinate of the grain, side, its place, the grain's key, and the distance between them."""
    across, names = s.body.shape == "cylinder", [*_SIDES[: s.up], _SIDES[2]]
    near = distances_from_sides(s, s.placement, s.domain.ceiling)
    return [
        (
            "xyz"[axis],
            point[axis],
            names[axis][end > 0],
            point[axis] + end * distance,
            _key_along("xyz"[axis], s),
            distance,
        )
        for (axis, end), (point, distance) in near.items()
        if not (s.bed and (axis, end) == (s.up, -1)) and not (across and axis == 1)
    ]


def _into_bed(s: Any) -> Any:
    """Why the grain and the bed overlap or touch, and the remedy."""
    depth, tolerance = -s.near_bed.clearance(s.placement)[0], s.contact_tolerance
    remedy = "raise the grain, or give x to let it rest on the bed"
    if s.body.x is not None:  # lowered onto a bed finer than the resolution of its support
        remedy = (
            "make the bedforms larger or flatter: next to the grain they are too steep to lower it"
        )
    if depth > tolerance:
        return f"the grain reaches {depth:.3g} into the bed", remedy
    if s.rests:
        return False
    if -depth <= max(tolerance, TOUCHING * s.grain.size):
        return "the grain touches the bed above which centre holds it", remedy
    # The first step would raise it at once.
    within = s.body.touches and -depth < s.contact_gap - tolerance
    return within and (f"the grain starts {-depth:.3g} from the bed, within contact.gap", remedy)


def _cut(s: Any) -> Any:
    """Whether the surface at time zero meets the grain or lies below its centre."""
    centre, half = np.array(s.placement.centre), 0.5 * s.grain.size
    axes = [
        np.linspace(max(place - half, low), min(place + half, high), 101)
        for place, (low, high) in zip(centre[: s.up], s.domain.spans, strict=True)
    ]
    across = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, s.up)
    across = np.vstack([centre[: s.up], across])
    heights = s.domain.ceiling + s.surface.height(spatial(across).T)
    inside = s.grain.level(s.placement.to_body(np.column_stack([across, heights]))) <= 0.0
    return heights[0] <= centre[s.up] or inside.any()


def _not_across(s: Any) -> Any:
    low, high = (s.body.centre[1] + end * s.body.length for end in (-0.5, 0.5))
    near, far = s.domain.across
    return max(abs(low - near), abs(high - far)) > _SAME * (far - near) and (low, high, near, far)


# -- the rules ------------------------------------------------------------------------------------


def _unread(
    key: str, is_read: Callable[[Any], Any], why: str, remedy: str = "leave it out"
) -> Rule:
    """The rule of a key of a section that only some scenes read."""
    section, name = key.split(".")

    def changed(s: Any) -> bool:
        part = getattr(s, section)
        return part is not None and part.changed(name) and not is_read(s)

    return Rule(key, changed, why, remedy)


def _of_dimension(gdim: int) -> Callable[[Any], Any]:
    """Grain and bed, their key and value, in a scene of this dimension that they are not for."""
    parts = (("body", "shape", "sphere"), ("bed", "kind", "spheres"))
    return lambda s: [
        (name, key, getattr(part, key), example)
        for name, key, example in parts
        if (part := getattr(s, name)) is not None
        and s.gdim == gdim
        and part.gdim not in (None, gdim)
    ]


_NEEDS = "needs a grain that rests on a bed, its density and friction"
_GIVE = "give body.x, body.density, [bed] and [contact], or a number for the accuracy of the force"
_STEADY = "but without [time] the flow is steady"

RULES: tuple[Rule, ...] = (
    Rule("body.density", lambda s: s.body is not None and s.body.is_free and s.mass is None,
         "a {s.body.motion} grain needs a mass and a moment of inertia, which may be zero",
         "give density, or mass and inertia"),
    Rule("body.inertia", lambda s: s.body is not None and s.body.inertia is not None and s.mass is None,
         "is given without a mass", "give density or mass as well, or leave it out"),
    # Dimension.
    Rule("{v[0]}.{v[1]}", _of_dimension(2),
         'domain.width is missing, which the three-dimensional "{v[2]}" needs',
         "add domain.width, or use a two-dimensional {v[0]}"),
    Rule("{v[0]}.{v[1]}", _of_dimension(3),
         '"{v[2]}" is two-dimensional, but domain.width makes the scene three-dimensional',
         'use a 3-D {v[0]} such as "{v[3]}", or leave width out'),
    *when(lambda s: s.flow.by_formulas and len(s.flow.components) != s.gdim,
        Rule("flow.components", lambda s: s.gdim == 2, "has 3 items", "give two, as in [x, y]"),
        Rule("flow.components", lambda s: s.gdim == 3, "has 2 items", "give three, as in [x, y, z]"),
    ),
    # Flow and domain.
    Rule("flow.kind", lambda s: s.flow.closed is True and s.domain.kind == "channel",
         '"{s.flow.kind}" needs a box but the domain is a channel', 'set domain.kind = "box"'),
    Rule("flow.kind", lambda s: s.flow.closed is False and s.domain.kind == "box",
         '"{s.flow.kind}" needs open ends but a box is closed',
         'set domain.kind = "channel", or use "lid" or "still"'),
    Rule("domain.top",
         lambda s: s.domain.kind == "box" and s.domain.top == "stream" and not s.flow.by_formulas,
         "no flow passes the top of a closed box", 'use "wall", "slip" or "auto"'),
    Rule("domain.top", lambda s: s.top not in s.flow.tops and either(("auto", *s.flow.tops)),
         '"{s.domain.top}" contradicts the flow "{s.flow.kind}"', "use {v}"),
    Rule("flow.roughness", _too_rough,
         f"is {{v:.3g}} times nu/u*; the mean profile is known up to {_ROUGHEST:g} times that",
         "reduce it, or fluid.reynolds"),
    Rule("fluid.scale", lambda s: s.fluid.scale == "grain" and s.body is None,
         '"grain" but there is no grain', 'add a section [body] or use "flow"'),
    # Bed, grain and contact.
    Rule("flow.datum", lambda s: s.bed is None and _datum(s) not in ("auto", "crest"),
         "is a height of the bed but there is none", "add a section [bed] or leave it out"),
    Rule("contact.friction", lambda s: s.bed is None and s.contact is not None and not s.moves,
         "friction needs a bed but there is none", "add a section [bed] or leave [contact] out"),
    Rule("body.x", lambda s: s.bed is None and s.body is not None and s.body.x is not None,
         "the grain rests on a bed but there is none", "add a section [bed], or give centre instead"),
    Rule("contact", lambda s: s.contact is not None and s.body is None,
         "contact needs a grain but there is none", "add a section [body] or leave [contact] out"),
    Rule("bed.slope", lambda s: s.bed is not None and s.bed.slope_angle and s.gravity is None,
         "a slope turns gravity but there is no gravity", 'add a section [gravity] or use kind = "flat"'),
    # Time.
    *when(lambda s: s.time is None,
        Rule("flow.components", _unsteady, f"depend on t {_STEADY}", "add a section [time] or leave t out"),
        Rule("numerics.convection", lambda s: s.numerics.convection == "extrapolated",
             f'"extrapolated" needs earlier steps {_STEADY}', 'add a section [time] or use "implicit"'),
        Rule("body.motion", lambda s: s.moves, "a moving grain needs time steps", "add a section [time]"),
        Rule("effects.unsteadiness", lambda s: s.effects.unsteadiness is True,
             f"is true {_STEADY}", "add a section [time]"),
    ),
    *(_unread(key, lambda s: s.time, f"counts time steps {_STEADY}", "add a section [time] or leave it out")
      for key in ("output.every", "output.checkpoint")),
    *when(lambda s: s.time is not None and s.time.until_steady is not None,
        Rule("time.until_steady", lambda s: s.moves,
             "is for a flow but the grain moves", 'leave it out or use body.motion = "fixed"'),
        Rule("time.until_steady", lambda s: s.effects.unsteadiness is False,
             "is for an unsteady flow but effects.unsteadiness is false", "leave it out or leave that out"),
        Rule("time.until_steady", lambda s: s.flow.at_rest,
             "is for a flow but the fluid is still", "leave it out or use another flow.kind"),
        Rule("time.until_steady", _unsteady,
             "is for a steady flow but flow.components depend on t", "leave it out or leave t out"),
        Rule("time.until_steady", _gust,
             "is for a steady flow but flow.gust changes it", "leave it out or leave that out"),
        Rule("time.until_steady", lambda s: s.surface and s.surface.wave,
             "is for a steady flow but surface.wave is unsteady", "leave it out or leave that out"),
    ),
    _unread("numerics.remesh_below", lambda s: s.moves,
            "is read only for a grain that moves", "leave it out or set body.motion"),
    _unread("numerics.interface_tolerance", lambda s: s.moves or s.has_surface,
            "is read only for a grain that moves", "leave it out or set body.motion"),
    # Accuracy.
    *(_unread(f"numerics.{key}", lambda s: s.numerics.accuracy, f"{why} but none is requested",
              "add numerics.accuracy or leave it out")
      for key, why in (("budget_seconds", "limits what is spent on an accuracy"),
                       ("budget_mib", "limits what is spent on an accuracy"),
                       ("accuracy_includes", "says what an accuracy includes"))),
    *when(lambda s: s.numerics.accuracy,
        Rule("numerics.accuracy_of",
             lambda s: s.numerics.accuracy_of == OF_WALLS and (s.body is not None or not s.is_averaged),
             '"{s.numerics.accuracy_of}" is for a turbulent channel without a grain', 'use "auto"'),
        Rule("numerics.accuracy", lambda s: s.body is None and not (s.is_averaged or s.has_surface),
             "needs a grain or a free surface but there is neither",
             "add a section [body], or leave it out and choose numerics.mesh_size"),
        Rule("numerics.accuracy_of",
             lambda s: s.numerics.accuracy_of in OF_SURFACE and not s.has_surface and (s.body or not s.is_averaged),
             '"{s.numerics.accuracy_of}" needs a free surface but there is none',
             'use "force", or domain.top = "free-surface"'),
        Rule("numerics.accuracy_of", lambda s: s.numerics.accuracy_of == OF_GRAIN and not (s.body and s.body.is_free),
             '"{s.numerics.accuracy_of}" is for a free or released grain', 'use "auto"'),
        Rule("numerics.accuracy", lambda s: s.numerics.accuracy == "verdict" and s.body is None,
             '"verdict" needs a grain but there is none', "add a section [body] or give a number"),
        Rule("numerics.accuracy_of", lambda s: s.body is None and not s.is_averaged and s.accuracy_of not in OF_SURFACE,
             '"{s.numerics.accuracy_of}" needs a grain but there is none', 'add a section [body] or use "elevation"'),
        Rule("numerics.accuracy", lambda s: s.body is not None and s.is_still,
             "is relative but a fluid at rest exerts no force", "leave it out"),
        Rule("numerics.accuracy", lambda s: s.numerics.accuracy == "verdict" and _needs_verdict(s),
             f"a verdict {_NEEDS}", _GIVE),
        Rule("numerics.accuracy_of", lambda s: s.numerics.accuracy_of == "safety factor" and _needs_verdict(s),
             f"a safety factor {_NEEDS}", _GIVE),
        Rule("numerics.accuracy", lambda s: s.numerics.accuracy == "verdict" and s.body and s.time,
             '"verdict" is for steady flow', "give a number, or leave [time] out"),
    ),
    # Effects that are forced on or off.
    Rule("effects.inertia", lambda s: s.effects.inertia is True and not s.fluid.inertia,
         "is true but fluid.inertia = false", "leave one of them out"),
    Rule("effects.gravity", lambda s: s.effects.gravity is True and s.gravity is None,
         "is true but there is no gravity", "add a section [gravity]"),
    *when(lambda s: s.effects.unsteadiness is False and s.time is not None,
        Rule("effects.unsteadiness", lambda s: s.moves,
             "is false but a grain moves in time", 'use "auto", or body.motion = "fixed"'),
        Rule("effects.unsteadiness", lambda s: s.time.tolerance is not None,
             "is false but steps adapt to the rate of change", "leave time.tolerance out"),
        Rule("effects.unsteadiness", lambda s: s.numerics.convection == "extrapolated",
             "is false but convection needs earlier steps", 'use numerics.convection = "implicit"'),
        Rule("effects.unsteadiness", lambda s: s.has_surface,
             "is false but a free surface moves in time", 'use "auto"'),
        Rule("effects.unsteadiness", lambda s: s.is_averaged,
             "is false but the turbulent flow is unsteady", "leave [time] out"),
    ),
    Rule("effects.contact",
         lambda s: s.effects.contact is True and (s.bed is None or s.body is None or s.body.x is None),
         "is true but no grain rests on a bed", "add [bed], and [body] with x"),
    Rule("effects.contact", lambda s: s.effects.contact is False and _touches(s),
         "is false, but the grain touches the bed while it moves", "leave it out"),
    # A grain that moves on its bed, and keys that only it reads.
    Rule("contact.friction", lambda s: _touches(s) and s.contact is None,
         "is missing, but the grain touches the bed while it moves", "add a section [contact] with a friction"),
    Rule("contact.kinetic_friction",
         lambda s: _touches(s) and s.contact and (s.contact.kinetic_friction or 0.0) > s.contact.friction,
         "is {s.contact.kinetic_friction:g}, more than contact.friction = {s.contact.friction:g}",
         "give at most contact.friction"),
    _unread("contact.cohesion", lambda s: not s.moves or _touches(s), "but the grain moves and never touches the bed"),
    Rule("body.locked", lambda s: _touches(s) and s.body.locked,
         "but a grain that touches the bed is free in all its motions", "leave it out"),
    Rule("time.tolerance", lambda s: _touches(s) and s.time is not None and s.time.tolerance is not None,
         "but velocities jump where the grain touches the bed, and steps cannot adapt to that",
         "leave it out: steps are of a fixed length"),
    Rule("time.until",
         lambda s: _touches(s) and s.time is not None and s.time.until == "out-of-pocket" and not s.has_forms,
         '"out-of-pocket" but the bed is flat', 'use "at-rest" or "end"'),
    *(_unread(key, _touches, 'is read only with body.motion = "released", or "free" with body.on_contact = "touch"')
      for key in ("time.until", "contact.kinetic_friction", "contact.restitution", "contact.rolling_resistance")),
    # What is not simulated at all comes before what a scene lacks.
    *when(lambda s: s.is_averaged,
        Rule("flow.gust", _gust, _NOT_MODELLED, "leave it out"),
        Rule("domain.top", lambda s: s.domain.top == FREE,
             f'"{FREE}" {_NOT_MODELLED}', 'use "auto", a lid without friction'),
    ),
    # Free surface.
    Rule("surface", lambda s: not s.has_surface and s.surface is not None,
         'describes a free surface, but the top is "{s.top}"',
         f'set domain.top = "{FREE}" or leave the section out'),
    *when(lambda s: s.has_surface,
        Rule("domain.top", lambda s: s.time is None, "a free surface needs time steps", "add a section [time]"),
        Rule("time.start", lambda s: s.time is not None and s.time.start != "rest" and s.domain.kind == "box",
             "below a free surface the fluid of a box starts from rest", 'use "rest"'),
    ),
    Rule("domain.top",
         lambda s: s.has_surface and (s.effects.gravity is False or not (s.gravity and s.gravity.acceleration)),
         "a free surface needs gravity", "add a section [gravity]"),
    *when(lambda s: s.has_surface,
        Rule("flow.kind", lambda s: s.domain.kind == "channel" and not s.flow.below_surface,
             '"{s.flow.kind}" is not possible below a free surface, which has no shear',
             f"use {kinds('below_surface')}"),
        Rule("flow.kind", lambda s: s.domain.kind == "box" and not s.flow.at_rest,
             "a free surface is simulated in a box whose fluid starts from rest",
             'use "still", or domain.kind = "channel"'),
        Rule("flow.kind", lambda s: _stream(s) and s.surface and s.surface.outflow == "wall" and not s.flow.at_rest,
             '"{s.flow.kind}" needs an open outflow but surface.outflow is "wall"', 'use "still"'),
    ),
    Rule("domain.sides", lambda s: _stream(s) and s.domain.sides == "stream",
         'is "stream", which is not possible with a free surface',
         'use "slip", or "wall" where the fluid sticks and the surface stays'),
    *when(lambda s: _stream(s) and s.surface,
        Rule("surface.sponge", lambda s: s.surface.sponge > (half := 0.5 * s.domain.length) and half,
             "is {s.surface.sponge:g}, more than half of the channel", "give at most {v:g}"),
        Rule("surface.wave", lambda s: s.surface.wave and s.domain.sides == "wall",
             "is two-dimensional but the channel has no-slip sides", 'use domain.sides = "slip"'),
        Rule("time.start", lambda s: s.time is not None and s.time.start != "rest" and s.surface.outflow == "wall",
             "is a through-flow but the channel is closed", 'use "rest"'),
    ),
    *(_unread(f"surface.{key}", lambda s: not (s.has_surface and s.domain.kind == "box" and s.flow.at_rest),
              "is read only in a channel but the domain is a box", 'leave it out or use domain.kind = "channel"')
      for key in ("wave", "outflow", "sponge")),
    *when(lambda s: s.has_surface and s.surface,
        Rule("surface.bottom", lambda s: s.surface.bottom == "slip" and s.bed is not None,
             "is for a domain without [bed]", "leave one of them out"),
        Rule("surface.points", lambda s: s.gdim == 3 and s.surface.points,
             "are those of a 2-D scene", "give the elevation as a formula"),
        Rule("surface.elevation", lambda s: s.gdim == 2 and "y" in Expression(s.surface.elevation).variables,
             "depends on y but the scene is two-dimensional", "use x only"),
    ),
    # Turbulence.
    Rule("turbulence", lambda s: not s.is_averaged and s.turbulence is not None,
         "describes turbulence, but effects.turbulence is not true",
         "set effects.turbulence = true or leave the section out"),
    Rule("turbulence.upstream_roughness",
         lambda s: s.turbulence and s.turbulence.upstream_roughness and s.body is None and not s.has_forms,
         "is read only past grains and bedforms: its inflow is not in equilibrium over a smooth planar bed",
         "leave it out"),
    *when(lambda s: s.is_averaged,
        Rule("flow.kind", lambda s: not s.flow.modelled, f'"{{s.flow.kind}}" {_NOT_MODELLED}',
             f"use {kinds('modelled')}, or judge forces of another program (incipient judge --forces)"),
        Rule("domain.top", lambda s: s.domain.top == "stream",
             '"stream" contradicts turbulence below it', 'use "auto"'),
        Rule("flow.datum", lambda s: _datum(s) != "auto" and not (s.has_forms and s.gdim == 3),
             "is not read with turbulence, whose profile starts at the mean height of bedforms",
             "leave it out"),
        Rule("domain.sides", lambda s: s.gdim == 3 and s.domain.sides == "wall",
             '"wall" with turbulence is retired: no secondary flow is modelled in corners',
             'use "slip", sides without friction'),
        Rule("domain.sides", lambda s: s.gdim == 3 and s.domain.sides == "stream",
             f'"stream" {_NOT_MODELLED}', 'use "slip", sides without friction'),
        Rule("{v}", lambda s: [
                key for key, inertia in (("fluid.inertia", s.fluid.inertia), ("effects.inertia", s.effects.inertia))
                if inertia is False][:1],
             "is false, but without inertia there is no turbulence", "leave it out"),
        Rule("time", lambda s: s.time is not None and s.gdim == 3,
             "with turbulence in 3-D is retired: a model of the mean flow has no fluctuations",
             "leave it out for the steady loads on a held grain, or judge forces of a large-eddy simulation: "
             "incipient judge --forces"),
        Rule("time.start", lambda s: s.time is not None and s.time.start == "stokes",
             '"stokes" leaves out inertia, without which there is no turbulence', 'use "steady" or "rest"'),
        Rule("numerics.convection", lambda s: s.time is not None and s.numerics.convection == "extrapolated",
             "with turbulence the walls' friction is implicit, and so is convection", 'use "implicit"'),
        Rule("numerics.accuracy", lambda s: s.numerics.accuracy and s.time is not None,
             "is not available for unsteady turbulence",
             "leave it out, and see the error bars, or leave [time] out"),
        Rule("numerics.accuracy_of",
             lambda s: s.numerics.accuracy and s.body is None and s.numerics.accuracy_of not in ("auto", OF_WALLS),
             '"{s.numerics.accuracy_of}" does not exist in a turbulent channel without a grain',
             f'use "{OF_WALLS}"'),
        Rule("numerics.accuracy_includes",
             lambda s: s.numerics.accuracy and s.body is None and s.numerics.accuracy_includes == "all",
             '"all" means gap and domain but without a grain both belong to the scene', "leave it out"),
    ),
    # Gusts.
    *when(_gust,
        Rule("flow.gust", lambda s: s.time is None,
             "changes the flow in time", "add a section [time] or leave it out"),
        Rule("flow.gust.duration",
             lambda s: s.time and _gust(s).shape != "points" and FEWEST_STEPS * s.time.step > _gust(s).duration,
             f"is {{s.flow.gust.duration:g}}, less than {FEWEST_STEPS} time steps of {{s.time.step:g}}",
             "reduce time.step"),
        Rule("flow.gust", lambda s: s.has_surface,
             "is not simulated below a free surface", 'use domain.top = "slip"'),
        Rule("flow.gust", lambda s: s.sides == "wall",
             "is not simulated between walls across the width", 'set domain.sides = "slip" or "stream"'),
    ),
    # Contact is computed on beds that are graphs.
    Rule("bed.points", lambda s: s.body and s.bed and s.bed.kind == "polyline" and s.bed.steps[:1],
         "has a vertical step at x = {v:g}, and grains over steps are not simulated",
         "give the step a width, or leave the grain out"),
)  # fmt: skip

# Of units.
WITHOUT_UNITS = (
    Rule("fluid.reynolds", lambda s: s.fluid.reynolds is None, "is missing",
         "add it: V L / nu, V is the flow's velocity; or a section [units]"),
    Rule("gravity.acceleration", lambda s: s.gravity is not None and s.gravity.acceleration is None,
         "is missing", "add it, or a section [units]"),
)  # fmt: skip
OF_UNITS = (
    Rule("units", lambda s: s.body is None,
         "are those of a scene with a grain, and there is none", "add a section [body]"),
    Rule("units.{s.flow.scaled_by}", lambda s: getattr(s.units, s.flow.scaled_by) is None,
         'is missing, which the flow "{s.flow.kind}" needs', "add it"),
    Rule("units.{v}",
         lambda s: [k for k in ("shear_rate", "velocity") if k != s.flow.scaled_by and getattr(s.units, k) is not None],
         'is not of the flow "{s.flow.kind}"', "give {s.flow.scaled_by} only"),
    Rule("body.mass", lambda s: s.body.mass is not None, "is given with [units]", "leave one of them out"),
    Rule("{v[0]}.{v[1]}", lambda s: [
            (section, key, stated, value) for (section, key), value in derived(s).items()
            if (stated := getattr(getattr(s, section), key, None)) is not None and abs(stated / value - 1.0) > _SAME],
         "is {v[2]:g}, but [units] makes it {v[3]:g}", "leave it out"),
)  # fmt: skip

# Of sizes and positions of domain, bed, grain and surface; each needs the earlier ones.
_MOVE = "move the grain, make it smaller or enlarge the domain"
_PLACE = "body.{s.body.place}"

PLACES = (
    Rule("domain.{v[0]}", lambda s: _coarse(s, 1e-6),
         "is so large that numbers there are {v[1]:.2g} apart, but positions are needed to {v[2]:.2g}",
         "move the scene towards zero, or make it smaller"),
    Rule("contact.tolerance", lambda s: _coarse(s, 0.0),
         "is {s.contact.tolerance:g}, a distance of {v[2]:.2g}, but numbers in the domain are {v[1]:.2g} apart",
         "give a larger one, such as 1e-6"),
    Rule("flow.components", _leaves_upstream, "give a flow out of the left side, which is the inflow",
         "mirror the scene, so that the flow is towards larger x"),
    Rule("domain.{v[0]}", _vast, "is {v[1]:g}, {v[2]:.2g} times the size of {v[3]}",
         f"give at most {FARTHEST:g} times that size"),
    *when(lambda s: s.bed,
        Rule("bed", _many_forms,
             f"has forms, about {{v[0]:.2g}} {{v[1]}}, with at least {CELLS_OF_A_FORM} cells each more than "
             "numerics.max_cells = {s.numerics.max_cells}",
             "enlarge them, use a flat bed instead, or allow more with --set numerics.max_cells=NUMBER"),
        Rule("bed", lambda s: s.bed.kind == "polyline" and _steps_at_ends(s),
             "has a step at x = {v:g}, an end of the domain", "leave out one of its two points, or move it inward"),
        Rule("bed", _short,
             "reaches from {v[0]} = {v[1]:g} to {v[2]:g}, the domain from {v[3]:g} to {v[4]:g}", "{v[5]}"),
        Rule("bed", lambda s: (top := s.bed_heights[1]) >= s.domain.ceiling and ("xyz"[s.up], top),
             "rises to {v[0]} = {v[1]:g}, the top is at {s.domain.ceiling:g}",
             "enlarge domain.height or lower the bed"),
        Rule("flow.datum", lambda s: s.gdim == 3 and _datum(s) == "effective",
             'is "effective" in 3-D, where it is not computed', 'use "auto" or a height'),
        Rule("flow.datum", lambda s: isinstance(_datum(s), float) and _datum_off_bed(s),
             "is {s.flow.datum:g}, the bed's heights above its base line go from {v[0]:g} to {v[1]:g}",
             'give one of them, or "auto", "crest" or "mean"'),
    ),
    *when(lambda s: s.surface,
        Rule("surface.stations[{v}]",
             lambda s: s.gdim == 2 and [n for n, place in enumerate(s.surface.places()) if place[1:]],
             "has 2 coordinates", "give its x"),
        Rule("surface.stations[{v}]",
             lambda s: s.gdim == 3 and [n for n, place in enumerate(s.surface.places()) if not place[1:]],
             "has 1 coordinate", "give [x, y]"),
        Rule("surface.stations[{v[0]}]", _outside,
             "{v[1]} = {v[2]:g} is outside the domain", "give {v[3]:g} to {v[4]:g}"),
        Rule("surface.{s.surface.given}", _low_surface,
             "brings the surface down to the bed at {v}", "give a smaller elevation"),
    ),
    *when(lambda s: s.body,
        Rule(_PLACE, lambda s: s.grain.size >= math.hypot(*s.domain.sizes.values()),
             "the grain measures {s.grain.size:g}, more than the domain", _MOVE),
        Rule("body.{v[4]}", _away, "{v[0]} = {v[1]:g} is outside the domain, {v[2]:g} to {v[3]:g}", _MOVE),
        Rule(_PLACE, lambda s: s.placement is None),  # which may find no rest
        Rule("domain.{v[0]}", _narrow, "is {v[1]:g}, too little for the grain, which takes {v[2]:g}",
             "enlarge it, or make the grain smaller"),
        Rule("body.{v[4]}", lambda s: [side for side in _sides(s) if side[-1] <= 0.0],
             "the grain reaches {v[0]} = {v[1]:g}, the domain's {v[2]} is at {v[3]:g}", _MOVE),
        Rule("body.{v[4]}", lambda s: [side for side in _sides(s) if side[-1] < NEARLY_TOUCHING * s.grain.size],
             "the grain nearly touches the domain's {v[2]}, from which it is {v[5]:.3g}", _MOVE),
        Rule(_PLACE, lambda s: s.bed and _into_bed(s), "{v[0]}", "{v[1]}"),
        Rule("surface.{s.surface.given}", lambda s: s.surface and _cut(s),
             "brings the surface down to the grain", "give a smaller elevation, or lower the grain"),
        Rule("body.length", lambda s: s.body.shape == "cylinder" and _not_across(s),
             "the cylinder reaches from y = {v[0]:g} to {v[1]:g}, the domain from {v[2]:g} to {v[3]:g}",
             "give domain.width, and the middle in centre"),
    ),
    Rule("domain.symmetric", lambda s: s.gdim == 3 and s.domain.symmetric is True and s.asymmetry,
         "is true, but {v}", "make the scene symmetric, or give false"),
)  # fmt: skip
