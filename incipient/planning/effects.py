"""Which effects a scene calls for: its dimensionless numbers, what leaving an effect out would change, the decision.

An effect is left out where its expected influence on the drag is below a tenth of the accuracy asked for: errors of
the model then stay small beside those of the discretisation. The estimates are the leading terms for a sphere:

- inertia: Oseen's correction of the drag, 3/16 Re, with the Reynolds number of diameter and speed (Proudman &
  Pearson 1957, J. Fluid Mech. 2, 237). A grain away from walls feels inertia as far as the next wall: the
  flow of Stokes decays as slowly as the distance grows (Oseen 1910), in the plane even more slowly. For a
  sphere that touches a wall in shear G, lift over drag is 0.287 G a^2/nu (Leighton & Acrivos 1985, ZAMP 36,
  174), that is 0.07 Re with the speed at its top: Oseen's is the larger.
- unsteadiness: what a stream that changes does to a sphere held in it, over the drag of Stokes: the history
  force, a/sqrt(nu T), and the pressure that accelerates stream and displaced fluid with the added mass,
  a^2/(3 nu T), with a the radius and T the time in which the flow changes (Maxey & Riley 1983, Phys. Fluids
  26, 883; the history force is that in a stream that oscillates: one that grows steadily for a time T has
  2/sqrt(pi) times as much).

They only decide. What was left out is estimated once more from the flow that was computed
(`incipient.simulation.left_out`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

from ..scene.grains import FRICTIONLESS
from ..scene.settling import DEFAULT_FRICTION
from .transition import REMEDY, transition, turbulent_from

if TYPE_CHECKING:
    import numpy as np

    from ..geometry.placement import Placement
    from ..scene import Scene
    from ..scene.grains import FRICTIONLESS

OSEEN = 3.0 / 16.0
SHARE = 0.1  # of the accuracy asked for that an effect left out by the plan may use up
USUAL_ACCURACY = 0.01
# A cylinder in a stream sheds vortices from this Reynolds number on (Heil, Rosso, Hazel & Brøns 2017, J.
# Fluid Mech. 812, 199; experiments: 47, Provansal, Mathis & Boyer 1987, J. Fluid Mech. 182, 1); close to a
# wall, within 0.3 diameters, it does not (Bearman & Zdravkovich 1978, J. Fluid Mech. 89, 33; a square one
# within 0.35: Bosch, Kappler & Rodi 1996, Exp. Therm. Fluid Sci. 13).
SHEDDING, SHEDDING_CLEARANCE = 46.0, 0.3
SHEDDING_OF_SPHERE = 270.0  # Johnson & Patel 1999, J. Fluid Mech. 378, 19
_DIMENSIONS = {2: "two-dimensional", 3: "three-dimensional"}
SAMPLES = 33  # of times and of heights at which a given flow is looked at


class EffectName(StrEnum):
    """The physical effects that the program knows, by the names that plan and result show."""

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
class Effect:
    """One physical effect, whether it is simulated, and the reason.

    forced:   the scene says so, not the plan
    expected: relative change of the drag that the effect makes, by its leading term; None: no estimate
    """

    name: EffectName
    present: bool
    reason: str
    forced: bool = False
    expected: float | None = None


@dataclass(frozen=True)
class Numbers:
    """A scene's dimensionless numbers; None where the scene has nothing of the kind.

    grain_reynolds: speed of the flow past the grain times its largest diameter over the viscosity
    flow_reynolds:  reference velocity times height of the domain over the viscosity
    bed_reynolds:   speed at the height of the bed's relief above the datum times that height over the viscosity
    reach:          how far the grain's disturbance goes before a wall stops it, in grain sizes
    strouhal:       grain size over speed times the time in which the flow changes
    density_ratio:  density of a free or weighing grain over the fluid's
    stokes:         density ratio times grain Reynolds number / 18: how sluggishly the grain follows the flow
    froude:         reference velocity over sqrt(g height)
    shear_reynolds: shear velocity of a turbulent stream times the grain's largest diameter over the viscosity
    """

    grain_reynolds: float | None
    flow_reynolds: float
    bed_reynolds: float | None
    reach: float
    strouhal: float | None
    density_ratio: float | None
    stokes: float | None
    froude: float | None
    shear_reynolds: float | None = None

    def text(self) -> str:
        """The numbers that the scene has, on one line."""
        named = {
            "grain Re": self.grain_reynolds,
            "flow Re": self.flow_reynolds,
            "bed Re": self.bed_reynolds,
            "Strouhal": self.strouhal,
            "density ratio": self.density_ratio,
            "Stokes": self.stokes,
            "Froude": self.froude,
            "Re*": self.shear_reynolds,
        }
        told = {"grain Re": " (largest speed at its height)"}
        return ", ".join(
            f"{name} {value:.3g}{told.get(name, '')}" for name, value in named.items() if value is not None
        )


def accuracy_asked(scene: Scene) -> float:
    """The relative accuracy that the scene asks for, or what is usual."""
    asked = scene.numerics.accuracy
    return asked if isinstance(asked, float) else USUAL_ACCURACY


def effects_of(scene: Scene, numbers: Numbers) -> tuple[Effect, ...]:
    """Decide on every effect. Not collective."""
    moving = scene.flow.kind != "still" or scene.has_surface
    body = scene.body
    return (
        _inertia(scene, numbers),
        _unsteadiness(scene, numbers),
        Effect(
            EffectName.TRACTION,
            body is not None,
            "of the fluid on the grain" if body else "no [body] section",
        ),
        _gravity(scene),
        _contact(scene),
        Effect(EffectName.FLOW, moving, _flow(scene)),
        Effect(
            EffectName.MOVING_MESH,
            moves(scene) or scene.has_surface,
            _mesh_motion(scene),
            scene.effects.moving_mesh != "auto",
        ),
        _free_body(scene, numbers),
        _free_surface(scene, numbers),
        _turbulence(scene, numbers),
        _third_dimension(scene),
    )


# -- one effect each --------------------------------------------------------------------------------


def _inertia(scene: Scene, numbers: Numbers) -> Effect:
    if not scene.fluid.inertia or scene.effects.inertia is False:
        key = "fluid.inertia" if not scene.fluid.inertia else "effects.inertia"
        return Effect(EffectName.INERTIA, False, f"{key} = false", True, expected_of_inertia(scene, numbers))
    told = f"Re = {scene.fluid.reynolds:g} on {scene.fluid.scale} scale"
    if scene.effects.inertia is True:
        return Effect(EffectName.INERTIA, True, f"effects.inertia = true; {told}", True)
    if scene.has_surface:
        return Effect(EffectName.INERTIA, True, f"the free surface moves the fluid; {told}")
    if scene.flow.kind == "still" and not moves(scene):
        return Effect(EffectName.INERTIA, False, "the fluid is at rest", expected=0.0)
    expected = expected_of_inertia(scene, numbers)
    which = "flow Re" if numbers.grain_reynolds is None else "grain Re"
    value = numbers.flow_reynolds if numbers.grain_reynolds is None else numbers.grain_reynolds
    if expected > SHARE * accuracy_asked(scene):
        return Effect(EffectName.INERTIA, True, told, expected=expected)
    reason = f"{which} {value:.2g}; estimated effect on drag {percent(expected)}"
    return Effect(EffectName.INERTIA, False, reason, expected=expected)


def _unsteadiness(scene: Scene, numbers: Numbers) -> Effect:
    name, time = EffectName.UNSTEADINESS, scene.time
    if time is None:
        risk = _shedding(scene, numbers)
        return Effect(name, False, "no [time] section" + (f"; {risk}" if risk else ""))
    expected = expected_of_unsteadiness(scene)
    if scene.effects.unsteadiness is False:
        return Effect(name, False, "effects.unsteadiness = false: quasi-steady flow", True, expected)
    ends = (
        ""
        if time.until_steady is None
        else f", or until it changes by {time.until_steady:g} per unit of time"
    )
    reason, small = f"until t = {time.end:g}{ends}", SHARE * accuracy_asked(scene)
    if expected is not None and expected < small and not moves(scene):
        reason += f"; effects.unsteadiness = false would change the drag by {percent(expected)}"
    return Effect(name, True, reason, scene.effects.unsteadiness is True, expected)


def _shedding(scene: Scene, numbers: Numbers) -> str:
    """Warning if a steady flow is probably unstable (vortex shedding), or an empty string."""
    reynolds = numbers.grain_reynolds
    inert = scene.fluid.inertia and scene.effects.inertia is not False
    least, shape = (SHEDDING, "cylinder") if scene.gdim == 2 else (SHEDDING_OF_SPHERE, "sphere")
    if reynolds is None or reynolds <= least or not inert or _wall_distance(scene) < SHEDDING_CLEARANCE:
        return ""
    return f"grain Re {reynolds:.3g}: a {shape} in a stream sheds vortices from {least:g} on"


def _gravity(scene: Scene) -> Effect:
    if scene.gravity is None:
        return Effect(EffectName.GRAVITY, False, "no [gravity] section")
    if scene.effects.gravity is False:
        return Effect(EffectName.GRAVITY, False, "effects.gravity = false", True)
    reason = "weight and buoyancy of the grain; hydrostatic pressure in closed form, no unknowns"
    if scene.has_surface:
        reason = "on the free surface; " + reason
    return Effect(EffectName.GRAVITY, True, reason, scene.effects.gravity is True)


def _contact(scene: Scene) -> Effect:
    if not scene.rests:
        return Effect(EffectName.CONTACT, False, "no grain rests on a bed")
    if scene.effects.contact is False:
        return Effect(EffectName.CONTACT, False, "effects.contact = false: no verdict", True)
    reason = "the grain rests on the bed"
    if scene.body is not None and scene.body.settle == FRICTIONLESS:
        reason += ", where it settled without friction"
    elif scene.body is not None and scene.body.settle:
        friction = DEFAULT_FRICTION if scene.contact is None else scene.contact.friction
        reason += f", where it settled by friction {friction:g}"
        reason += ' (settle = "frictionless" gives one rest to compare)'
    return Effect(EffectName.CONTACT, True, reason, scene.effects.contact is True)


def _flow(scene: Scene) -> str:
    if scene.flow.kind == "log-law":
        return "mean profile of a turbulent stream, kept by the force that its turbulence would exert"
    if scene.flow.kind != "still":
        return f"{scene.flow.kind} flow"
    return "the fluid starts from rest" if scene.has_surface else "the fluid is at rest"


def moves(scene: Scene) -> bool:
    """Whether the scene has a grain that moves while the flow is computed."""
    return scene.body is not None and scene.body.moves


def _mesh_motion(scene: Scene) -> str:
    if scene.has_surface and not moves(scene):
        return "the mesh rises and falls with the free surface"
    if not moves(scene):
        return "nothing moves"
    if scene.body is not None and scene.body.shape in ("disc", "sphere"):
        return f"the mesh follows the grain; it need not turn with a {scene.body.shape}"
    return "the mesh follows the grain"


def _free_body(scene: Scene, numbers: Numbers) -> Effect:
    body = scene.body
    if body is None:
        return Effect(EffectName.FREE_BODY, False, "no [body] section")
    reason = f'body.motion = "{body.motion}"'
    if body.locked:
        reason += f" but for {', '.join(body.locked)}"
    if body.motion == "free" and numbers.density_ratio is not None and numbers.stokes is not None:
        reason += f"; density ratio {numbers.density_ratio:.3g}, Stokes number {numbers.stokes:.2g}"
    return Effect(EffectName.FREE_BODY, body.motion == "free", reason, scene.effects.free_body != "auto")


def _third_dimension(scene: Scene) -> Effect:
    name, reason = EffectName.THIRD_DIMENSION, f"the scene is {_DIMENSIONS[scene.gdim]}"
    if scene.gdim == 2:
        return Effect(name, False, reason)
    from ..scene.symmetry import differences

    if scene.symmetric:
        reason += f"; half of it is computed: it is its own mirror image in y = {scene.domain.middle:g}"
    elif scene.domain.symmetric is False:
        reason += "; the whole of it is computed: domain.symmetric = false"
    else:
        reason += f"; the whole of it is computed: {next(differences(scene), '')}"
    return Effect(name, True, reason, scene.effects.third_dimension is True)


def _free_surface(scene: Scene, numbers: Numbers) -> Effect:
    """A rigid lid in place of a surface: by Bernoulli's equation it hides a rise of Fr^2/2 of the depth."""
    reason = f'the top is "{scene.top}"'
    if scene.has_surface:
        from .surface import sticking

        speed = math.sqrt(float(abs(scene.gravity_vector).max()) * scene.domain.height)
        reason = f'domain.top = "{scene.top}"; long waves travel at {speed:.3g}'
        if sticking(scene):
            reason += f"; the fluid sticks to {' and '.join(sticking(scene))}, where its elevation stays"
        return Effect(EffectName.FREE_SURFACE, True, reason + _ends(scene))
    if scene.top != "slip" or numbers.froude is None:
        return Effect(EffectName.FREE_SURFACE, False, reason)
    expected = 0.5 * numbers.froude**2
    reason += (
        f"; Froude number {numbers.froude:.2g}: a surface would rise by {percent(expected)} of the depth"
    )
    return Effect(EffectName.FREE_SURFACE, False, reason, expected=expected)


