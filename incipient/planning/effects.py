"""Decisions on the physical effects of a scene.

A decision names the number or key behind it and, where known, the change from leaving the effect out.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from ..scene import Numerics
from ..scene.grains import FRICTIONLESS, LEVEL
from ..setup.base_flow import LogLawFlow, regime
from ..setup.setup import Setup, time_of_change

SHARE = 0.1  # of the requested accuracy that an omitted effect may use up
OSEEN = 3.0 / 16.0
# From about this Reynolds number on the turbulence of a channel sustains itself. Between walls, of mean
# velocity and height: 4/3 of 965, of half the height and the greatest velocity (Gomé, Tuckerman & Barkley
# 2020, Phys. Rev. Fluids 5, 083905; experiments: about 1000, Orszag & Kells 1980, J. Fluid Mech. 96, 159). In
# shear, of the velocity on top and the height: 4 times 324, of half of each (Duguet, Schlatter & Henningson
# 2010, J. Fluid Mech. 650, 119).
TURBULENT = 1300.0
REMEDY = (
    "in a channel without a grain, or with one of u* d/nu above 300, set effects.turbulence = true, "
    'else take a mean profile, flow.kind = "log-law"'
)
NO_BODY = "no [body] section"

# The physical effects, by their names in plan and result.
EffectName = Literal[
    "inertia",
    "unsteadiness",
    "traction",
    "gravity",
    "contact",
    "flow",
    "moving mesh",
    "free body",
    "free surface",
    "turbulence",
    "third dimension",
]


@dataclass(frozen=True)
class Decision:
    """Whether one physical effect is simulated, and why.

    forced: the scene says so, not the plan
    expected: relative change of quantity `of` without the effect, by its leading term, at most one; None: no estimate
    """

    name: EffectName
    present: bool
    reason: str
    forced: bool = False
    expected: float | None = None
    of: str = "drag"

    def text(self) -> str:
        line = f"{'yes' if self.present else ' no'}  {self.name}: {self.reason}"
        if not self.expected:
            return line
        size = percent(self.expected) + (" or more" if self.expected >= 1.0 else "")
        return f"{line}; estimated effect on {self.of} {size}"


def accuracy_asked(numerics: Numerics) -> float:
    """The requested relative accuracy, by default 1%."""
    return numerics.accuracy if isinstance(numerics.accuracy, float) else 0.01


def percent(share: float) -> str:
    """0.00075 as 0.08%."""
    return f"{100 * share:.1g}%" if share < 0.1 else f"{100 * share:.0f}%"


def listed(*parts: object) -> str:
    """The parts of a reason that hold: a part that is false or empty is left out."""
    return "; ".join(map(str, filter(None, parts)))


def _decided(
    setup: Setup, name: EffectName, present: bool, reason: str, expected: float | None = None
) -> Decision:
    """The decision on an effect with a key in [effects], which may force it."""
    option = getattr(setup.scene.effects, name)
    refused = present and option is False
    reason = listed(refused and f"effects.{name} = false", reason)
    return Decision(name, present and not refused, reason, refused or option is True, expected)


def decisions(setup: Setup) -> tuple[Decision, ...]:
    """The decisions on all effects, in the order in which plans and results show them."""
    scene, flow, there = setup.scene, setup.scene.flow, setup.scene.body is not None
    gusts = scene.gusts and "without [gusts], which incipient entrainment adds"
    base_flow = listed(flow.words or f"{flow.kind} flow", gusts)
    if flow.at_rest and scene.has_surface:
        base_flow = "the fluid starts from rest"
    surface = scene.has_surface and "the mesh rises and falls with the free surface"
    mesh = "the mesh follows the grain" if scene.moves else surface or "nothing moves"
    return (
        inertia(setup),
        unsteadiness(setup),
        Decision("traction", there, "of the fluid on the grain" if there else NO_BODY),
        gravity(setup),
        contact(setup),
        Decision("flow", scene.has_surface or not flow.at_rest, base_flow),
        Decision("moving mesh", scene.has_surface or scene.moves, mesh),
        free_body(setup),
        free_surface(setup),
        turbulent(setup),
        third_dimension(setup),
    )


def third_dimension(setup: Setup) -> Decision:
    """Present with domain.width; the reason names the half or whole that is computed."""
    scene = setup.scene
    if scene.gdim == 2:
        return Decision("third dimension", False, "the scene is two-dimensional")
    part = f"half of it is computed: it is its own mirror image in y = {scene.domain.middle:g}"
    if not setup.symmetric:
        part = f"the whole of it is computed: {scene.asymmetry or 'domain.symmetric = false'}"
    return Decision("third dimension", True, f"the scene is three-dimensional; {part}")


# -- the fluid -------------------------------------------------------------------------------------


def inertia(setup: Setup) -> Decision:
    """Present where Oseen's correction exceeds a fraction of the requested accuracy.

    Oseen's correction of the drag is 3/16 Re, with the Reynolds number of diameter and speed (Proudman & Pearson 1957,
    J. Fluid Mech. 2, 237). Far from walls inertia acts as far as the next wall: Stokes flow decays as slowly as the
    distance grows (Oseen 1910), in 2-D even more slowly. For a sphere that touches a wall in shear G, lift over drag is
    0.287 G a^2/nu (Leighton & Acrivos 1985, ZAMP 36, 174), 0.07 Re with the speed at its top: less than Oseen's.
    """
    scene, flow, numbers = setup.scene, setup.scene.flow, setup.numbers
    past_grain = (numbers.grain_reynolds or 0.0) * max(1.0, numbers.reach)
    # Inertia changes a base flow whose velocity is not along the bed everywhere.
    bends = flow.moves_top or flow.by_formulas or numbers.grain_reynolds is None
    of_flow = max(numbers.bed_reynolds or 0.0, numbers.flow_reynolds if bends else 0.0)
    driven = scene.moves or not flow.at_rest
    change = min(OSEEN * max(past_grain, of_flow), 1.0) if driven else 0.0
    reason = f"Re = {scene.fluid.reynolds:g} on {scene.fluid.scale} scale"
    if not scene.fluid.inertia:
        return Decision("inertia", False, f"fluid.inertia = false; {reason}", True, change)
    large = change > SHARE * accuracy_asked(scene.numerics)
    present = scene.has_surface or scene.effects.inertia != "auto" or large
    return _decided(setup, "inertia", present, reason, change)


def unsteadiness(setup: Setup) -> Decision:
    """Present with [time], unless the scene requires a quasi-steady flow.

    What it changes of the drag on a held grain: the history force, a/sqrt(nu T), and the pressure of the accelerated
    base flow with the added mass, a^2/(3 nu T), over Stokes' drag, for radius a and time of change T (Maxey & Riley
    1983, Phys. Fluids 26, 883). The history force is that in an oscillating flow: one that grows steadily for T has
    2/sqrt(pi) times as much.
    """
    scene, grain, change = setup.scene, setup.scene.grain, None
    if scene.time is None:
        return Decision("unsteadiness", False, listed("no [time] section", shedding(setup)))
    period = time_of_change(setup.base_flow)
    if period is not None and grain is not None:
        diffusion = (0.5 * grain.size) ** 2 / (scene.viscosity * period)
        change = min(math.sqrt(diffusion) + diffusion / 3.0, 1.0)
    slow = change is not None and change < SHARE * accuracy_asked(scene.numerics)
    enough = slow and not scene.moves and scene.effects.unsteadiness is not False
    reason = listed(
        f"until t = {scene.time.end:g}", enough and "effects.unsteadiness = false would do"
    )
    return _decided(setup, "unsteadiness", True, reason, change)


def shedding(setup: Setup) -> str:
    """Warning if a steady flow is probably unstable (vortex shedding), or ""."""
    reynolds, scene = setup.numbers.grain_reynolds or 0.0, setup.scene
    # Cylinders: Heil, Rosso, Hazel & Brøns 2017, J. Fluid Mech. 812, 199 (experiments: 47, Provansal, Mathis & Boyer
    # 1987, J. Fluid Mech. 182, 1); spheres: Johnson & Patel 1999, J. Fluid Mech. 378, 19.
    least, shape = (46.0, "cylinder") if scene.gdim == 2 else (270.0, "sphere")
    # Within 0.3 diameters of a wall cylinders do not (Bearman & Zdravkovich 1978, J. Fluid Mech. 89, 33; square ones
    # within 0.35: Bosch, Kappler & Rodi 1996, Exp. Therm. Fluid Sci. 13).
    in_the_open = setup.numbers.reach - 0.5 >= 0.3
    if reynolds <= least or setup.base_flow.creeping or not in_the_open:
        return ""
    return f"grain Re {reynolds:.3g}: a {shape} in a uniform flow sheds vortices above {least:g}"


def free_surface(setup: Setup) -> Decision:
    """Present with domain.top = "free-surface"; a rigid lid neglects a rise of Fr^2/2 of the depth (Bernoulli).

    In a channel the reason names the level at both ends, and the length of incoming waves.
    """
    scene, froude, top = setup.scene, setup.numbers.froude, f'domain.top = "{setup.scene.top}"'
    if not scene.has_surface:
        if scene.top != "slip" or froude is None:
            return Decision("free surface", False, top, of="depth")
        rise = f"Froude number of this height {froude:.2g}, at which a surface would rise"
        return Decision(
            "free surface", False, f"{top}; {rise}", expected=0.5 * froude**2, of="depth"
        )
    pinned = " and ".join(setup.pinned_sides)
    reason = listed(
        top,
        pinned and f"no slip at {pinned}, where the surface is pinned",
        scene.domain.kind == "channel" and _level_at_ends(setup, froude or 0.0),
    )
    return Decision("free surface", True, reason, of="depth")


def _level_at_ends(setup: Setup, froude: float) -> str:
    from ..setup.waves import wave_of

    wave, is_open = wave_of(setup), setup.surface.outflow == "open"
    left = "the still one" if froude >= 1.0 else "free"
    right = "that of the still fluid beyond the outflow"
    return listed(
        f"Froude number {froude:.2g}",
        f"the level is {left} at the inflow, {right if is_open else 'and the outflow is closed by a wall'}",
        wave and f"incoming waves are {2 * math.pi / wave.number:.3g} long",
    )


def turbulent(setup: Setup) -> Decision:
    """Present on request; otherwise the plan says where the flow may be turbulent."""
    scene, option = setup.scene, setup.scene.effects.turbulence
    if scene.is_averaged:
        model = {"k-epsilon": "k-epsilon", "k-omega-sst": "k-omega SST"}[setup.walls.asked.model]
        reason = f"effects.turbulence = true: {model} model; {setup.walls.text()}"
        return Decision("turbulence", True, reason, True)
    profile = setup.base_flow.mean_profile if isinstance(setup.base_flow, LogLawFlow) else None
    reynolds, least = setup.numbers.flow_reynolds, 0.5 * TURBULENT
    k = 0.0 if profile is None else profile.roughness_reynolds
    above = profile is None and transition(setup)
    reason = listed(
        "effects.turbulence = false" if option is False else "only with effects.turbulence = true",
        profile and f"mean profile only, the bed is {regime(k)}, u* k_s/nu = {k:.3g}",
        profile
        and reynolds < least
        and f"flow Re {reynolds:.3g}, but channels are laminar to {least:g}",
        above and f"{above}; {REMEDY}",
    )
    return Decision("turbulence", False, reason, option is False)


def transition(setup: Setup, faster: float = 1.0, where: str = "") -> str:
    """The Reynolds number at which a scene's flow, faster by a factor, may be turbulent, in words, or "".

    A top that moves with the flow represents endless flow, whose depth is not the height of the domain; a uniform flow
    over a bed still has a boundary layer. The mean profile of a turbulent flow does not apply.
    """
    scene, flow = setup.scene, setup.scene.flow
    if scene.domain.kind != "channel" or flow.kind == "log-law" or scene.is_averaged:
        return ""
    of_layer = flow.numbers(1.0, scene.viscosity)["Re_delta"] if flow.oscillates else 0.0
    over_bed = flow.kind == "uniform" and scene.bed is not None
    along = scene.reference_velocity * scene.domain.length / scene.viscosity if over_bed else 0.0
    of_depth = 0.0 if scene.top == "stream" else setup.numbers.flow_reynolds
    flows = (
        # Over a smooth bed, of the layer's thickness and the largest velocity: bursts at each reversal (in pipes: Hino,
        # Sawamoto & Takasu 1976, J. Fluid Mech. 75, 193).
        ("Re_delta", of_layer, 550.0, "Stokes layers"),
        # On a smooth plate (Schlichting & Gersten 2017, Boundary-Layer Theory, section 15.1: 3.5e5 to 1e6, by the
        # disturbances in the flow).
        ("Re of the length", along, 5e5, "boundary layers"),
        # An open channel is half a closed one.
        ("flow Re", of_depth, TURBULENT * (0.5 if flow.wall_below else 1.0), "channels"),
    )
    for name, number, least, what in flows:
        if (reynolds := faster * number) > least:
            return f"{name} {reynolds:.4g}{where}: {what} may be turbulent from {least:g} on"
    return ""


def slowest_flow(setup: Setup) -> tuple[float, float]:
    """Factors on a turbulent flow of the slowest, laminar flow of a search, and of a first guess.

    In 3-D a search begins with the guess, if that holds the grain. In 2-D it is zero.
    """
    # A Reynolds number of depth and mean velocity of 20, and a Shields number of 0.001.
    slowest = 20.0 * setup.walls.viscosity / (setup.walls.mean * setup.walls.depth)
    low = 1e-3 * setup.stress_unit / setup.bed_stress() if setup.scene.gdim == 3 else 0.0
    return slowest, low**0.5


def threshold_notes(setup: Setup, factor: float) -> Iterator[str]:
    """Flow of a threshold at a factor of the scene's, and whether it can be creeping or laminar."""
    scene, omitted = setup.scene, inertia(setup)
    grain = "one grain in 2-D" if scene.gdim == 2 else "one grain"
    flow, other = (
        f"steady laminar {scene.flow.kind}",
        "; for Shields numbers by probability see incipient entrainment",
    )
    if scene.flow.oscillates:
        flow, other = f"laminar {scene.flow.kind}", "; tau_b is the largest of a period"
    elif scene.is_averaged:
        flow, other = (
            "mean turbulent",
            ", tau_b of the inflow; gusts move it sooner, see incipient entrainment",
        )
    yield f"in {flow} flow over {grain}{other}"
    change = min(factor * (omitted.expected or 0.0), 1.0)
    if not omitted.present and change > accuracy_asked(scene.numerics):
        yield f"WARNING: without inertia, which may change the drag at the threshold by up to {percent(change)}"
    if transitional := transition(setup, factor, " at the threshold"):
        yield transitional


