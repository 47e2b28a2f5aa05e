"""A measured profile of speed, and k if known, between walls, with a law of the wall next to them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

Rows = tuple[tuple[float, ...], ...]


class Between(Protocol):
    """What a profile lies between: walls with a law of velocities next to them, see `wall_layer.LayeredWalls`."""

    @property
    def law(self) -> Any:
        """The law: `kappa`, `velocity` and `shear_velocity`, see `wall_law.WallLaw`."""

    @property
    def viscosity(self) -> float:
        """Kinematic viscosity."""

    @property
    def mean(self) -> float:
        """Reference velocity."""

    @property
    def depth(self) -> float:
        """Over which a wall is felt."""

    @property
    def number(self) -> int:
        """Number of walls above each other, one or two."""

    @property
    def floor(self) -> float:
        """Height of the lower wall."""

    @property
    def ceiling(self) -> float:
        """Height at which the mesh ends on top."""

    @property
    def distance(self) -> float:
        """Distance from walls at which the mesh ends."""


@dataclass(frozen=True)
class Measured:
    """A profile given by rows, and the law of the wall between them and the walls.

    Speeds are cubic in the logarithm of the height and monotone where the rows are. Where k is not given it is in
    equilibrium with the mixing length l, l^2 (du/dy)^2/C_mu^(1/2), and that of the least intensity is added; l is kappa
    times the distance from the next wall, at most the one given. Heights are those over which the mesh extends: where
    it ends at a wall itself they are stretched to begin a distance of the law above it.
    """

    walls: Between
    rows: np.ndarray
    c_mu: float
    length: float
    least: float

    @classmethod
    def of(
        cls, walls: Between, rows: Rows, intensity: float | None, length: float | None, c_mu: float
    ) -> Measured:
        """The profile between walls by rows of height and speed, and k if known, over the reference velocity.

        intensity: at least; length: mixing length at most. Not collective.
        """
        mean = walls.mean
        assert intensity is not None and length is not None
        scaled = np.array(rows) * np.array([1.0, mean, mean**2])[: len(rows[0])]
        return cls(walls, scaled, c_mu, length, 1.5 * (intensity * mean) ** 2)

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
        return np.asarray(
            self.c_mu**0.75 * self.energy(height) ** 1.5 / self._mixing_length(height)
        )

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
            walls.distance + (height - low) / (walls.ceiling - low) * whole,
            walls.distance,
            self._between,
        )

    def _mixing_length(self, height: np.ndarray) -> np.ndarray:
        above = self.above(height)
        away = np.minimum(above, self._between - above) if self.walls.number == 2 else above
        return np.minimum(self.walls.law.kappa * np.maximum(away, self.walls.distance), self.length)

    def _speed_and_slope(self, height: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Speeds and their slopes (n,)."""
        from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

        above, law, walls = self.above(height), self.walls.law, self.walls.number
        y, u = self.rows[:, 0], self.rows[:, 1]
        ends = np.array([y[0], self._between - y[-1]])[
            :walls
        ]  # distances of the rows next to walls
        found = law.shear_velocity(u[[0, -1][:walls]], self.walls.viscosity, ends)
        first, last = found[0], found[-1]
        slopes = PchipInterpolator(np.log(y), u).derivative()(np.log(y))
        slopes[0] = first / law.kappa
        slopes[-1] = -last / law.kappa * y[-1] / ends[-1] if walls == 2 else 0.0
        between = CubicHermiteSpline(np.log(y), u, slopes)
        within = np.log(np.clip(above, y[0], y[-1]))
        down = np.maximum(self._between - above, self.walls.distance)
        near, far = above < y[0], above > y[-1]
        upper = (law.velocity(last, self.walls.viscosity, down) * last, last / (law.kappa * down))
        if walls == 1:
            upper = (np.full_like(above, u[-1]), np.zeros_like(above))
        lower = (
            law.velocity(first, self.walls.viscosity, above) * first,
            first / (law.kappa * above),
        )
        inner = (between(within), np.abs(between(within, 1)) / above)
        return tuple(
            np.where(near, low, np.where(far, high, middle))
            for low, high, middle in zip(lower, upper, inner, strict=True)
        )  # type: ignore[return-value]
