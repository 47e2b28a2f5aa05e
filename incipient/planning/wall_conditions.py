"""The inflow of a scene with turbulence (velocity, k and epsilon), and its boundary conditions."""

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

Profile = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class EnteringTurbulence:
    """Speed, k and epsilon at heights (n,); functions that return (n,)."""

    speed: Profile
    energy: Profile
    dissipation: Profile


def entering(walls: LayeredWalls, asked: Turbulence) -> EnteringTurbulence:
    """The inflow between walls, its mean velocity over the whole height being the flow's. Not collective.

    "developed": the logarithmic law, k of Nezu & Nakagawa (1993, Turbulence in Open-Channel Flows), 4.78 u*^2
    exp(-2 y/h), not above its equilibrium at the wall, and Nikuradse's mixing length (Schlichting & Gersten 2017,
    Boundary-Layer Theory, section 17.1). "given": a uniform flow of given intensity and length. "profile": see
    `Measured`.
    """
    if asked.inflow == "profile":
        found = Measured.of(walls, asked.profile, asked.intensity, asked.length, asked.c_mu)
        return EnteringTurbulence(found.speed, found.energy, found.dissipation)
    c_mu, depth, mean = asked.c_mu, walls.depth, walls.mean
    law = partial(walls.law.velocity, walls.shear_velocity, walls.viscosity)
    in_mesh = _mean_in_mesh(walls)
    if asked.inflow == "given":
        assert asked.intensity is not None and asked.length is not None
        energy = 1.5 * (asked.intensity * mean) ** 2
        loss = c_mu**0.75 * energy**1.5 / asked.length
        return EnteringTurbulence(
            *(partial(np.full_like, fill_value=value) for value in (in_mesh, energy, loss))
        )
    scale = in_mesh / float(np.mean(law(walls.from_next(inflow_places(walls)))))

    def energy_at(height: np.ndarray) -> np.ndarray:
        most = 1.0 / math.sqrt(c_mu)
        falling = 4.78 * np.exp(-2.0 * walls.from_next(height) / depth)
        return walls.shear_velocity**2 * np.minimum(falling, most)

    def dissipation_at(height: np.ndarray) -> np.ndarray:
        inwards = 1.0 - walls.from_next(height) / depth
        length = depth * (0.14 - 0.08 * inwards**2 - 0.06 * inwards**4)
        return c_mu**0.75 * energy_at(height) ** 1.5 / length

    return EnteringTurbulence(
        lambda height: scale * law(walls.from_next(height)), energy_at, dissipation_at
    )


def inflow_places(walls: LayeredWalls) -> np.ndarray:
    """Heights (n,) that stand for equal parts of the inflow of the mesh."""
    low, high = walls.floor + walls.distance, walls.ceiling
    return low + (high - low) * (np.arange(SAMPLES) + 0.5) / SAMPLES


def _mean_in_mesh(walls: LayeredWalls) -> float:
    """Mean speed through the inflow of the mesh: what does not flow between it and the walls it stands off from."""
    beyond = walls.shear_velocity * walls.law.beyond(
        walls.shear_velocity, walls.viscosity, walls.distance
    )
    whole = walls.mean * walls.number * walls.depth
    return (whole - walls.beside * beyond) / (walls.ceiling - walls.floor - walls.distance)


def logarithms(setup: Setup) -> Callable[[np.ndarray], np.ndarray]:
    """ln k and ln epsilon (2, n) at places (3, n) of the inflow. Not collective."""
    found, up = entering(setup.walls, setup.turbulence), setup.geometry.up
    return lambda x: np.log([found.energy(x[up]), found.dissipation(x[up])])


def velocity(setup: Setup) -> Callable[[np.ndarray, float], np.ndarray]:
    """The velocity (gdim, n) that enters at places (3, n). Not collective."""
    speed, up = entering(setup.walls, setup.turbulence).speed, setup.geometry.up
    return lambda x, t: np.vstack([speed(x[up]), *np.zeros((up, x.shape[1]))])


def conditions(setup: Setup) -> list[Condition]:
    """Boundary conditions of a turbulent flow. Not collective."""
    walls, names, sides, geometry = setup.walls, setup.walls.names, setup.sides, setup.geometry
    functions = SimpleNamespace(log=ufl.ln, larger=ufl.max_value, sin=ufl.sin, cos=ufl.cos)
    drag = partial(walls.law.drag, functions=functions)
    axes = {sides.top: geometry.up}
    if walls.plane:
        axes = dict.fromkeys(names, geometry.up)
    rubbing: list[Condition] = [
        Friction(
            *(name, walls.distance, drag, axes.get(name)), moves=name == "body" and geometry.moves
        )
        for name in (*names, *(CLOSED if setup.scene.closes_contacts else ()))
    ]
    lids: list[Condition] = [] if sides.top in names else [Slip(sides.top, axis=geometry.up)]
    lids += [Slip(name, axis=1) for name in sides.across]
    lids += [Slip(SYMMETRY, axis=1)] if geometry.symmetric else []
    return [Open(sides.right), *rubbing, *lids, Prescribed(sides.left, velocity(setup))]
