"""Inflow between walls: developed, or measured, with a law of the wall next to the walls."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

from ..arrays import Floats
from ..forms.k_omega_sst import BETA_STAR, INNER
from ..scene import Turbulence
from .developed import DevelopedChannel
from .wall_law import CROSSING, WallLaw, smooth_profile

if TYPE_CHECKING:
    from .walls import Walls

SAMPLES = 2000  # of heights for a mean
DAMPING = 26.0  # wall units: van Driest (1956, J. Aeronaut. Sci. 23, 1007)
# A uniform flow: distance from walls where it begins, over the depth; rows from there, whose distances grow, so that
# speeds between them overshoot by less than 1%.
LAYER, ROWS, GROWTH = 0.05, 9, 1.3


@dataclass(frozen=True)
class Developed:
    """Developed flow between one or two walls, each with a depth and a u*."""

    channel: DevelopedChannel
    depth: float
    number: int
    shear_velocity: float

    def _away(self, above: Floats) -> Floats:
        away = np.minimum(above, 2.0 * self.depth - above) if self.number == 2 else above
        return np.asarray(np.clip(away / self.depth, 0.0, 1.0))

    def speed(self, above: Floats) -> Floats:
        """Speeds (n,) at heights (n,) above the lower wall."""
        return self.shear_velocity * np.asarray(self._speed(self._away(above)))

    @cached_property
    def _speed(self) -> Any:
        return PchipInterpolator(self.channel.heights, self.channel.speed)

    def turbulence(self, above: Floats) -> tuple[Floats, Floats]:
        """k and omega (n,) at heights (n,) above the lower wall."""
        k, omega = np.exp(self.channel.logarithms(self._away(above)))
        return self.shear_velocity**2 * k, self.shear_velocity / self.depth * omega


@dataclass(frozen=True)
class Measured:
    """A profile given as rows, with the law of the wall between them and the walls.

    Speeds are cubic in the logarithm of the height and monotone where the rows are. Where k is not given it is in
    equilibrium with the mixing length l, l^2 (du/dy)^2/C_mu^(1/2), plus the minimum intensity; l is kappa times the
    wall distance, at most the given one. omega is k^(1/2)/(C_mu^(1/4) l), next to walls, where k has van Driest's
    damping, that of the viscous sublayer.

    rows: (n, 2) or (n, 3) of height, speed and k; depth: of each of `number` walls; law: of the walls
    """

    rows: Floats
    depth: float
    number: int
    viscosity: float
    law: WallLaw
    length: float
    least: float

    @classmethod
    def of(
        cls, asked: Turbulence, number: int, depth: float, mean: float, viscosity: float
    ) -> Measured:
        assert asked.intensity is not None and asked.length is not None
        rows = np.array(asked.profile or _uniform(number, depth))
        scaled = rows * np.array([1.0, mean, mean**2])[: rows.shape[1]]
        law = WallLaw(asked.upstream_roughness or asked.roughness)
        least = 1.5 * (asked.intensity * mean) ** 2
        return cls(scaled, depth, number, viscosity, law, asked.length, least)

    @cached_property
    def shear_velocities(self) -> Floats:
        """u* (number,) at the lower and the upper wall from the speed of the next row."""
        places = [0, -1][: self.number]
        ends = self._ends[: self.number]
        return np.asarray(self.law.shear_velocity(self.rows[places, 1], self.viscosity, ends))

    @property
    def _whole(self) -> float:
        return self.number * self.depth

    @property
    def _ends(self) -> Floats:
        y = self.rows[:, 0]
        return np.array([y[0], self._whole - y[-1]])

    def speed(self, above: Floats) -> Floats:
        return self._speed_and_slope(above)[0]

    def turbulence(self, above: Floats) -> tuple[Floats, Floats]:
        away = np.minimum(above, self._whole - above) if self.number == 2 else above
        length = np.minimum(self.law.kappa * away, self.length)
        damped = -np.expm1(-away * self.shear_velocities.max() / self.viscosity / DAMPING)
        if self.rows.shape[1] == 3:
            k = np.interp(above, self.rows[:, 0], self.rows[:, 2])
        else:
            k = (length * self._speed_and_slope(above)[1]) ** 2 / math.sqrt(BETA_STAR)
        k = (k + self.least) * damped**2
        smooth = not self.law.roughness
        in_sublayer = smooth * 6.0 * self.viscosity / (INNER[2] * away**2)
        return k, np.hypot(np.sqrt(k) / (BETA_STAR**0.25 * length), in_sublayer)

    def _speed_and_slope(self, above: Floats) -> tuple[Floats, Floats]:
        law, (y, u) = self.law, self.rows[:, :2].T
        first, last = self.shear_velocities[0], self.shear_velocities[-1]
        slopes = PchipInterpolator(np.log(y), u).derivative()(np.log(y))
        slopes[0] = first / law.kappa
        slopes[-1] = -last / law.kappa * y[-1] / self._ends[1] if self.number == 2 else 0.0
        between = CubicHermiteSpline(np.log(y), u, slopes)
        within = np.log(np.clip(above, y[0], y[-1]))
        speed, slope = between(within), np.abs(between(within, 1)) / above
        near, far = above < y[0], above > y[-1]
        speed[near], slope[near] = self._at_wall(float(first), above[near], self._ends[0])
        slope[far] = 0.0
        if self.number == 2:
            speed[far], slope[far] = self._at_wall(
                float(last), self._whole - above[far], self._ends[1]
            )
        return speed, slope

    def _at_wall(self, shear_velocity: float, away: Floats, end: float) -> tuple[Floats, Floats]:
        """Speeds and slopes (n,) by the law of the wall, the next row being a distance `end` from it.

        Next to smooth walls they are Reichardt's, scaled to the law there: with the slope of the viscous sublayer up to
        y+ = 11 eddies would exert eight times the shear stress, and k would grow from the inflow on.
        """
        if not self.law.roughness:
            unit = self.viscosity / shear_velocity
            speed, slope = smooth_profile(away / unit)
            law = self.law.velocity(shear_velocity, self.viscosity, end)
            scale = shear_velocity * law / smooth_profile(end / unit)[0]
            return scale * speed, scale / unit * slope
        speed = shear_velocity * self.law.velocity(shear_velocity, self.viscosity, away)
        in_sublayer = away * shear_velocity < CROSSING * self.viscosity
        outer = shear_velocity / (self.law.kappa * away)
        return speed, np.where(in_sublayer, shear_velocity**2 / self.viscosity, outer)


def _uniform(number: int, depth: float) -> list[tuple[float, float]]:
    near, whole = LAYER * depth * GROWTH ** np.arange(ROWS), number * depth
    far = whole - near[::-1] if number == 2 else [whole]
    return [(float(height), 1.0) for height in (*near, *far)]


@dataclass(frozen=True)
class Inflow:
    """Inflow of a mesh, as a function of the height between the walls."""

    walls: Walls
    profile: Developed | Measured

    def _above(self, height: Floats) -> Floats:
        """Heights (n,) above the lower wall, stretched to the end of the mesh past grains and bedforms."""
        walls, slip = self.walls, self.walls.slip(self.walls.names[0])
        low = walls.datum + (slip if walls.plane else 0.0)
        whole = walls.number * walls.depth
        high = whole - (walls.top - walls.ceiling)
        above = slip + (height - low) / (walls.ceiling - low) * (high - slip)
        return np.asarray(np.clip(above, slip, high))

    @cached_property
    def _scale(self) -> float:
        """Factor of speeds for the whole discharge, including plane wall layers, to pass the mesh."""
        walls, parts = self.walls, (np.arange(SAMPLES) + 0.5) / SAMPLES
        if walls.asked.profile:
            return 1.0
        slip, whole = walls.slip(walls.names[0]), walls.number * walls.depth
        high = whole - (walls.top - walls.ceiling)
        inside = self.profile.speed(slip + (high - slip) * parts).mean()
        inside *= walls.ceiling - walls.datum - (slip if walls.plane else 0.0)
        beyond = 0.0
        for name in filter(walls.is_beyond, walls.names):
            y, u = walls.distance(name), walls.shear_velocity
            beyond += y * u * float(walls.law(name).velocity(u, walls.viscosity, y * parts).mean())
        return float((walls.mean * whole - beyond) / inside)

    def _velocity(self, above: Floats) -> Floats:
        speed = self._scale * self.profile.speed(above)
        return np.vstack([speed, *np.zeros((self.walls.up, len(speed)))])

    def _logarithms(self, above: Floats) -> Floats:
        k, omega = self.profile.turbulence(above)
        k = np.maximum(k, self.walls.least_k)
        loss = self.walls.asked.c_mu * k * omega
        second = loss if self.walls.asked.model == "k-epsilon" else omega
        return np.log([k, second])

    def velocity(self, x: Floats) -> Floats:
        """Velocity (gdim, n) at positions (3, n); below the datum that at it."""
        return self._velocity(self._above(x[self.walls.up]))

    def logarithms(self, x: Floats) -> Floats:
        """Logarithms of k and epsilon or omega (2, n) at positions (3, n)."""
        walls = self.walls
        high = walls.number * walls.depth - (walls.number - 1) * walls.nearest
        return self._logarithms(np.clip(self._above(x[walls.up]), walls.nearest, high))

    def velocity_at(self, away: Floats) -> Floats:
        """Velocity (gdim, n) at distances (n,) from the nearest wall boundary."""
        walls = self.walls
        return self._velocity(np.minimum(away + walls.slip(walls.names[0]), walls.depth))

    def logarithms_at(self, away: Floats) -> Floats:
        """Logarithms (2, n) at distances (n,) from the nearest wall boundary."""
        return self._logarithms(np.minimum(away + self.walls.smooth, self.walls.depth))
