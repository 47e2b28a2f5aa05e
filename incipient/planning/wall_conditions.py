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
from ..meshes.solid_region import SYMMETRY
from ..scene import Turbulence
from .cells import CLOSED
from .flow_setup import Setup
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
        found = Measured.of(walls, asked)
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

    return EnteringTurbulence(lambda *place: scale * law(walls.from_next(*place)), energy_at, dissipation_at)


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
    beyond = walls.shear_velocity * walls.law.beyond(walls.shear_velocity, walls.viscosity, walls.distance)
    off = walls.distance if walls.plane and walls.sides else 0.0
    whole = walls.mean * walls.number * walls.depth * (left - right + 2.0 * off)
    layers = walls.beside * (left - right) + (2.0 * (high - low) if off else 0.0)
    return (whole - layers * beyond) / ((high - low) * (left - right))


@dataclass(frozen=True)
class Measured:
    """A profile given by rows, and the law of the wall between them and the walls.

    Speeds are cubic in the logarithm of the height and monotone where the rows are. Where k is not given it is in
    equilibrium with the mixing length l, l^2 (du/dy)^2/C_mu^(1/2), and that of the least intensity is added; l is kappa
    times the distance from the next wall, at most the one given. Heights are those over which the mesh extends: where
    it ends at a wall itself they are stretched to begin a distance of the law above it.
    """

    walls: LayeredWalls
    rows: np.ndarray
    c_mu: float
    length: float
    least: float

    @classmethod
    def of(cls, walls: LayeredWalls, asked: Turbulence) -> Measured:
        """The profile that a section gives between walls, in units of the scene. Not collective."""
        mean = walls.mean
        assert asked.intensity is not None and asked.length is not None
        rows = np.array(asked.profile) * np.array([1.0, mean, mean**2])[: len(asked.profile[0])]
        least = 1.5 * (asked.intensity * mean) ** 2
        return cls(walls, rows, asked.c_mu, asked.length, least)

    def speed(self, height: np.ndarray) -> np.ndarray:
        """Speeds (n,) at heights (n,) in the scene."""
        return self._speed_and_slope(height)[0]

    def energy(self, height: np.ndarray) -> np.ndarray:
        """k (n,) at heights (n,) in the scene."""
        if self.rows.shape[1] == 3:
            return np.interp(self.above(height), self.rows[:, 0], self.rows[:, 2]) + self.least
        slope = self._speed_and_slope(height)[1]
        return (self._mixing_length(height) * slope) ** 2 / math.sqrt(self.c_mu) + self.least

    def dissipation(self, height: np.ndarray) -> np.ndarray:
        """epsilon (n,) at heights (n,) in the scene."""
        return np.asarray(self.c_mu**0.75 * self.energy(height) ** 1.5 / self._mixing_length(height))

    @property
    def _between(self) -> float:
        """Height between the walls that the rows are measured between."""
        return self.walls.number * self.walls.depth

    def above(self, height: np.ndarray) -> np.ndarray:
        """Heights (n,) above the wall, as they were measured."""
        walls = self.walls
        low = walls.floor + walls.distance
        whole = self._between - walls.number * walls.distance
        return np.clip(
            walls.distance + (height - low) / (walls.ceiling - low) * whole, walls.distance, self._between
        )

    def _mixing_length(self, height: np.ndarray) -> np.ndarray:
        above = self.above(height)
        away = np.minimum(above, self._between - above) if self.walls.number == 2 else above
        return np.minimum(self.walls.law.kappa * np.maximum(away, self.walls.distance), self.length)

    def _speed_and_slope(self, height: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Speeds and their slopes (n,)."""
        from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

        above, law = self.above(height), self.walls.law
        y, u = self.rows[:, 0], self.rows[:, 1]
        ends = np.array([y[0], self._between - y[-1]])
        first, last = law.shear_velocity(u[[0, -1]], self.walls.viscosity, ends)
        slopes = PchipInterpolator(np.log(y), u).derivative()(np.log(y))
        slopes[0] = first / law.kappa
        slopes[-1] = -last / law.kappa * y[-1] / ends[1] if self.walls.number == 2 else 0.0
        between = CubicHermiteSpline(np.log(y), u, slopes)
        within = np.log(np.clip(above, y[0], y[-1]))
        down = np.maximum(self._between - above, self.walls.distance)
        near, far = above < y[0], above > y[-1]
        upper = (law.velocity(last, self.walls.viscosity, down) * last, last / (law.kappa * down))
        if self.walls.number == 1:
            upper = (np.full_like(above, u[-1]), np.zeros_like(above))
        lower = (law.velocity(first, self.walls.viscosity, above) * first, first / (law.kappa * above))
        inner = (between(within), np.abs(between(within, 1)) / above)
        return tuple(
            np.where(near, low, np.where(far, high, middle))
            for low, high, middle in zip(lower, upper, inner, strict=True)
        )  # type: ignore[return-value]


def _uniform(value: float, height: np.ndarray, across: np.ndarray | None = None) -> np.ndarray:
    return np.full_like(height, value)


def _at_height(profile: Profile, height: np.ndarray, across: np.ndarray | None = None) -> np.ndarray:
    return profile(height)


def logarithms(setup: Setup) -> Callable[[np.ndarray], np.ndarray]:
    """ln k and ln epsilon (2, n) at places (3, n) of the inflow. Not collective."""
    found, places = entering(setup.walls, setup.turbulence), _places(setup)
    return lambda x: np.log([found.energy(*places(x)), found.dissipation(*places(x))])


def velocity(setup: Setup) -> Callable[[np.ndarray, float], np.ndarray]:
    """The velocity (gdim, n) that enters at places (3, n). Not collective."""
    speed, places, up = entering(setup.walls, setup.turbulence).speed, _places(setup), setup.geometry.up
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
        Friction(*(name, walls.distance, drag, axes.get(name)), moves=name == "body" and geometry.moves)
        for name in (*names, *(CLOSED if setup.scene.closes_contacts else ()))
    ]
    lids: list[Condition] = [] if sides.top in names else [Slip(sides.top, axis=geometry.up)]
    lids += [Slip(name, axis=1) for name in sides.across if name not in names]
    lids += [Slip(SYMMETRY, axis=1)] if geometry.symmetric else []
    return [Open(sides.right), *rubbing, *lids, Prescribed(sides.left, velocity(setup))]
