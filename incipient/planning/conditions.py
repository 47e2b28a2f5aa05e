"""The boundary conditions of a scene's flow: a kind for each boundary, in 2-D and 3-D, at walls and free surfaces."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from types import SimpleNamespace

import numpy as np
import ufl

from ..arrays import Floats
from ..fluid.conditions import (
    Carried,
    Condition,
    Entering,
    FreeSurface,
    Friction,
    Open,
    Prescribed,
    Slip,
    Sponge,
    Velocity,
    no_slip,
)
from ..meshes import SYMMETRY
from ..setup.geometry import CLOSED, initial_state
from ..setup.setup import Setup
from .discretisation import LEVEL, far_cell, velocity_order

UFL = SimpleNamespace(log=ufl.ln, larger=ufl.max_value, sin=ufl.sin, cos=ufl.cos, sqrt=ufl.sqrt)
# Kinds that override others where boundaries meet: prescribed velocities, then walls, so that corners are watertight.
LATER = {"flow": 1, "inflow": 1, "wall": 2}


def conditions(setup: Setup, initial: bool = False, speed: float = 1.0) -> list[Condition]:
    """Boundary conditions in the order in which they override each other.

    In the `initial` flow a rigid lid replaces a free surface, and a grain has its first velocity, which within time
    steps follows from its motion. With `speed` the flow is faster by that factor, in its own units.
    """
    scene, sides, flow = setup.scene, setup.sides, setup.base_flow_at(speed)
    axes = {sides.left: 0, sides.right: 0, sides.bottom: scene.up, sides.top: scene.up}
    entering = setup.mean_inflow if scene.is_averaged else flow.entering
    make: dict[str, Callable[[str], Condition]] = {
        "wall": no_slip,
        "slip": lambda name: Slip(name, axes.get(name, 1)),
        "friction": lambda name: _friction(setup, name),
        "flow": lambda name: Prescribed(name, flow.velocity),
        "inflow": lambda name: Prescribed(name, entering),
        "discharge": lambda name: _discharge(setup, name),
        # A flow that reverses enters through this end, and without its momentum energy comes from nowhere.
        "outflow": lambda name: Open(name, flow.velocity if scene.flow.changes else None),
        "free surface": lambda name: _free_surface(setup, name),
        "moving": Carried,
        "held": lambda name: Prescribed(name, _velocity_of_grain(setup)),
    }
    kinds = _kinds(setup, initial)
    return [make[kinds[name]](name) for name in sorted(kinds, key=lambda n: LATER.get(kinds[n], 0))]


def _kinds(setup: Setup, initial: bool) -> dict[str, str]:
    """The kind of condition at each boundary."""
    scene, sides, flow, surface = setup.scene, setup.sides, setup.scene.flow, setup.surface
    wall, free = "friction" if scene.is_averaged else "wall", scene.has_surface and not initial
    of_sides = {"wall": wall, "slip": "slip", "stream": "flow"}
    of_sides["free-surface"] = "free surface" if free else "slip"
    is_box = scene.domain.kind == "box"
    walled = is_box or scene.top in ("wall", "free-surface") or flow.wall_below
    bottom = wall if walled or scene.bed is not None else "flow"
    if is_box:
        left = right = "slip" if scene.has_surface else wall
    elif free:
        left, right = "discharge", "outflow" if surface.outflow == "open" else "slip"
    else:
        left, right = "inflow", "inflow" if flow.oscillates else "outflow"
    kinds = {
        sides.bottom: "slip" if surface.bottom == "slip" else bottom,
        sides.top: "flow" if flow.moves_top else of_sides[scene.top],
        **dict.fromkeys(sides.across, of_sides[scene.sides]),
        **dict.fromkeys([SYMMETRY] if setup.symmetric else (), "slip"),
        sides.left: left,
        sides.right: right,
    }
    if scene.grain is not None:
        carried = scene.moves and not scene.is_averaged
        kinds["body"] = wall if not carried else "held" if initial else "moving"
    return kinds | dict.fromkeys(CLOSED if scene.closes_contacts else (), wall)


def _velocity_of_grain(setup: Setup) -> Velocity:
    from ..body.state import rigid_velocity

    scene = setup.scene
    assert scene.body is not None and scene.placement is not None
    state = initial_state(scene.body, scene.placement, setup.symmetric)
    return lambda x, t: rigid_velocity(state, x[: scene.gdim].T).T


def _friction(setup: Setup, name: str) -> Friction:
    walls, scene = setup.walls, setup.scene
    return Friction(
        name,
        distance=walls.slip(name),
        drag=partial(walls.law(name).drag, functions=UFL),
        axis=scene.up if walls.is_beyond(name) else None,
        moves=name == "body" and scene.moves,
    )


# -- free surface -----------------------------------------------------------------------------------


def _free_surface(setup: Setup, name: str) -> FreeSurface:
    scene, domain, length = setup.scene, setup.scene.domain, setup.surface.sponge
    gravity, sponge = tuple(scene.gravity_vector.tolist()), None
    if length > 0.0:
        # A wave of speed c loses exp(-s x/(2 c)) of its height, with s a third of the rate at the end, on average. A
        # long wave that runs to the end and back keeps exp(-5).
        rate = 3.0 * 5.0 * math.sqrt(abs(gravity[scene.up]) * domain.height) / length
        sponge = Sponge(domain.right - length, domain.right, rate, setup.base_flow.velocity)
    # The pressure without the hydrostatic part is zero where the still level meets the right end.
    origin = (domain.right, *((domain.middle,) if scene.gdim == 3 else ()), domain.ceiling)
    return FreeSurface(name, gravity, origin, setup.pinned_sides, sponge)


def _discharge(setup: Setup, name: str) -> Entering:
    """The inflow of a channel with a free surface: base flow and wave over the present depth."""
    from ..setup.waves import wave_of

    scene, base_flow, wave = setup.scene, setup.base_flow, wave_of(setup)
    largest = scene.numerics.mesh_size * far_cell(scene, velocity_order(setup)[0])
    level = max(LEVEL * scene.domain.height, largest)
    supercritical = (setup.numbers.froude or 0.0) >= 1.0
    if wave is None:
        return Entering(name, 0, lambda x, t: base_flow.entering(x, t)[0], level, supercritical)
    left, up, datum = scene.domain.left, scene.up, base_flow.datum

    def velocity(x: Floats, t: float) -> Floats:
        total = base_flow.entering(x, t)
        total[[0, up]] += wave.velocity(x[0] - left, x[up] - datum, t)
        return total

    def over_depth(x: Floats, t: float) -> Floats:
        """Velocity along the channel below the wave, weighted by the area of the initial mesh."""
        deeper, places = 1.0 + wave.elevation(np.zeros(1), t)[0] / wave.depth, x.copy()
        places[0], places[up] = left, datum + (x[up] - datum) * deeper
        return np.asarray(velocity(places, t)[0] * deeper)

    return Entering(
        *(name, 0, over_depth, level, supercritical, velocity),
        elevation=lambda x, t: wave.elevation(x[0] - left, t),
    )
