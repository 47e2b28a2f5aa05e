"""What enters a scene with turbulence, velocity, k and epsilon, and the conditions of its flow."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from types import SimpleNamespace

import numpy as np
import ufl

from ..fluid.conditions import Condition, Friction, Open, Prescribed, Slip
from ..meshes import SYMMETRY
from ..scene import Turbulence
from .cells import CLOSED
from .flow_setup import Setup
from .measured_profile import Measured
from .wall_law import SAMPLES
from .wall_layer import LayeredWalls

SAMPLES_OF_DUCT = 300  # on each side of a section
Profile = Callable[..., np.ndarray]  # of heights (n,), and y (n,) if there are side walls


@dataclass(frozen=True)
class EnteringTurbulence:
    """Speed, k and epsilon at heights (n,), between side walls also at y (n,); functions that return (n,)."""

    speed: Profile
    energy: Profile
    dissipation: Profile


def entering(walls: LayeredWalls, asked: Turbulence) -> EnteringTurbulence:
    """What enters between walls, its mean velocity over the whole height being the flow's. Not collective.

    "developed": the logarithmic law, k of Nezu & Nakagawa (1993, Turbulence in Open-Channel Flows), 4.78 u*^2
    exp(-2 y/h), not above its equilibrium at the wall, and Nikuradse's mixing length (Schlichting & Gersten 2017,
    Boundary-Layer Theory, section 17.1). "given": a uniform flow of given intensity and length. "profile": see
    `Measured`.
    """
    if asked.inflow == "profile":
        found = Measured.of(walls, asked.profile, asked.intensity, asked.length, asked.c_mu)
        parts = found.speed, found.energy, found.dissipation
        return EnteringTurbulence(*(partial(_at_height, part) for part in parts))
    c_mu, reach, mean, places = asked.c_mu, walls.reach, walls.mean, inflow_places(walls)
    law = partial(walls.law.velocity, walls.shear_velocity, walls.viscosity)
    in_mesh = _mean_in_mesh(walls)
    if asked.inflow == "given":
        assert asked.intensity is not None and asked.length is not None
        energy = 1.5 * (asked.intensity * mean) ** 2
        loss = c_mu**0.75 * energy**1.5 / asked.length
        return EnteringTurbulence(*(partial(_uniform, value) for value in (in_mesh, energy, loss)))
    scale = in_mesh / float(np.mean(law(walls.from_next(*places))))

    def energy_at(*place: np.ndarray) -> np.ndarray:
        most = 1.0 / math.sqrt(c_mu)
        falling = 4.78 * np.exp(-2.0 * walls.from_next(*place) / reach)
        return walls.shear_velocity**2 * np.minimum(falling, most)

    def dissipation_at(*place: np.ndarray) -> np.ndarray:
        inwards = 1.0 - walls.from_next(*place) / reach
        length = reach * (0.14 - 0.08 * inwards**2 - 0.06 * inwards**4)
        return c_mu**0.75 * energy_at(*place) ** 1.5 / length

    return EnteringTurbulence(
        lambda *place: scale * law(walls.from_next(*place)), energy_at, dissipation_at
    )


def section_of_mesh(walls: LayeredWalls) -> tuple[tuple[float, float], tuple[float, float]]:
    """The extent of the mesh's inflow in height and, between side walls, across; else from 0 to 1."""
    low, sides = walls.floor + walls.distance, walls.sides
    across = (sides[0] + walls.distance, sides[1] - walls.distance) if sides else (0.0, 1.0)
    return (low, walls.ceiling), across


def inflow_places(walls: LayeredWalls) -> tuple[np.ndarray, ...]:
    """Heights and, between side walls, y of points (n,) that stand for equal parts of the inflow of the mesh."""
    (low, high), (right, left) = section_of_mesh(walls)
    if not walls.sides:
        return (low + (high - low) * (np.arange(SAMPLES) + 0.5) / SAMPLES,)
    parts = (np.arange(SAMPLES_OF_DUCT) + 0.5) / SAMPLES_OF_DUCT
    height, across = np.meshgrid(low + (high - low) * parts, right + (left - right) * parts)
    return height.ravel(), across.ravel()


def _mean_in_mesh(walls: LayeredWalls) -> float:
    """Mean speed through the inflow of the mesh: what does not flow between it and the walls it stands off from."""
    (low, high), (right, left) = section_of_mesh(walls)
    beyond = walls.shear_velocity * walls.law.beyond(
        walls.shear_velocity, walls.viscosity, walls.distance
    )
    off = walls.distance if walls.plane and walls.sides else 0.0
    whole = walls.mean * walls.number * walls.depth * (left - right + 2.0 * off)
    layers = walls.beside * (left - right) + (2.0 * (high - low) if off else 0.0)
    return (whole - layers * beyond) / ((high - low) * (left - right))


def _uniform(value: float, height: np.ndarray, across: np.ndarray | None = None) -> np.ndarray:
    return np.full_like(height, value)


def _at_height(
    profile: Profile, height: np.ndarray, across: np.ndarray | None = None
) -> np.ndarray:
    return profile(height)


def logarithms(setup: Setup) -> Callable[[np.ndarray], np.ndarray]:
    """ln k and ln epsilon (2, n) at places (3, n) of the inflow. Not collective."""
    found, places = entering(setup.walls, setup.turbulence), _places(setup)
    return lambda x: np.log([found.energy(*places(x)), found.dissipation(*places(x))])


def velocity(setup: Setup) -> Callable[[np.ndarray, float], np.ndarray]:
    """The velocity (gdim, n) that enters at places (3, n). Not collective."""
    speed, places, up = (
        entering(setup.walls, setup.turbulence).speed,
        _places(setup),
        setup.geometry.up,
    )
    return lambda x, t: np.vstack([speed(*places(x)), *np.zeros((up, x.shape[1]))])


def _places(setup: Setup) -> Callable[[np.ndarray], tuple[np.ndarray, ...]]:
    """What profiles take of places (3, n): heights, between side walls y as well."""
    axes = (setup.geometry.up, 1) if setup.walls.sides else (setup.geometry.up,)
    return lambda x: tuple(x[axis] for axis in axes)


def conditions(setup: Setup) -> list[Condition]:
    """Boundary conditions of a turbulent flow. Not collective."""
    walls, names, sides, geometry = setup.walls, setup.walls.names, setup.sides, setup.geometry
    functions = SimpleNamespace(log=ufl.ln, larger=ufl.max_value, sin=ufl.sin, cos=ufl.cos)
    drag = partial(walls.law.drag, functions=functions)
    axes = {sides.top: geometry.up}
    if walls.plane:
        axes = dict.fromkeys(names, geometry.up) | dict.fromkeys(sides.across, 1)
    rubbing: list[Condition] = [
        Friction(
            *(name, walls.distance, drag, axes.get(name)), moves=name == "body" and geometry.moves
        )
        for name in (*names, *(CLOSED if setup.scene.closes_contacts else ()))
    ]
    lids: list[Condition] = [] if sides.top in names else [Slip(sides.top, axis=geometry.up)]
    lids += [Slip(name, axis=1) for name in sides.across if name not in names]
    lids += [Slip(SYMMETRY, axis=1)] if geometry.symmetric else []
    return [Open(sides.right), *rubbing, *lids, Prescribed(sides.left, velocity(setup))]