def _ends(scene: Scene) -> str:
    """What a channel with a free surface has at its ends; empty for a box."""
    if scene.domain.kind == "box":
        return ""
    from ..scene.open_channel import froude
    from .open_channel import surface_of, wave_of

    asked, speed, wave = surface_of(scene), froude(scene), wave_of(scene)
    told = f"; Froude number {speed:.2g}" if speed else ""
    told += f"; the level is {'the still one' if speed >= 1.0 else 'free'} at the inflow, "
    told += (
        "that of the still fluid beyond the outflow"
        if asked.outflow == "open"
        else "and a wall at the right end"
    )
    if wave is not None:
        told += f"; a wave {2 * math.pi / wave.number:.3g} long comes in"
    return told + (f"; waves die out over the last {asked.sponge:g}" if asked.sponge else "")


def _turbulence(scene: Scene, numbers: Numbers) -> Effect:
    if scene.is_turbulent:
        from .turbulence import walls_of

        told = f"k-epsilon model; {walls_of(scene).text(scene.viscosity)}"
        return Effect(EffectName.TURBULENCE, True, f"effects.turbulence = true: {told}", True)
    reason = (
        "effects.turbulence = false" if scene.effects.turbulence is False else "only where it is asked for"
    )
    if scene.flow.kind == "log-law":
        from .mean_profile import mean_profile

        reason += f"; mean profile only, the bed is {mean_profile(scene).regime()}"
        if numbers.flow_reynolds < turbulent_from(scene):
            reason += f"; flow Re {numbers.flow_reynolds:.3g}, but channels are laminar to {turbulent_from(scene):g}"
    elif found := transition(scene, numbers):
        reason += f"; {found.text()}; {REMEDY}"
    return Effect(EffectName.TURBULENCE, False, reason, scene.effects.turbulence is False)