# -- the grain -------------------------------------------------------------------------------------


def gravity(setup: Setup) -> Decision:
    """Present with [gravity]."""
    scene = setup.scene
    if scene.gravity is None:
        return Decision("gravity", False, "no [gravity] section")
    acts = "buoyancy" if scene.mass is None else "weight and buoyancy"
    of_grain = scene.body is not None and f"{acts} of the grain"
    reason = listed(of_grain, "analytical hydrostatic pressure, no unknowns")
    return _decided(setup, "gravity", True, reason)


def contact(setup: Setup) -> Decision:
    """Present where a grain rests on a bed."""
    scene, body, settled = setup.scene, setup.scene.body, ""
    if body is None or not scene.rests:
        return Decision("contact", False, "no grain rests on a bed")
    if body.settle == FRICTIONLESS:
        settled = ", where it settled without friction"
    elif body.settle:
        friction, cohesion = scene.settling_law
        pull = " and cohesion" if cohesion else ""
        level, other = " on the level bed", ' (settle = "frictionless" gives one rest to compare)'
        where = level if body.settle == LEVEL else other
        settled = f", where it settled with friction {friction:g}{pull}{where}"
    return _decided(setup, "contact", True, f"the grain rests on the bed{settled}")


def free_body(setup: Setup) -> Decision:
    """Present with body.motion = "free" or "released"."""
    body, ratio, stokes = setup.scene.body, setup.numbers.density_ratio, setup.numbers.stokes
    if body is None:
        return Decision("free body", False, NO_BODY)
    locked = f" but for {', '.join(body.locked)}" if body.locked else ""
    known = body.is_free and ratio is not None and stokes is not None
    heavy = known and f"density ratio {ratio:.3g}, Stokes number {stokes:.2g}"
    return Decision(
        "free body", body.is_free, listed(f'body.motion = "{body.motion}"{locked}', heavy)
    )
