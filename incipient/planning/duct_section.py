"""A section of a duct, its equations by the k-omega SST model in finite volumes, and how they are solved.

The equations are those of `forms.k_omega_sst` for a velocity along the duct alone, in it and in ln k and ln omega, in
units of its mean V and of the depth h. The section is what lies next to one corner, between a side and the floor: half
of an open channel, a quarter of a closed duct. Each of both walls is smooth or rough.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix, diags
from scipy.sparse.linalg import splu

from ..arrays import Floats
from ..errors import ConvergenceError
from ..forms.k_omega_sst import (
    A_1,
    BETA_STAR,
    EXPONENT,
    INNER,
    LARGEST_ARGUMENT,
    LEAST_CROSS,
    LEAST_RATE,
    MOST_PRODUCED,
    OUTER,
    SIGMA_CROSS,
    at_rough_wall,
    at_smooth_wall,
    little_k,
    shear_velocity_at,
)
from .cells import RowSizes, growing_rows
from .developed_channel import FIRST_ON_SAND, NUMPY, length_at_sand, of_discharge

# Wall units up to which only molecules matter at a smooth wall: the first volume, by u* as estimated; and its largest
# size, over the extent.
FIRST, LARGEST_FIRST = 0.5, 0.02
# Volumes: the one behind it, over it; their growth with the distance from the wall; and the largest, over the extent.
NEXT, GROWTH, LARGEST = 0.1, 0.25, 0.08
LEAST = 1e-3  # k over u*^2 below which it is not destroyed: in corners its logarithm would fall for ever
STEP, STEP_GROWTH, CUT, LONGEST = 0.1, 3.0, 0.5, 1e9  # of pseudo-time, in h/V
MOST_STEPS, ENOUGH, STEADY = 200, 1e-7, 1e3  # STEADY: the shortest last step
LARGEST_CORRECTION, SMALL, LARGE = (
    0.7,
    1.0,
    3.0,
)  # of logarithms: applied; for longer steps; for shorter ones
AGAIN, NO_LESS = (
    0.5,
    0.9,
)  # part of a correction that is made; over the one before, from which on it is
SLIGHT = 1e-6  # by which unknowns are changed for derivatives
LEAST_SLOPE = 1e-6  # of the velocity at a rough wall, over that of what is estimated: u* there is the root of it
# What is in an equation lies within two steps along the grid: by (i + 5 j) mod 13 no two of these volumes are alike.
COLOURS, STRIDE, REACH = 13, 5, 2


class DuctSection:
    """The equations at one Reynolds number; arrays (n, m) by distance from the side and height.

    reynolds: V h/nu; half_width: over h
    sand:     equivalent sand roughness of the sides and of the floor, over h; 0: smooth
    coarse:   factor of the size of all volumes
    """

    def __init__(
        self, reynolds: float, half_width: float, sand: tuple[float, float], coarse: float = 1.0
    ):
        self.viscosity, self.sand = 1.0 / reynolds, sand
        self._radius = radius = half_width / (1.0 + half_width)
        self._channels = tuple(of_discharge(reynolds * radius, one / radius) for one in sand)
        units = [one.mean / reynolds for one in self._channels]  # nu/u* as estimated
        self.least = LEAST / (max(units) * reynolds) ** 2
        self._typical = tuple(1.0 / (one * reynolds) for one in units)  # u*
        self.first = first = min(FIRST * max(units), LARGEST_FIRST * min(half_width, 1.0))
        side, floor = (
            _ends_on_sand(one, one / unit, long, coarse) if one else _ends(first, long, coarse)
            for one, unit, long in zip(sand, units, (half_width, 1.0), strict=True)
        )
        self.ends = side, floor
        self.sizes = tuple(np.diff(one) for one in self.ends)
        self.volumes = np.outer(*self.sizes)
        self.middles = tuple(middles(one) for one in self.ends)
        self.away = np.minimum(self.middles[0][:, None], self.middles[1][None, :])
        self.shape = self.away.shape
        self.solved = np.ones((3, *self.shape), dtype=bool)
        for axis in (0, 1):
            if not sand[axis]:
                np.moveaxis(self.solved[1:], axis + 1, 0)[0] = False
        self._find_pattern()

    def guess(self) -> tuple[Floats, float]:
        """(3, n, m) to begin with, and the pressure gradient: of channels as deep as the hydraulic radius.

        Each place has what is as far from the next wall in a channel whose floor is that wall.
        """
        radius = self._radius
        away = np.minimum(self.away / radius, 1.0)
        parts = []
        for found in self._channels:
            u = 1.0 / found.mean
            log_k, log_omega = found.logarithms(away)
            speed = u * np.interp(away, found.heights, found.speed)
            parts.append(
                np.array([speed, log_k + 2.0 * math.log(u), log_omega + math.log(u / radius)])
            )
        by_side = self.middles[0][:, None] < self.middles[1][None, :]
        state = np.asarray(np.where(by_side, *parts), dtype=float)
        state[0] /= (state[0] * self.volumes).sum() / self.volumes.sum()
        state[1] = np.maximum(state[1], math.log(self.least))
        return state, max(self._typical) ** 2 / radius

    # -- walls ----------------------------------------------------------------------------------------

    def on_sand(self, axis: int, speed: Floats) -> Floats:
        """ln k and ln omega (2, l) along a rough wall, by the speed (l,) in the volumes next to it."""
        sand, nu, typical = self.sand[axis], self.viscosity, self._typical[axis]
        slope = np.maximum(speed / self.middles[axis][0], LEAST_SLOPE * typical**2 / nu)
        found = shear_velocity_at(slope, sand, nu, NUMPY)
        k, omega = at_rough_wall(sand * found / nu, NUMPY)
        little = little_k(sand * typical / nu) * typical**2
        return np.log([k * found**2 + little, omega * nu / sand**2])

    def walls(self, state: Floats) -> tuple[Floats | None, Floats | None]:
        """ln k and ln omega (2, l) along side and floor; of smooth ones None."""
        side, floor = (
            self.on_sand(axis, np.moveaxis(state[0], axis, 0)[0]) if self.sand[axis] else None
            for axis in (0, 1)
        )
        return side, floor

    def eddy_viscosity(self, axis: int, wall: Floats | None) -> Floats:
        """Eddy viscosity (l,) along a wall: none at a smooth one, and none of a rough one next to a smooth one."""
        solved = np.moveaxis(self.solved[1], axis, 0)[0]
        return (
            np.zeros(len(solved))
            if wall is None
            else np.where(solved, np.exp(wall[0] - wall[1]), 0.0)
        )

    def stresses(self, state: Floats) -> tuple[Floats, Floats]:
        """Shear stresses over rho V^2 along the volumes of the side (m,) and of the floor (n,)."""
        side, floor = (
            (self.viscosity + self.eddy_viscosity(axis, wall))
            * np.moveaxis(state[0], axis, 0)[0]
            / self.middles[axis][0]
            for axis, wall in enumerate(self.walls(state))
        )
        return side, floor

    # -- equations ------------------------------------------------------------------------------------

    def rates(self, state: Floats, gradient: float) -> Floats:
        """(3, n, m) how fast speed and logarithms change, times the volumes."""
        _, log_k, log_omega = state
        k, omega, nu, d = np.exp(log_k), np.exp(log_omega), self.viscosity, self.away
        walls = self.walls(state)
        slopes = [
            [self._slopes(number, state[number], axis, walls[axis]) for number in range(3)]
            for axis in (0, 1)
        ]
        inside = [[_between(one, axis) for one in slopes[axis]] for axis in (0, 1)]
        square = inside[0][0] ** 2 + inside[1][0] ** 2 + LEAST_RATE
        along = inside[0][1] * inside[0][2] + inside[1][1] * inside[1][2]
        by_k, viscous = np.sqrt(k) / (BETA_STAR * omega * d), 500.0 * nu / (d**2 * omega)
        argument = np.minimum(np.maximum(2.0 * by_k, viscous), LARGEST_ARGUMENT)
        time = 1.0 / np.maximum(omega, np.sqrt(square) * np.tanh(argument**2) / A_1)
        argument = np.minimum(
            np.maximum(by_k, viscous), 2.0 / np.maximum(d**2 * along, LEAST_CROSS)
        )
        inner = np.tanh(np.minimum(argument, LARGEST_ARGUMENT) ** 4)
        sigma_k, sigma_omega, beta, gamma = (
            inner * a + (1.0 - inner) * b for a, b in zip(INNER, OUTER, strict=True)
        )
        added = np.where(self.solved[1], k * time, 0.0)
        made = np.minimum(square * time, MOST_PRODUCED * BETA_STAR * omega)
        carried = 2.0 * (1.0 - inner) * SIGMA_CROSS * k / omega * along
        found = self.volumes * np.array(
            [
                np.full(self.shape, gradient),
                made - BETA_STAR * omega * (1.0 - self.least / k),
                gamma * square / omega - beta * omega + carried,
            ]
        )
        for axis in (0, 1):
            for number, sigma in enumerate((np.ones(self.shape), sigma_k, sigma_omega)):
                at_wall = np.moveaxis(sigma, axis, 0)[:1] * self.eddy_viscosity(axis, walls[axis])
                flux = _flux(axis, slopes[axis][number], nu + sigma * added, nu + at_wall)
                found[number] += self._spread(number, state[number], axis, flux, walls[axis])
        found[~self.solved] = 0.0
        return found

    def _slopes(self, number: int, values: Floats, axis: int, wall: Floats | None) -> Floats:
        """Slopes of an unknown along an axis at the ends of the volumes.

        Logarithms begin on a rough wall, behind the first volume of a smooth one.
        """
        values, places = np.moveaxis(values, axis, 0), self.middles[axis][:, None]
        found = np.zeros((len(values) + 1, values.shape[1]))
        found[1:-1] = np.diff(values, axis=0) / np.diff(places, axis=0)
        if number == 0:
            found[0] = values[0] / places[0]
        elif wall is not None:
            found[0] = (values[0] - wall[number - 1]) / places[0]
        elif number == 1:
            found[1] = EXPONENT / self.first
        else:
            found[1] = (values[1] - self._omega_at_first) / (places[1] - self.first)
        return np.moveaxis(found, 0, axis)

    @property
    def _omega_at_first(self) -> float:
        """ln omega where the first volume at a smooth wall ends."""
        return float(at_smooth_wall(self.viscosity, self.first, np))

    def _spread(
        self, number: int, values: Floats, axis: int, flux: Floats, wall: Floats | None
    ) -> Floats:
        """What diffuses into the volumes along an axis, with D |grad K|^2: div(k D grad K)/k, as in one dimension."""
        values = np.moveaxis(values, axis, 0)
        upper, lower = flux[1:].copy(), flux[:-1].copy()
        if number:
            weight = np.exp(0.5 * np.diff(values, axis=0))
            upper[:-1] *= weight
            lower[1:] /= weight
            if wall is not None:
                lower[0] *= np.exp(wall[number - 1] - values[0])
            else:
                start = (self.first / self.middles[axis][1]) ** EXPONENT
                lower[1] = flux[1] * (
                    start if number == 1 else np.exp(self._omega_at_first - values[1])
                )
        return np.moveaxis((upper - lower) * self.sizes[1 - axis], 0, axis)

    # -- their solution -------------------------------------------------------------------------------

    def _find_pattern(self) -> None:
        """For each colour the unknown of it, if any, that is in the equations of each volume."""
        i, j = np.indices(self.shape)
        self._colours = (i + STRIDE * j) % COLOURS
        self._owners = np.full((COLOURS, *self.shape), -1)
        for a in range(-REACH, REACH + 1):
            for b in range(abs(a) - REACH, REACH - abs(a) + 1):
                p, q = i + a, j + b
                there = (p >= 0) & (p < self.shape[0]) & (q >= 0) & (q < self.shape[1])
                colour = (p + STRIDE * q) % COLOURS
                self._owners[colour[there], i[there], j[there]] = (p * self.shape[1] + q)[there]

    def jacobian(self, state: Floats, gradient: float) -> Any:
        """Derivatives of the rates, a sparse matrix; unknowns are ordered by volume."""
        base, number = self.rates(state, gradient), self.volumes.size
        rows, columns, values = [], [], []
        own = np.arange(number)
        for colour in range(COLOURS):
            there = self._owners[colour].ravel()
            mine = there >= 0
            for component in range(3):
                changed = state.copy()
                changed[component][self._colours == colour] += SLIGHT
                change = ((self.rates(changed, gradient) - base) / SLIGHT).reshape(3, -1)
                for row in range(3):
                    rows.append(3 * own[mine] + row)
                    columns.append(3 * there[mine] + component)
                    values.append(change[row, mine])
        entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
        return csc_matrix(entries, shape=(3 * number, 3 * number))

    def solve(self, state: Floats, gradient: float) -> tuple[Floats, float]:
        """The steady state and its pressure gradient from those at hand, by implicit steps of pseudo-time.

        Raises:
            ConvergenceError: there is none that could be found.
        """
        whole, step = self.volumes.sum(), STEP
        pull = np.zeros((*self.shape, 3))
        pull[..., 0] = self.volumes
        before = math.inf
        for _ in range(MOST_STEPS):
            mass = np.where(self.solved, self.volumes / step, 1.0)
            matrix = diags(_by_volume(mass)) - self.jacobian(state, gradient)
            factors = splu(matrix.tocsc())
            first, second = (
                np.moveaxis(factors.solve(one).reshape(*self.shape, 3), -1, 0)
                for one in (_by_volume(self.rates(state, gradient)), pull.ravel())
            )
            more = (whole - ((state[0] + first[0]) * self.volumes).sum()) / (
                second[0] * self.volumes
            ).sum()
            correction = first + more * second
            if not np.isfinite(size := float(np.abs(correction).max())):
                break
            # Corrections of long steps that do not shrink go to and fro about where a limiter switches.
            part = AGAIN if step > STEADY and size > NO_LESS * before else 1.0
            bounded = np.clip(correction, -LARGEST_CORRECTION, LARGEST_CORRECTION)
            state, gradient, before = state + part * bounded, gradient + part * more, size
            if size < ENOUGH and step > STEADY:
                return state, gradient
            step = min(
                step * (STEP_GROWTH if size < SMALL else CUT if size > LARGE else 1.2), LONGEST
            )
        raise ConvergenceError("the developed flow of the k-omega model in the duct was not found")


def _ends(first: float, whole: float, coarse: float) -> Floats:
    """Ends (n + 1,) of volumes with the distance from a wall."""
    sizes = RowSizes(NEXT * first, GROWTH, LARGEST * whole)
    beyond = growing_rows(sizes, whole - first, 1, coarse)
    return np.concatenate([[0.0, first], first + (whole - first) * beyond])


def _ends_on_sand(sand: float, in_units: float, whole: float, coarse: float) -> Floats:
    """Ends (n + 1,) of volumes with the distance from a wall with sand, whose roughness is so many nu/u*, too."""
    first = min(FIRST_ON_SAND * length_at_sand(in_units) * sand, LARGEST_FIRST * whole)
    beyond = growing_rows(RowSizes(first, GROWTH, LARGEST * whole), whole, 1, coarse)
    return np.concatenate([[0.0], whole * beyond])


def middles(ends: Floats) -> Floats:
    """Middles (n,) of volumes between ends (n + 1,)."""
    return 0.5 * (ends[1:] + ends[:-1])


def _flux(axis: int, slopes: Floats, by: Floats, at_wall: Floats) -> Floats:
    """Slopes along an axis, that axis first, times the diffusivities between volumes, and those (1, l) at the wall."""
    slopes, by = np.moveaxis(slopes, axis, 0), np.moveaxis(by, axis, 0)
    return np.asarray(slopes * np.concatenate([at_wall, 0.5 * (by[1:] + by[:-1]), by[-1:]]))


def _between(slopes: Floats, axis: int) -> Floats:
    """Means (n, m) of slopes at both ends of volumes along an axis."""
    slopes = np.moveaxis(slopes, axis, 0)
    return np.moveaxis(0.5 * (slopes[1:] + slopes[:-1]), 0, axis)


def _by_volume(values: Floats) -> Floats:
    """Entries (3 n m,) of (3, n, m), those of a volume next to each other."""
    return np.moveaxis(values, 0, -1).ravel()
