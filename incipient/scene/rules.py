"""Rules between sections; the first broken rule of each group is reported."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from .expression import Expression
from .flows import kinds
from .messages import Problem, either
from .numerics import OF_SURFACE, OF_WALLS
from .section import Rule, Text
from .surface import FREE, Surface

if TYPE_CHECKING:
    from .model import Scene

# Base flows below a free surface: profiles without shear on it, or none.
STREAMS = kinds("below_surface")
TURBULENT = kinds("modelled")  # base flows of channels that models of turbulence are for
FEWEST_STEPS = 2  # of time, in the duration of a gust
TOUCHES = 'body.motion = "released", or "free" with body.on_contact = "touch"'
# u* k_s/nu up to which the mean profile follows the measured one (docs/contribute/defaults.md).
_ROUGHEST = 500.0
_IN_3D = {"body": '"sphere"', "bed": '"spheres"'}
_NOT_MODELLED = "with turbulence is not simulated by this version"
_NO_FLUCTUATIONS = "with turbulence in 3-D is retired: a model of the mean flow has no fluctuations"
_BY_OTHERS = (
    "leave it out for the steady loads on a held grain, or judge forces of a large-eddy simulation: "
    "incipient judge --forces"
)

Asked = Callable[[Any], Any]  # of a scene; rules check which sections exist


def contradictions(scene: Scene) -> Iterator[Problem]:
    """Contradictions between sections, except for positions and extents."""
    for group in (*RULES, scene.flow.needs):
        first = next((rule for rule in group if rule.broken(scene)), None)
        if first is not None:
            yield first.problem(scene)


# -- conditions of rules ---------------------------------------------------------------------------


def _unsteady(s: Scene) -> bool:
    return s.flow.by_formulas and s.flow.changes


def _surface(s: Scene) -> Surface:
    return s.surface or Surface()


def _wave(s: Scene) -> bool:
    return _surface(s).wave is not None


def _without_scale(s: Scene) -> bool:
    return s.fluid.scale == "grain" and s.body is None


def _gust(s: Scene) -> Any:
    return getattr(s.flow, "gust", None)


def _datum(s: Scene) -> Any:
    return getattr(s.flow, "datum", "auto")


def _channel(s: Scene) -> bool:
    return s.has_surface and s.domain.kind == "channel"


def _stream(s: Scene) -> bool:
    return _channel(s) and s.flow.below_surface


def _boxed(s: Scene) -> bool:
    return s.domain.kind == "box"


def _touches(s: Scene) -> bool:
    return s.body is not None and s.body.touches


def _free(s: Scene) -> bool:
    return s.body is not None and s.body.is_free


def _quasi_steady(s: Any) -> bool:
    return s.effects.unsteadiness is False and s.time is not None


def _mean_channel(s: Scene) -> bool:
    return s.is_averaged and s.body is None


def _forms(s: Scene) -> bool:
    return s.bed is not None and s.bed.kind != "flat"


def _verdict(s: Scene) -> bool:
    return s.numerics.accuracy == "verdict"


def _accurate(s: Scene) -> bool:
    return s.numerics.accuracy is not None


def _step(s: Scene) -> float | None:
    if s.bed is None or s.bed.kind != "polyline":
        return None
    return next((left for (left, _), (right, _) in pairwise(s.bed.points) if left == right), None)


def _roughness(s: Scene) -> float:
    if s.flow.kind != "log-law" or _boxed(s) or _without_scale(s):
        return 0.0
    return float(s.flow.shear_velocity * s.flow.roughness / s.viscosity)


def _motion(s: Scene) -> str:
    return "there is no grain" if s.body is None else f'body.motion = "{s.body.motion}"'


# -- the rules ------------------------------------------------------------------------------------


def _of_dimension(section: str, key: str) -> tuple[Rule, ...]:
    def value(s: Scene) -> Any:
        return getattr(getattr(s, section), key)

    def differs(s: Scene, gdim: int) -> bool:
        part = getattr(s, section)
        return part is not None and s.gdim == gdim and gdim not in part.gdims

    return (
        Rule(f"{section}.{key}", lambda s: differs(s, 2),
             lambda s: f'domain.width is missing, which the three-dimensional "{value(s)}" needs',
             f"add domain.width, or use a {section} of the plane"),
        Rule(f"{section}.{key}", lambda s: differs(s, 3),
             lambda s: f'"{value(s)}" is two-dimensional, but domain.width makes the scene three-dimensional',
             f"use a 3-D {section} such as {_IN_3D[section]}, or leave width out"),
    )  # fmt: skip


def _with_time(key: str, broken: Asked, why: str, remedy: str) -> Rule:
    return Rule(key, lambda s: s.time is None and broken(s),
                f"{why} but without [time] the flow is steady", f"add a section [time] or {remedy}")  # fmt: skip


def _never_steady(broken: Asked, why: str, remedy: str) -> Rule:
    return Rule("time.until_steady",
                lambda s: s.time is not None and s.time.until_steady is not None and broken(s),
                f"is for {why}", f"leave it out or {remedy}")  # fmt: skip


def _read_for_motion(key: str, with_surface: bool) -> Rule:
    return Rule(f"numerics.{key}",
                lambda s: not s.moves and not (with_surface and s.has_surface) and s.numerics.changed(key),
                "is read only for a grain that moves", "leave it out or set body.motion")  # fmt: skip


def _read_for_touching(key: str) -> Rule:
    return Rule(f"contact.{key}", lambda s: not _touches(s) and s.contact is not None and s.contact.changed(key),
                f"is read only with {TOUCHES}", "leave it out")  # fmt: skip


def _for_accuracy(key: str, why: str) -> Rule:
    return Rule(f"numerics.{key}", lambda s: not _accurate(s) and s.numerics.changed(key),
                f"{why} but none is requested", "add numerics.accuracy or leave it out")  # fmt: skip


def _for_boxes(key: str) -> Rule:
    return Rule(f"surface.{key}",
                lambda s: s.has_surface and _boxed(s) and s.flow.at_rest and _surface(s).changed(key),
                "is read only in a channel but the domain is a box",
                'leave it out or use domain.kind = "channel"')  # fmt: skip


def _for_accuracy_of_loads(*others: Rule) -> tuple[Rule, ...]:
    def within(rule: Rule) -> Rule:
        return Rule(rule.key, lambda s: _accurate(s) and rule.broken(s), rule.why, rule.remedy)

    return tuple(map(within, others))


def _needs_verdict(s: Any) -> bool:
    return None in (s.body.x, s.bed, s.contact, s.mass)


def _of_turbulence(key: Text, broken: Asked, why: Text, remedy: Text) -> Rule:
    return Rule(key, lambda s: s.is_averaged and broken(s), why, remedy)


_NEEDS = "needs a grain that rests on a bed, its density and friction"
_GIVE = "give body.x, body.density, [bed] and [contact], or a number for the accuracy of the force"

RULES: tuple[tuple[Rule, ...], ...] = (
    # Dimension.
    _of_dimension("body", "shape"),
    _of_dimension("bed", "kind"),
    (
        Rule("flow.components", lambda s: s.flow.by_formulas and len(s.flow.components) != s.gdim,
             lambda s: f"has {len(s.flow.components)} items",
             lambda s: "give two, as in [x, y]" if s.gdim == 2 else "give three, as in [x, y, z]"),
    ),
    # Flow and domain.
    (
        Rule("flow.kind", lambda s: s.flow.closed is True and not _boxed(s),
             '"{s.flow.kind}" needs a box but the domain is a channel', 'set domain.kind = "box"'),
        Rule("flow.kind", lambda s: s.flow.closed is False and _boxed(s),
             '"{s.flow.kind}" needs open ends but a box is closed',
             'set domain.kind = "channel", or use "lid" or "still"'),
        Rule("domain.top", lambda s: _boxed(s) and s.domain.top == "stream" and not s.flow.by_formulas,
             "no flow passes the top of a closed box", 'use "wall", "slip" or "auto"'),
        Rule("domain.top", lambda s: s.flow.tops and s.domain.top not in s.flow.tops,
             '"{s.domain.top}" contradicts the flow "{s.flow.kind}"', lambda s: f"use {either(s.flow.tops)}"),
    ),
    (
        Rule("flow.roughness", lambda s: _roughness(s) > _ROUGHEST,
             lambda s: f"is {_roughness(s):.3g} times nu/u*; the mean profile is known up to {_ROUGHEST:g} times that",
             "reduce it, or fluid.reynolds"),
    ),
    (
        Rule("fluid.scale", _without_scale, '"grain" but there is no grain', 'add a section [body] or use "flow"'),
    ),
    # Bed, grain and contact.
    (
        Rule("flow.datum", lambda s: s.bed is None and _datum(s) not in ("auto", "crest"),
             "is a height of the bed but there is none", "add a section [bed] or leave it out"),
    ),
    (
        Rule("contact.friction", lambda s: s.bed is None and s.contact is not None and not s.moves,
             "friction needs a bed but there is none", "add a section [bed] or leave [contact] out"),
    ),
    (
        Rule("body.x", lambda s: s.bed is None and s.body is not None and s.body.x is not None,
             "the grain rests on a bed but there is none", "add a section [bed], or give centre instead"),
    ),
    (
        Rule("contact", lambda s: s.contact is not None and s.body is None,
             "contact needs a grain but there is none", "add a section [body] or leave [contact] out"),
    ),
    (
        Rule("bed.slope", lambda s: s.bed is not None and s.bed.slope_angle and s.gravity is None,
             "a slope turns gravity but there is no gravity", 'add a section [gravity] or use kind = "flat"'),
    ),
    # Time.
    (_with_time("flow.components", _unsteady, "depend on t", "leave t out"),),
    (
        _with_time("numerics.convection", lambda s: s.numerics.convection == "extrapolated",
                   '"extrapolated" needs earlier steps', 'use "implicit"'),
    ),
    (_with_time("output.every", lambda s: s.output.every > 0, "counts time steps", "leave it out"),),
    (_with_time("output.checkpoint", lambda s: s.output.checkpoint > 0, "counts time steps", "leave it out"),),
    (_never_steady(lambda s: s.moves, "a flow but the grain moves", 'use body.motion = "fixed"'),),
    (
        _never_steady(lambda s: s.effects.unsteadiness is False,
                      "an unsteady flow but effects.unsteadiness is false", "leave that out"),
    ),
    (
        _never_steady(lambda s: s.flow.at_rest, "a flow but the fluid is still", "use another flow.kind"),
    ),
    (_never_steady(_unsteady, "a steady flow but flow.components depend on t", "leave t out"),),
    (_never_steady(_gust, "a steady flow but flow.gust changes it", "leave that out"),),
    (_never_steady(_wave, "a steady flow but surface.wave is unsteady", "leave that out"),),
    (
        _never_steady(lambda s: "t" in Expression(_surface(s).pressure).variables,
                      "a steady flow but surface.pressure depends on t", "leave t out"),
    ),
    (
        Rule("body.motion", lambda s: s.moves and s.time is None,
             "a moving grain needs time steps", "add a section [time]"),
    ),
    (_read_for_motion("remesh_below", with_surface=False),),
    (_read_for_motion("interface_tolerance", with_surface=True),),
    # Accuracy.
    (_for_accuracy("budget_seconds", "limits what is spent on an accuracy"),),
    (_for_accuracy("budget_mib", "limits what is spent on an accuracy"),),
    (_for_accuracy("accuracy_includes", "says what an accuracy includes"),),
    _for_accuracy_of_loads(
        Rule("numerics.accuracy_of",
             lambda s: s.numerics.accuracy_of == OF_WALLS and (s.body is not None or not s.is_averaged),
             '"{s.numerics.accuracy_of}" is for a turbulent channel without a grain', 'use "auto"'),
        Rule("numerics.accuracy", lambda s: s.body is None and not (s.is_averaged or s.has_surface),
             "needs a grain or a free surface but there is neither",
             "add a section [body], or leave it out and choose numerics.mesh_size"),
        Rule("numerics.accuracy_of",
             lambda s: s.numerics.accuracy_of in OF_SURFACE and not (s.has_surface or _mean_channel(s)),
             '"{s.numerics.accuracy_of}" needs a free surface but there is none',
             'use "force", or domain.top = "free-surface"'),
        Rule("numerics.accuracy", lambda s: s.body is None and not s.is_averaged and _verdict(s),
             '"verdict" needs a grain but there is none', "add a section [body] or give a number"),
        Rule("numerics.accuracy_of", lambda s: s.body is None and not s.is_averaged and s.accuracy_of not in OF_SURFACE,
             '"{s.numerics.accuracy_of}" needs a grain but there is none', 'add a section [body] or use "elevation"'),
        Rule("numerics.accuracy",
             lambda s: s.body is not None and s.flow.at_rest and not (s.body.moves or s.has_surface),
             "is relative but a fluid at rest exerts no force", "leave it out"),
        Rule("numerics.accuracy", lambda s: s.body is not None and _verdict(s) and _needs_verdict(s),
             f"a verdict {_NEEDS}", _GIVE),
        Rule("numerics.accuracy_of",
             lambda s: s.body is not None and s.numerics.accuracy_of == "safety factor" and _needs_verdict(s),
             f"a safety factor {_NEEDS}", _GIVE),
        Rule("numerics.accuracy", lambda s: s.body is not None and _verdict(s) and s.time is not None,
             '"verdict" is for steady flow', "give a number, or leave [time] out"),
    ),
    # Effects that are forced on or off.
    (
        Rule("effects.third_dimension", lambda s: s.effects.third_dimension is True and s.gdim == 2,
             "is true but the scene is two-dimensional", "add domain.width"),
        Rule("effects.third_dimension", lambda s: s.effects.third_dimension is False and s.gdim == 3,
             "is false but domain.width is given", "leave one of them out"),
    ),
    (
        Rule("effects.inertia", lambda s: s.effects.inertia is True and not s.fluid.inertia,
             "is true but fluid.inertia = false", "leave one of them out"),
    ),
    (
        Rule("effects.gravity", lambda s: s.effects.gravity is True and s.gravity is None,
             "is true but there is no gravity", "add a section [gravity]"),
    ),
    (
        Rule("effects.unsteadiness", lambda s: s.effects.unsteadiness is True and s.time is None,
             "is true but without [time] the flow is steady", "add a section [time]"),
    ),
    (
        Rule("effects.unsteadiness", lambda s: _quasi_steady(s) and s.moves,
             "is false but a grain moves in time", 'use "auto", or body.motion = "fixed"'),
    ),
    (
        Rule("effects.unsteadiness",
             lambda s: _quasi_steady(s) and s.time.tolerance is not None,
             "is false but steps adapt to the rate of change", "leave time.tolerance out"),
    ),
    (
        Rule("effects.unsteadiness",
             lambda s: _quasi_steady(s) and s.numerics.convection == "extrapolated",
             "is false but convection needs earlier steps", 'use numerics.convection = "implicit"'),
    ),
    (
        Rule("effects.contact",
             lambda s: s.effects.contact is True and (s.bed is None or s.body is None or s.body.x is None),
             "is true but no grain rests on a bed", "add [bed], and [body] with x"),
        Rule("effects.contact", lambda s: s.effects.contact is False and _touches(s),
             "is false, but the grain touches the bed while it moves", "leave it out"),
    ),
    (
        Rule("effects.free_body", lambda s: s.effects.free_body is True and not _free(s),
             lambda s: f"is true but {_motion(s)}", 'set body.motion = "free"'),
        Rule("effects.free_body", lambda s: s.effects.free_body is False and _free(s),
             lambda s: f"is false but {_motion(s)}", 'set body.motion = "fixed"'),
    ),
    (
        Rule("effects.moving_mesh", lambda s: s.effects.moving_mesh is True and not (s.moves or s.has_surface),
             lambda s: f"is true but {_motion(s)}", 'set body.motion = "free" or "prescribed"'),
        Rule("effects.moving_mesh", lambda s: s.effects.moving_mesh is False and s.moves,
             lambda s: f"is false but {_motion(s)}", 'set body.motion = "fixed"'),
        Rule("effects.moving_mesh", lambda s: s.effects.moving_mesh is False and s.has_surface,
             "is false but the surface is free", 'use "auto"'),
    ),
    # A grain that moves on its bed, and keys that only it reads.
    (
        Rule("contact.friction", lambda s: _touches(s) and s.contact is None,
             "is missing, but the grain touches the bed while it moves", "add a section [contact] with a friction"),
        Rule("contact.cohesion",
             lambda s: s.moves and not _touches(s) and s.contact is not None and s.contact.cohesion,
             "but the grain moves and never touches the bed", "leave it out"),
        Rule("contact.kinetic_friction",
             lambda s: _touches(s) and (s.contact.kinetic_friction or 0.0) > s.contact.friction,
             "is {s.contact.kinetic_friction:g}, more than contact.friction = {s.contact.friction:g}",
             "give at most contact.friction"),
    ),
    (
        Rule("body.locked", lambda s: _touches(s) and s.body.locked,
             "but a grain that touches the bed is free in all its motions", "leave it out"),
    ),
    (
        Rule("time.tolerance", lambda s: _touches(s) and s.time is not None and s.time.tolerance is not None,
             "but velocities jump where the grain touches the bed, and steps cannot adapt to that",
             "leave it out: steps are of a fixed length"),
    ),
    (
        Rule("time.until",
             lambda s: _touches(s) and s.time is not None and s.time.until == "out-of-pocket" and not _forms(s),
             '"out-of-pocket" but the bed is flat', 'use "at-rest" or "end"'),
        Rule("time.until", lambda s: not _touches(s) and s.time is not None and s.time.until != "end",
             f"is read only with {TOUCHES}", "leave it out"),
    ),
    *((_read_for_touching(key),) for key in ("kinetic_friction", "restitution", "rolling_resistance")),
    # Free surface.
    (
        Rule("surface", lambda s: not s.has_surface and s.surface is not None,
             'describes a free surface, but the top is "{s.top}"',
             f'set domain.top = "{FREE}" or leave the section out'),
    ),
    (
        Rule("effects.free_surface", lambda s: not s.has_surface and s.effects.free_surface is True,
             "is true but there is none", f'set domain.top = "{FREE}"'),
        Rule("effects.free_surface", lambda s: s.has_surface and s.effects.free_surface is False,
             f'is false but domain.top = "{FREE}"', 'leave one of them out, as a lid is domain.top = "slip"'),
    ),
    (
        Rule("domain.top", lambda s: s.has_surface and s.time is None,
             "a free surface needs time steps", "add a section [time]"),
        Rule("time.start", lambda s: s.has_surface and s.time.start != "rest" and _boxed(s),
             "below a free surface the fluid of a box starts from rest", 'use "rest"'),
    ),
    (
        Rule("effects.unsteadiness", lambda s: s.has_surface and s.effects.unsteadiness is False,
             "is false but a free surface moves in time", 'use "auto"'),
    ),
    (
        Rule("domain.top",
             lambda s: s.has_surface and (s.effects.gravity is False or not (s.gravity and s.gravity.acceleration)),
             "a free surface needs gravity", "add a section [gravity]"),
    ),
    (
        Rule("flow.kind", lambda s: _channel(s) and not s.flow.below_surface,
             '"{s.flow.kind}" is not possible below a free surface, which has no shear', f"use {either(STREAMS)}"),
        Rule("flow.kind", lambda s: s.has_surface and _boxed(s) and not s.flow.at_rest,
             "a free surface is simulated in a box whose fluid starts from rest",
             'use "still", or domain.kind = "channel"'),
        Rule("flow.kind", lambda s: _stream(s) and _surface(s).outflow == "wall" and not s.flow.at_rest,
             '"{s.flow.kind}" needs an open outflow but surface.outflow is "wall"', 'use "still"'),
    ),
    (
        Rule("surface.ends", lambda s: _stream(s) and _surface(s).ends != "wall",
             "is read only in a box but the domain is a channel", "leave it out"),
    ),
    (
        Rule("domain.sides", lambda s: _stream(s) and s.domain.sides == "stream",
             'is "stream", which is not possible with a free surface',
             'use "slip", or "wall" where the fluid sticks and the surface stays'),
    ),
    (
        Rule("surface.sponge", lambda s: _stream(s) and _surface(s).sponge > 0.5 * s.domain.length,
             "is {s.surface.sponge:g}, more than half of the channel",
             lambda s: f"give at most {0.5 * s.domain.length:g}"),
    ),
    (
        Rule("surface.wave", lambda s: _stream(s) and _wave(s) and s.domain.sides == "wall",
             "is two-dimensional but the channel has no-slip sides", 'use domain.sides = "slip"'),
    ),
    (
        Rule("time.start",
             lambda s: _stream(s) and s.time is not None and s.time.start != "rest" and _surface(s).outflow == "wall",
             "is a through-flow but the channel is closed", 'use "rest"'),
    ),
    (_for_boxes("wave"),),
    (_for_boxes("outflow"),),
    (_for_boxes("sponge"),),
    (
        Rule("surface.bottom", lambda s: s.has_surface and _surface(s).bottom == "slip" and s.bed is not None,
             "is for a domain without [bed]", "leave one of them out"),
    ),
    (
        Rule("surface.points", lambda s: s.has_surface and s.gdim == 3 and _surface(s).points,
             "are those of a 2-D scene", "give the elevation as a formula"),
    ),
    (
        Rule("surface.elevation",
             lambda s: s.has_surface and s.gdim == 2 and "y" in Expression(_surface(s).elevation).variables,
             "depends on y but the scene is two-dimensional", "use x only"),
    ),
    # Turbulence.
    (
        Rule("turbulence", lambda s: not s.is_averaged and s.turbulence is not None,
             "describes turbulence, but effects.turbulence is not true",
             "set effects.turbulence = true or leave the section out"),
        Rule("turbulence.upstream_roughness",
             lambda s: s.turbulence and s.turbulence.upstream_roughness and s.body is None and not _forms(s),
             "is read only past grains and bedforms: its inflow is not in equilibrium over a smooth planar bed",
             "leave it out"),
    ),
    (
        _of_turbulence("domain.sides", lambda s: s.gdim == 3 and s.domain.sides == "wall",
                       '"wall" with turbulence is retired: no secondary flow is modelled in corners',
                       'use "slip", sides without friction'),
        _of_turbulence("domain.sides", lambda s: s.gdim == 3 and s.domain.sides == "stream",
                       f'"stream" {_NOT_MODELLED}', 'use "slip", sides without friction'),
    ),
    (_of_turbulence("flow.gust", _gust, _NOT_MODELLED, "leave it out"),),
    (
        _of_turbulence("domain.top", lambda s: s.domain.top == FREE,
                       f'"{FREE}" {_NOT_MODELLED}', 'use "auto", a lid without friction'),
    ),
    (
        _of_turbulence("flow.kind", lambda s: not s.flow.modelled, f'"{{s.flow.kind}}" {_NOT_MODELLED}',
                       f"use {either(TURBULENT)}, or judge forces of another program (incipient judge --forces)"),
        _of_turbulence("domain.top", lambda s: s.domain.top == "stream",
                       '"stream" contradicts turbulence below it', 'use "auto"'),
        _of_turbulence("flow.datum", lambda s: _datum(s) != "auto" and not (_forms(s) and s.gdim == 3),
                       "is not read with turbulence, whose profile starts at the bed's height at the inflow",
                       "leave it out"),
    ),
    (
        _of_turbulence(lambda s: "effects.inertia" if s.fluid.inertia else "fluid.inertia",
                       lambda s: not s.fluid.inertia or s.effects.inertia is False,
                       "is false, but without inertia there is no turbulence", "leave it out"),
    ),
    (_of_turbulence("time", lambda s: s.time is not None and s.gdim == 3, _NO_FLUCTUATIONS, _BY_OTHERS),),
    (
        _of_turbulence("time.start", lambda s: s.time is not None and s.time.start == "stokes",
                       '"stokes" leaves out inertia, without which there is no turbulence', 'use "steady" or "rest"'),
    ),
    (
        _of_turbulence("numerics.convection", lambda s: s.time is not None and s.numerics.convection == "extrapolated",
                       "with turbulence the walls' friction is implicit, and so is convection", 'use "implicit"'),
    ),
    (
        _of_turbulence("effects.unsteadiness", lambda s: s.time is not None and s.effects.unsteadiness is False,
                       "is false but the turbulent flow is unsteady", "leave [time] out"),
    ),
    (
        _of_turbulence("numerics.accuracy", lambda s: _accurate(s) and s.time is not None,
                       "is not available for unsteady turbulence",
                       "leave it out, and see the error bars, or leave [time] out"),
    ),
    (
        _of_turbulence("numerics.accuracy", lambda s: s.body is None and _verdict(s),
                       '"verdict" needs a grain but there is none', "give a number"),
    ),
    (
        _of_turbulence("numerics.accuracy_of",
                       lambda s: _accurate(s) and s.body is None and s.numerics.accuracy_of not in ("auto", OF_WALLS),
                       '"{s.numerics.accuracy_of}" does not exist in a turbulent channel without a grain',
                       f'use "{OF_WALLS}"'),
    ),
    (
        _of_turbulence("numerics.accuracy_includes",
                       lambda s: _accurate(s) and s.body is None and s.numerics.accuracy_includes == "all",
                       '"all" means gap and domain but without a grain both belong to the scene', "leave it out"),
    ),
    # Gusts.
    (
        Rule("flow.gust", lambda s: _gust(s) and s.time is None,
             "changes the flow in time", "add a section [time] or leave it out"),
        Rule("flow.gust.duration",
             lambda s: _gust(s) and _gust(s).shape != "points" and FEWEST_STEPS * s.time.step > _gust(s).duration,
             f"is {{s.flow.gust.duration:g}}, less than {FEWEST_STEPS} time steps of {{s.time.step:g}}",
             "reduce time.step"),
    ),
    (
        Rule("flow.gust", lambda s: _gust(s) and s.has_surface,
             "is not simulated below a free surface", 'use domain.top = "slip"'),
    ),
    (
        Rule("flow.gust", lambda s: _gust(s) and s.sides == "wall",
             "is not simulated between walls across the width", 'set domain.sides = "slip" or "stream"'),
    ),
    # Contact is computed on beds that are graphs.
    (
        Rule("bed.points", lambda s: s.body is not None and _step(s) is not None,
             lambda s: f"has a vertical step at x = {_step(s):g}, and grains over steps are not simulated",
             "give the step a width, or leave the grain out"),
    ),
)  # fmt: skip
