"""Decisions on the physical effects of a scene.

A decision names the number or key behind it and, where known, the change from leaving the effect out.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from ..scene import Numerics
from ..scene.grains import DEFAULT_FRICTION, FRICTIONLESS, LEVEL
from ..scene.symmetry import differences
from ..setup.base_flow import LogLawFlow
from ..setup.setup import Numbers, Setup, time_of_change

SHARE = 0.1  # of the requested accuracy that an omitted effect may use up
USUAL_ACCURACY = 0.01
OSEEN = 3.0 / 16.0
# A cylinder in a uniform flow sheds vortices from this Reynolds number on (Heil, Rosso, Hazel & Brøns 2017, J.
# Fluid Mech. 812, 199; experiments: 47, Provansal, Mathis & Boyer 1987, J. Fluid Mech. 182, 1); close to a
# wall, within 0.3 diameters, it does not (Bearman & Zdravkovich 1978, J. Fluid Mech. 89, 33; a square one
# within 0.35: Bosch, Kappler & Rodi 1996, Exp. Therm. Fluid Sci. 13).
SHEDDING, SHEDDING_CLEARANCE = 46.0, 0.3
SHEDDING_OF_SPHERE = 270.0  # Johnson & Patel 1999, J. Fluid Mech. 378, 19

# From about this Reynolds number on the turbulence of a channel sustains itself. Between walls, of mean
# velocity and height: 4/3 of 965, of half the height and the greatest velocity (Gomé, Tuckerman & Barkley
# 2020, Phys. Rev. Fluids 5, 083905; experiments: about 1000, Orszag & Kells 1980, J. Fluid Mech. 96, 159). In
# shear, of the velocity on top and the height: 4 times 324, of half of each (Duguet, Schlatter & Henningson
# 2010, J. Fluid Mech. 650, 119).
TURBULENT = 1300.0
# The boundary layer of a uniform flow on a smooth plate, of the flow's velocity and the length of the plate
# (Schlichting & Gersten 2017, Boundary-Layer Theory, section 15.1: 3.5e5 to 1e6, by the disturbances in the flow).
TURBULENT_LAYER = 5e5
# Stokes' boundary layer over a smooth bed, of its thickness and the largest velocity: bursts at each reversal from here
# on (in pipes: Hino, Sawamoto & Takasu 1976, J. Fluid Mech. 75, 193).
TURBULENT_STOKES_LAYER = 550.0
REMEDY = (
    "in a channel without a grain, or with one of u* d/nu above 300, set effects.turbulence = true, "
    'else take a mean profile, flow.kind = "log-law"'
)


class EffectName(StrEnum):
    """The physical effects, by their names in plan and result."""

    INERTIA = "inertia"
    UNSTEADINESS = "unsteadiness"
    TRACTION = "traction"
    GRAVITY = "gravity"
    CONTACT = "contact"
    FLOW = "flow"
    MOVING_MESH = "moving mesh"
    FREE_BODY = "free body"
    FREE_SURFACE = "free surface"
    TURBULENCE = "turbulence"
    THIRD_DIMENSION = "third dimension"


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
    """The requested or default relative accuracy."""
    return numerics.accuracy if isinstance(numerics.accuracy, float) else USUAL_ACCURACY


def percent(share: float) -> str:
    """0.00075 as 0.08%."""
    return f"{100 * share:.1g}%" if share < 0.1 else f"{100 * share:.0f}%"


# -- the fluid -------------------------------------------------------------------------------------


def inertia(setup: Setup) -> Decision:
    """Present where Oseen's correction exceeds a fraction of the requested accuracy.

    Oseen's correction of the drag is 3/16 Re, with the Reynolds number of diameter and speed (Proudman & Pearson 1957,
    J. Fluid Mech. 2, 237). Far from walls inertia acts as far as the next wall: Stokes flow decays as slowly as the
    distance grows (Oseen 1910), in 2-D even more slowly. For a sphere that touches a wall in shear G, lift over drag is
    0.287 G a^2/nu (Leighton & Acrivos 1985, ZAMP 36, 174), 0.07 Re with the speed at its top: less than Oseen's.
    """
    scene, numbers, name = setup.scene, setup.numbers, EffectName.INERTIA
    reynolds = f"Re = {scene.fluid.reynolds:g} on {scene.fluid.scale} scale"
    change = _oseen(scene.flow, numbers)
    if not scene.fluid.inertia or scene.effects.inertia is False:
        key = "fluid.inertia" if not scene.fluid.inertia else "effects.inertia"
        return Decision(name, False, f"{key} = false; {reynolds}", True, change)
    if scene.effects.inertia is True:
        return Decision(name, True, f"effects.inertia = true; {reynolds}", True)
    if scene.has_surface:
        return Decision(name, True, f"the free surface moves the fluid; {reynolds}")
    if scene.flow.at_rest and not scene.moves:
        return Decision(name, False, "the fluid is at rest", expected=0.0)
    if change > SHARE * accuracy_asked(scene.numerics):
        return Decision(name, True, reynolds, expected=change)
    of_grain = numbers.grain_reynolds is not None
    value = numbers.grain_reynolds if of_grain else numbers.flow_reynolds
    reason = f"{'grain' if of_grain else 'flow'} Re {value:.2g}"
    return Decision(name, False, reason, expected=change)


def _oseen(flow: Any, numbers: Numbers) -> float:
    estimates = [OSEEN * (numbers.bed_reynolds or 0.0)]
    if not flow.parallel:  # inertia changes the base flow
        estimates.append(OSEEN * numbers.flow_reynolds)
    if numbers.grain_reynolds is not None:
        estimates.append(OSEEN * numbers.grain_reynolds * max(1.0, numbers.reach))
    elif not flow.at_rest:
        estimates.append(OSEEN * numbers.flow_reynolds)
    return min(max(estimates), 1.0)


def unsteadiness(setup: Setup) -> Decision:
    """Present with [time], unless the scene requires a quasi-steady flow."""
    scene, name = setup.scene, EffectName.UNSTEADINESS
    time = scene.time
    if time is None:
        return Decision(
            name, False, "; ".join(filter(None, ("no [time] section", shedding(setup))))
        )
    change = _of_changes(setup)
    if scene.effects.unsteadiness is False:
        reason = "effects.unsteadiness = false: quasi-steady flow"
        return Decision(name, False, reason, True, change)
    reason = f"until t = {time.end:g}"
    if time.until_steady is not None:
        reason += f", or until it changes by {time.until_steady:g} per unit of time"
    small = SHARE * accuracy_asked(scene.numerics)
    if change is not None and change < small and not scene.moves:
        reason += "; effects.unsteadiness = false would do"
    return Decision(name, True, reason, scene.effects.unsteadiness is True, change)


def shedding(setup: Setup) -> str:
    """Warning if a steady flow is probably unstable (vortex shedding), or ""."""
    reynolds, scene = setup.numbers.grain_reynolds, setup.scene
    clearance = setup.numbers.reach - 0.5
    least, shape = (SHEDDING, "cylinder") if scene.gdim == 2 else (SHEDDING_OF_SPHERE, "sphere")
    if reynolds is None or reynolds <= least or clearance < SHEDDING_CLEARANCE:
        return ""
    if not scene.fluid.inertia or scene.effects.inertia is False:
        return ""
    return f"grain Re {reynolds:.3g}: a {shape} in a uniform flow sheds vortices above {least:g}"


def _of_changes(setup: Setup) -> float | None:
    """Relative change of the drag on a held grain as the base flow changes, at most one; None: steady flow.

    The history force, a/sqrt(nu T), and the pressure of the accelerated base flow with the added mass, a^2/(3 nu T),
    over Stokes' drag, for radius a and time of change T (Maxey & Riley 1983, Phys. Fluids 26, 883). The history force
    is that in an oscillating flow: one that grows steadily for T has 2/sqrt(pi) times as much.
    """
    grain, period = setup.scene.grain, time_of_change(setup.base_flow)
    if period is None or grain is None:
        return None
    diffusion = (0.5 * grain.size) ** 2 / (setup.scene.viscosity * period)
    return min(math.sqrt(diffusion) + diffusion / 3.0, 1.0)


def flow(setup: Setup) -> Decision:
    """Present unless the fluid is at rest and stays so."""
    scene = setup.scene
    words = scene.flow.words or f"{scene.flow.kind} flow"
    if scene.flow.at_rest and scene.has_surface:
        words = "the fluid starts from rest"
    elif scene.gusts:
        words += "; without [gusts], which incipient entrainment adds"
    return Decision(EffectName.FLOW, not scene.flow.at_rest or scene.has_surface, words)


def moving_mesh(setup: Setup) -> Decision:
    """Present with a grain that moves or a free surface."""
    scene, reason = setup.scene, "nothing moves"
    if scene.moves:
        reason = "the mesh follows the grain"
        if scene.body is not None and scene.body.shape in ("disc", "sphere"):
            reason += f"; it need not turn with a {scene.body.shape}"
    elif scene.has_surface:
        reason = "the mesh rises and falls with the free surface"
    forced = scene.effects.moving_mesh != "auto"
    return Decision(EffectName.MOVING_MESH, scene.moves or scene.has_surface, reason, forced)


def free_surface(setup: Setup) -> Decision:
    """Present with domain.top = "free-surface"; a rigid lid neglects a rise of Fr^2/2 of the depth (Bernoulli)."""
    scene, name, froude = setup.scene, EffectName.FREE_SURFACE, setup.numbers.froude
    reason = f'domain.top = "{scene.top}"'
    if scene.has_surface:
        speed = math.sqrt(float(abs(scene.gravity_vector).max()) * scene.domain.height)
        reason += f"; long waves travel at {speed:.3g}"
        if pinned := setup.pinned_sides:
            reason += f"; no slip at {' and '.join(pinned)}, where the surface is pinned"
        return Decision(name, True, reason + _ends(setup))
    if scene.top != "slip" or froude is None:
        return Decision(name, False, reason)
    reason += f"; Froude number {froude:.2g}, at which a surface would rise"
    return Decision(name, False, reason, expected=0.5 * froude**2, of="depth")


def _ends(setup: Setup) -> str:
    if setup.scene.domain.kind == "box":
        return ""
    from ..setup.waves import wave_of

    surface, wave = setup.surface, wave_of(setup)
    number = setup.numbers.froude or 0.0
    text = f"; Froude number {number:.2g}" if number else ""
    text += f"; the level is {'the still one' if number >= 1.0 else 'free'} at the inflow, "
    beyond = "that of the still fluid beyond the outflow"
    text += beyond if surface.outflow == "open" else "and the outflow is closed by a wall"
    if wave is not None:
        text += f"; incoming waves are {2 * math.pi / wave.number:.3g} long"
    return text + (f"; waves are damped over the last {surface.sponge:g}" if surface.sponge else "")


def third_dimension(setup: Setup) -> Decision:
    """Present with domain.width; half of the domain is computed where the flow is mirror-symmetric."""
    scene, name = setup.scene, EffectName.THIRD_DIMENSION
    if scene.gdim == 2:
        return Decision(name, False, "the scene is two-dimensional")
    if setup.symmetric:
        part = f"half of it is computed: it is its own mirror image in y = {scene.domain.middle:g}"
    elif scene.domain.symmetric is False:
        part = "the whole of it is computed: domain.symmetric = false"
    else:
        part = f"the whole of it is computed: {next(differences(scene), '')}"
    reason = f"the scene is three-dimensional; {part}"
    return Decision(name, True, reason, scene.effects.third_dimension is True)


def turbulent(setup: Setup) -> Decision:
    """Present on request; otherwise the plan says where the flow may be turbulent."""
    scene, name = setup.scene, EffectName.TURBULENCE
    if scene.is_averaged:
        model = {"k-epsilon": "k-epsilon", "k-omega-sst": "k-omega SST"}[setup.turbulence.model]
        reason = f"effects.turbulence = true: {model} model; {setup.walls.text()}"
        return Decision(name, True, reason, True)
    off, reynolds = scene.effects.turbulence is False, setup.numbers.flow_reynolds
    reason = "effects.turbulence = false" if off else "only with effects.turbulence = true"
    if isinstance(setup.base_flow, LogLawFlow):
        reason += f"; mean profile only, the bed is {setup.base_flow.mean_profile.regime()}"
        if reynolds < (least := turbulent_from(scene.flow)):
            reason += f"; flow Re {reynolds:.3g}, but channels are laminar to {least:g}"
    elif above := transition(setup):
        reason += f"; {above}; {REMEDY}"
    return Decision(name, False, reason, off)


def transition(setup: Setup, faster: float = 1.0, where: str = "") -> str:
    """The Reynolds number at which a scene's flow, faster by a factor, may be turbulent, in words, or "".

    A top that moves with the flow represents endless flow, whose depth is not the height of the domain; a uniform flow
    over a bed still has a boundary layer. The mean profile of a turbulent flow does not apply.
    """
    scene, kind, text = setup.scene, setup.scene.flow.kind, ""
    if scene.domain.kind != "channel" or kind == "log-law" or scene.is_averaged:
        return text
    along = faster * scene.reference_velocity * scene.domain.length / scene.viscosity
    reynolds, least = faster * setup.numbers.flow_reynolds, turbulent_from(scene.flow)
    if scene.top != "stream" and reynolds > least:
        text = f"flow Re {reynolds:.4g}{where}: channels may be turbulent from {least:g} on"
    if scene.flow.oscillates:
        of_layer = faster * scene.flow.numbers(1.0, scene.viscosity)["Re_delta"]
        if of_layer > (least := TURBULENT_STOKES_LAYER):
            text = (
                f"Re_delta {of_layer:.4g}{where}: Stokes layers may be turbulent from {least:g} on"
            )
    if kind == "uniform" and scene.bed is not None and along > (least := TURBULENT_LAYER):
        text = f"Re of the length {along:.4g}{where}: boundary layers may be turbulent from {least:g} on"
    return text


def turbulent_from(flow: Any) -> float:
    """Flow Reynolds number above which a channel may be turbulent; an open channel is half a closed one."""
    return 0.5 * TURBULENT if flow.wall_below else TURBULENT


# -- the grain -------------------------------------------------------------------------------------


def traction(setup: Setup) -> Decision:
    """Present with a grain."""
    there = setup.scene.body is not None
    reason = "of the fluid on the grain" if there else "no [body] section"
    return Decision(EffectName.TRACTION, there, reason)


def gravity(setup: Setup) -> Decision:
    """Present with [gravity]."""
    scene, name = setup.scene, EffectName.GRAVITY
    if scene.gravity is None:
        return Decision(name, False, "no [gravity] section")
    if scene.effects.gravity is False:
        return Decision(name, False, "effects.gravity = false", True)
    reason = "on the free surface; " if scene.has_surface else ""
    reason += "weight and buoyancy of the grain; analytical hydrostatic pressure, no unknowns"
    return Decision(name, True, reason, scene.effects.gravity is True)


def contact(setup: Setup) -> Decision:
    """Present where a grain rests on a bed."""
    scene, body, name = setup.scene, setup.scene.body, EffectName.CONTACT
    if body is None or not scene.rests:
        return Decision(name, False, "no grain rests on a bed")
    if scene.effects.contact is False:
        return Decision(name, False, "effects.contact = false: no verdict", True)
    reason = "the grain rests on the bed"
    if body.settle == FRICTIONLESS:
        reason += ", where it settled without friction"
    elif body.settle:
        friction = DEFAULT_FRICTION if scene.contact is None else scene.contact.friction
        reason += f", where it settled with friction {friction:g}"
        level, other = " on the level bed", ' (settle = "frictionless" gives one rest to compare)'
        reason += level if body.settle == LEVEL else other
    return Decision(name, True, reason, scene.effects.contact is True)


def free_body(setup: Setup) -> Decision:
    """Present with body.motion = "free" or "released"."""
    body, numbers, name = setup.scene.body, setup.numbers, EffectName.FREE_BODY
    if body is None:
        return Decision(name, False, "no [body] section")
    reason = f'body.motion = "{body.motion}"'
    if body.locked:
        reason += f" but for {', '.join(body.locked)}"
    if body.is_free and numbers.density_ratio is not None and numbers.stokes is not None:
        reason += f"; density ratio {numbers.density_ratio:.3g}, Stokes number {numbers.stokes:.2g}"
    return Decision(name, body.is_free, reason, setup.scene.effects.free_body != "auto")


# The effects in the order in which plans and results show them.
TABLE: tuple[Callable[[Setup], Decision], ...] = (
    inertia,
    unsteadiness,
    traction,
    gravity,
    contact,
    flow,
    moving_mesh,
    free_body,
    free_surface,
    turbulent,
    third_dimension,
)
