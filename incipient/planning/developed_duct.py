"""Developed flow along a duct by the k-omega SST model, in two dimensions: what enters between side walls.

The equations are those of `forms.k_omega_sst` for a velocity along the duct alone, by finite volumes for it, ln k and
ln omega, in units of its mean V and of the depth h over which floor (and top) are felt. The section is what lies next
to one corner: half of an open channel, a quarter of a closed duct. An eddy viscosity makes no flow across it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from scipy.interpolate import RectBivariateSpline
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
    at_smooth_wall,
)
from .cells import RowSizes, growing_rows
from .developed_channel import of_discharge

FIRST = 0.5  # wall units up to which only molecules matter: the first volume, by u* as estimated
# Volumes: the one behind it, over it; their growth with the distance from it; and the largest, over the extent.
NEXT, GROWTH, LARGEST = 0.1, 0.25, 0.08
LEAST = 1e-3  # k over u*^2 below which it is not destroyed: in corners its logarithm would fall for ever
STEP, STEP_GROWTH, CUT, LONGEST = 0.1, 3.0, 0.5, 1e9  # of pseudo-time, in h/V
MOST_STEPS, ENOUGH, STEADY = 200, 1e-7, 1e3  # STEADY: the shortest last step
LARGEST_CORRECTION, SMALL, LARGE = 0.7, 1.0, 3.0  # of logarithms: applied; for longer steps; for shorter ones
SLIGHT = 1e-6  # by which unknowns are changed for derivatives
NEAREST = 1e-3  # of the first volume, below which what enters does not change
LAMINAR = 0.01  # eddy over molecular viscosity up to which a flow is laminar
# What is in an equation lies within two steps along the grid: by (i + 5 j) mod 13 no two of these volumes are alike.
COLOURS, STRIDE, REACH = 13, 5, 2


@dataclass(frozen=True, eq=False)
class DevelopedDuct:
    """Profiles over a section next to its corner, in units of V and h. No method is collective.

    reynolds: V h/nu
    ends:     of volumes with the distance from the side (n + 1,) and with the height (m + 1,), from zero on
    values:   (3, n, m) speed, ln k and ln omega; of the latter two not in the first volumes along each wall
    gradient: by which the pressure falls along the duct
    """

    reynolds: float
    ends: tuple[Floats, Floats]
    values: Floats
    gradient: float

    @property
    def stresses(self) -> tuple[Floats, Floats]:
        """Shear stresses over rho V^2 along the volumes of the side (m,) and of the floor (n,)."""
        speed, (y, z) = self.values[0], (middles(ends) for ends in self.ends)
        return speed[0] / (self.reynolds * y[0]), speed[:, 0] / (self.reynolds * z[0])

    @property
    def shear_velocities(self) -> tuple[float, float]:
        """u* over V on a side and on the floor: of the stress in the mean along each."""
        along = zip(self.stresses, self.ends[::-1], strict=True)
        side, floor = (math.sqrt(float(stress @ np.diff(ends)) / ends[-1]) for stress, ends in along)
        return side, floor

    @property
    def shear_velocity(self) -> float:
        """u* over V of the stress in the mean along all walls."""
        lengths = np.array([self.ends[1][-1], self.ends[0][-1]])
        return math.sqrt(float(np.square(self.shear_velocities) @ lengths / lengths.sum()))

    @property
    def is_laminar(self) -> bool:
        """Whether k hardly adds to the viscosity at this Reynolds number."""
        _, log_k, log_omega = self.values[:, 1:, 1:]
        return bool(np.exp(log_k - log_omega).max() * self.reynolds < LAMINAR)

    def speed(self, y: Floats, z: Floats) -> Floats:
        """Speeds (n,) at distances (n,) from the side and heights (n,)."""
        scale = self.ends[0][1]
        return np.asarray(self._speed.ev(np.log1p(y / scale), np.log1p(z / scale)))

    def logarithms(self, y: Floats, z: Floats) -> Floats:
        """ln k and ln omega (2, n) at distances (n,) from the side and heights (n,)."""
        first = self.ends[0][1]
        beyond = [np.log(np.maximum(one, first)) for one in (y, z)]
        log_k, log_omega = (one.ev(*beyond) for one in self._logarithms)
        near = np.maximum(np.minimum(y, z), NEAREST * first)
        inside = near < first
        log_k[inside] += EXPONENT * np.log(near[inside] / first)
        log_omega[inside] = at_smooth_wall(1.0 / self.reynolds, near[inside], np)
        return np.array([log_k, log_omega])

    @cached_property
    def _speed(self) -> Any:
        values = np.pad(self.values[0], 1, mode="edge")
        values[0], values[:, 0] = 0.0, 0.0
        places = (np.concatenate([[0.0], middles(ends), ends[-1:]]) for ends in self.ends)
        return RectBivariateSpline(*(np.log1p(one / self.ends[0][1]) for one in places), values)

    @cached_property
    def _logarithms(self) -> tuple[Any, ...]:
        """Linear in the logarithms of distances, in which those next to walls are linear."""
        places = [np.log(np.concatenate([ends[1:2], middles(ends)[1:], ends[-1:]])) for ends in self.ends]
        found = []
        for values, power in zip(self.values[1:, 1:, 1:], (EXPONENT, -2.0), strict=True):
            padded = np.pad(values, 1, mode="edge")
            y, z = (np.exp(one) for one in places)
            away = np.minimum(y[:, None], z[None, :])
            beside = np.minimum(y.clip(y[1])[:, None], z.clip(z[1])[None, :])
            found.append(RectBivariateSpline(*places, padded + power * np.log(away / beside), kx=1, ky=1))
        return tuple(found)


def middles(ends: Floats) -> Floats:
    """Middles (n,) of volumes between ends (n + 1,)."""
    return 0.5 * (ends[1:] + ends[:-1])


class _Section:
    """The equations of one Reynolds number; arrays (n, m) by distance from the side and height.

    unit: nu/u* as estimated, over h; coarse: factor of the size of all volumes
    """

    def __init__(self, reynolds: float, half_width: float, unit: float, coarse: float):
        self.viscosity, self.least = 1.0 / reynolds, LEAST / (unit * reynolds) ** 2
        shorter = min(half_width, 1.0)
        first = min(FIRST * unit, 0.02 * shorter)
        y, z = (_ends(first, long, coarse) for long in (half_width, 1.0))
        self.ends, self.first = (y, z), first
        self.sizes = tuple(np.diff(one) for one in self.ends)
        self.volumes = np.outer(*self.sizes)
        self.middles = tuple(middles(one) for one in self.ends)
        self.away = np.minimum(self.middles[0][:, None], self.middles[1][None, :])
        self.shape = self.away.shape
        self.solved = np.ones((3, *self.shape), dtype=bool)
        self.solved[1:, 0], self.solved[1:, :, 0] = False, False
        self._find_pattern()

    def guess(self) -> tuple[Floats, float]:
        """(3, n, m) to begin with, and the pressure gradient: the flow of a channel as deep as the hydraulic radius."""
        half_width = self.ends[0][-1]
        radius = half_width / (1.0 + half_width)
        found = of_discharge(radius / self.viscosity)
        away, u = np.minimum(self.away / radius, 1.0), 1.0 / found.mean
        heights = np.log(found.heights[1:])
        log_k, log_omega = (
            np.interp(np.log(away), heights, one[1:]) for one in (found.log_k, found.log_omega)
        )
        speed = np.interp(away, found.heights, found.speed)
        speed /= (speed * self.volumes).sum() / self.volumes.sum()
        log_k = np.maximum(log_k + 2.0 * math.log(u), math.log(self.least))
        return np.array([speed, log_k, log_omega + math.log(u / radius)]), u**2 / radius

    # -- equations ------------------------------------------------------------------------------------

    def rates(self, state: Floats, gradient: float) -> Floats:
        """(3, n, m) how fast speed and logarithms change, times the volumes."""
        _, log_k, log_omega = state
        k, omega, nu, d = np.exp(log_k), np.exp(log_omega), self.viscosity, self.away
        slopes = [[self._slopes(number, state[number], axis) for number in range(3)] for axis in (0, 1)]
        inside = [[_between(one, axis) for one in slopes[axis]] for axis in (0, 1)]
        square = inside[0][0] ** 2 + inside[1][0] ** 2 + LEAST_RATE
        along = inside[0][1] * inside[0][2] + inside[1][1] * inside[1][2]
        by_k, viscous = np.sqrt(k) / (BETA_STAR * omega * d), 500.0 * nu / (d**2 * omega)
        argument = np.minimum(np.maximum(2.0 * by_k, viscous), LARGEST_ARGUMENT)
        time = 1.0 / np.maximum(omega, np.sqrt(square) * np.tanh(argument**2) / A_1)
        argument = np.minimum(np.maximum(by_k, viscous), 2.0 / np.maximum(d**2 * along, LEAST_CROSS))
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
        for number, sigma in enumerate((1.0, sigma_k, sigma_omega)):
            for axis in (0, 1):
                found[number] += self._spread(
                    number, state[number], axis, slopes[axis][number], nu + sigma * added
                )
        found[~self.solved] = 0.0
        return found

    def _slopes(self, number: int, values: Floats, axis: int) -> Floats:
        """Slopes of an unknown along an axis at the ends of the volumes; logarithms begin behind the first volume."""
        values, places = np.moveaxis(values, axis, 0), self.middles[axis][:, None]
        found = np.zeros((len(values) + 1, values.shape[1]))
        found[1:-1] = np.diff(values, axis=0) / np.diff(places, axis=0)
        if number == 0:
            found[0] = values[0] / places[0]
        elif number == 1:
            found[1] = EXPONENT / self.first
        else:
            found[1] = (values[1] - self._omega_at_first) / (places[1] - self.first)
        return np.moveaxis(found, 0, axis)

    @property
    def _omega_at_first(self) -> float:
        """ln omega where the first volume ends."""
        return float(at_smooth_wall(self.viscosity, self.first, np))

    def _spread(self, number: int, values: Floats, axis: int, slopes: Floats, by: Floats) -> Floats:
        """What diffuses into the volumes along an axis, with D |grad K|^2: div(k D grad K)/k, as in one dimension."""
        values, slopes, by = (np.moveaxis(one, axis, 0) for one in (values, slopes, by))
        flux = slopes * np.concatenate([by[:1], 0.5 * (by[1:] + by[:-1]), by[-1:]])
        upper, lower = flux[1:].copy(), flux[:-1].copy()
        if number:
            weight = np.exp(0.5 * np.diff(values, axis=0))
            upper[:-1] *= weight
            lower[1:] /= weight
            start = (self.first / self.middles[axis][1]) ** EXPONENT
            lower[1] = flux[1] * (start if number == 1 else np.exp(self._omega_at_first - values[1]))
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
        for _ in range(MOST_STEPS):
            mass = np.where(self.solved, self.volumes / step, 1.0)
            matrix = diags(_by_volume(mass)) - self.jacobian(state, gradient)
            factors = splu(matrix.tocsc())
            first, second = (
                np.moveaxis(factors.solve(one).reshape(*self.shape, 3), -1, 0)
                for one in (_by_volume(self.rates(state, gradient)), pull.ravel())
            )
            more = (whole - ((state[0] + first[0]) * self.volumes).sum()) / (second[0] * self.volumes).sum()
            correction = first + more * second
            if not np.isfinite(size := float(np.abs(correction).max())):
                break
            state, gradient = (
                state + np.clip(correction, -LARGEST_CORRECTION, LARGEST_CORRECTION),
                gradient + more,
            )
            if size < ENOUGH and step > STEADY:
                return state, gradient
            step = min(step * (STEP_GROWTH if size < SMALL else CUT if size > LARGE else 1.2), LONGEST)
        raise ConvergenceError("the developed flow of the k-omega model in the duct was not found")


def _ends(first: float, whole: float, coarse: float) -> Floats:
    """Ends (n + 1,) of volumes with the distance from a wall."""
    sizes = RowSizes(NEXT * first, GROWTH, LARGEST * whole)
    beyond = growing_rows(sizes, whole - first, 1, coarse)
    return np.concatenate([[0.0, first], first + (whole - first) * beyond])


def _between(slopes: Floats, axis: int) -> Floats:
    """Means (n, m) of slopes at both ends of volumes along an axis."""
    slopes = np.moveaxis(slopes, axis, 0)
    return np.moveaxis(0.5 * (slopes[1:] + slopes[:-1]), 0, axis)


def _by_volume(values: Floats) -> Floats:
    """Entries (3 n m,) of (3, n, m), those of a volume next to each other."""
    return np.moveaxis(values, 0, -1).ravel()


@lru_cache(maxsize=8)
def developed_duct(reynolds: float, half_width: float, coarse: float = 1.0) -> DevelopedDuct:
    """The developed flow at V h/nu between sides two half widths, in units of h, apart. Not collective.

    coarse: factor of the size of all volumes

    Raises:
        ConvergenceError: it was not found.
    """
    radius = half_width / (1.0 + half_width)
    unit = of_discharge(reynolds * radius).mean / reynolds
    section = _Section(reynolds, half_width, unit, coarse)
    state, gradient = section.solve(*section.guess())
    return DevelopedDuct(reynolds, section.ends, state, gradient)