# -- estimates --------------------------------------------------------------------------------------


def expected_of_inertia(scene: Scene, numbers: Numbers) -> float:
    """Relative change of the drag that convection makes, by Oseen's term; at most one."""
    found = [OSEEN * (numbers.bed_reynolds or 0.0)]
    if scene.flow.kind in ("lid", "expression"):  # not parallel: inertia bends the flow itself
        found.append(OSEEN * numbers.flow_reynolds)
    if numbers.grain_reynolds is not None:
        found.append(OSEEN * numbers.grain_reynolds * max(1.0, numbers.reach))
    elif scene.flow.kind != "still":
        found.append(OSEEN * numbers.flow_reynolds)
    return min(max(found), 1.0)


def expected_of_unsteadiness(scene: Scene) -> float | None:
    """Relative change of the drag on a held grain as the stream changes, at most one; None: it is steady."""
    period, grain = time_of_change(scene), scene.grain
    if period is None or grain is None:
        return None
    diffusion = (0.5 * grain.size) ** 2 / (scene.viscosity * period)
    return min(math.sqrt(diffusion) + diffusion / 3.0, 1.0)


def time_of_change(scene: Scene) -> float | None:
    """Largest speed of the given flow over its largest rate of change; None where it does not change."""
    import numpy as np

    from .stream import column, undisturbed

    time, flow = scene.time, scene.flow
    if time is None or flow.kind != "expression" or not flow.unsteady:
        return None
    times = np.linspace(0.0, time.end, 4 * SAMPLES)
    points = column(scene, scene.domain.entrance, _heights(scene))
    stream = undisturbed(scene)
    speeds = np.array([stream(points, t) for t in times])
    rate = float(np.abs(np.gradient(speeds, times, axis=0)).max())
    return float(np.abs(speeds).max()) / rate if rate > 0.0 else None


# -- numbers ----------------------------------------------------------------------------------------


def numbers_of(scene: Scene) -> Numbers:
    """The scene's dimensionless numbers. Not collective."""
    from .stream import mean_speed

    grain, viscosity, height = scene.grain, scene.viscosity, scene.domain.height
    reynolds = strouhal = ratio = stokes = froude = of_shear = None
    velocity, period = mean_speed(scene), time_of_change(scene)
    if grain is not None:
        placement = scene.placement
        assert placement is not None
        speed = _speed_past_grain(scene, placement)
        reynolds, ratio = speed * grain.size / viscosity, scene.density
        stokes = None if ratio is None else ratio * reynolds / 18.0
        if scene.flow.kind == "log-law":
            of_shear = scene.reference_velocity * grain.size / viscosity
        strouhal = grain.size / (speed * period) if period is not None and speed > 0.0 else None
    if acceleration := float(abs(scene.gravity_vector).max()):
        froude = velocity / math.sqrt(acceleration * height)
    if scene.flow.kind == "shear":  # whose reference velocity is that over the reference length
        velocity *= height / scene.reference_length
    if scene.flow.kind == "still":
        velocity = 0.0
    flow = velocity * height / viscosity
    reach = _wall_distance(scene) + 0.5 if grain is not None else 0.0
    return Numbers(reynolds, flow, _bed_reynolds(scene), reach, strouhal, ratio, stokes, froude, of_shear)


def _heights(scene: Scene) -> np.ndarray:
    import numpy as np

    return np.linspace(scene.domain.bottom, scene.domain.ceiling, SAMPLES)


def _speed_past_grain(scene: Scene, placement: Placement) -> float:
    """The largest of the speeds of the given flow over the grain's height and of the grain's own."""
    import numpy as np

    from .stream import column, undisturbed

    grain = scene.grain
    assert grain is not None
    heights = placement.centre[scene.up] + 0.5 * grain.size * np.linspace(-1.0, 1.0, SAMPLES)
    points = column(scene, placement.centre, heights)
    times = np.linspace(0.0, scene.time.end, SAMPLES) if scene.time else np.zeros(1)
    stream = undisturbed(scene)
    return max(float(max(np.abs(stream(points, t)).max() for t in times)), _own_speed(scene, times))


def _own_speed(scene: Scene, times: np.ndarray) -> float:
    """Estimated speed of the grain itself: prescribed, initial, or settling (Stokes, capped by free fall)."""
    import numpy as np

    from ..scene.expression import expressions

    body, grain = scene.body, scene.grain
    if body is None or grain is None or not body.moves:
        return 0.0
    if body.course is not None:
        course = expressions(body.course, "body.course")
        origin = np.zeros((3, 1))
        velocities = np.abs([[float(one(origin, float(t))[0]) for one in course] for t in times])
        turning = 3 if scene.gdim == 3 else 1
        weights = np.concatenate([np.ones(scene.gdim), np.full(turning, 0.5 * grain.size)])
        return float((velocities @ weights).max())
    drive = abs((scene.density or 0.0) - 1.0) * float(abs(scene.gravity_vector).max())
    settling = min(drive * grain.size**2 / (18.0 * scene.viscosity), math.sqrt(drive * grain.size))
    spin = float(np.linalg.norm(body.spin))
    return max(settling, math.hypot(*body.velocity), 0.5 * grain.size * spin)


def _bed_reynolds(scene: Scene) -> float | None:
    """Reynolds number of the bed's forms, by the given flow up to their height above its datum; None for a plane."""
    import numpy as np

    from .stream import column, undisturbed

    bed, domain = scene.bed_shape, scene.domain
    if bed is None:
        return None
    heights = bed.height(_along_bed(scene))
    relief = float(heights.max() - heights.min())
    if relief == 0.0:
        return None
    levels = scene.datum + np.linspace(0.0, relief, SAMPLES)
    points = column(scene, domain.entrance, levels)
    return float(np.abs(undisturbed(scene)(points, 0.0)).max()) * relief / scene.viscosity


def _along_bed(scene: Scene) -> np.ndarray:
    """Abscissae (n,) at which the bed is looked at; in space points (n, 2)."""
    import numpy as np

    domain = scene.domain
    x = np.linspace(domain.left, domain.right, 20 * SAMPLES)
    if scene.gdim == 2:
        return x
    y = np.linspace(*domain.across, 2 * SAMPLES)
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def _wall_distance(scene: Scene) -> float:
    """From the grain to the next wall above or below, in grain sizes; without one, the height of the domain."""
    grain, placement, domain = scene.grain, scene.placement, scene.domain
    assert grain is not None and placement is not None
    if scene.rests:
        return 0.0
    y, distances = placement.centre[scene.up], [domain.height]
    bounded = domain.kind == "box" or scene.top == "wall" or scene.flow.kind in ("open-channel", "log-law")
    if scene.bed is not None or bounded:
        distances.append(y - scene.datum)
    if scene.top == "wall":
        distances.append(domain.ceiling - y)
    return max(min(distances) / grain.size - 0.5, 0.0)


def percent(share: float) -> str:
    """0.00075 as 0.08%."""
    return f"{100 * share:.1g}%" if share < 0.1 else f"{100 * share:.0f}%"
