"""Developed flow over one wall by the 1-D k-omega SST model: the inflow of channels.

Finite volumes for ln k and ln omega of `forms.k_omega_sst`, in units of u* and the depth; the shear stress falls
linearly to zero on top.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.linalg import solve_banded

from ..arrays import Floats
from ..errors import ConvergenceError
from ..forms.k_omega_sst import (
    A_1,
    BETA_STAR,
    EXPONENT,
    INNER,
    MOST_PRODUCED,
    OUTER,
    SIGMA_CROSS,
)
from .wall_law import shift

VOLUMES = 160
FIRST = 0.5  # wall units, from which on volumes begin; below only molecules matter
POWERS = EXPONENT, -2.0  # of the distance as which k and omega go there
LARGEST_ARGUMENT = 5.0
STEP, GROWTH, CUT, LONGEST = 1e-4, 2.0, 0.5, 1e9  # of pseudo-time, in h/u*
MOST_STEPS, ENOUGH = 300, 1e-7
LARGEST_CORRECTION, SMALL, LARGE = (
    0.7,
    1.0,
    3.0,
)  # of logarithms: applied; for longer steps; for shorter ones
LAMINAR = -25.0  # ln k+ below which a flow is laminar
SLIGHT = 1e-6  # by which logarithms are changed for derivatives
MOST_TRIALS, SAME_DISCHARGE = 30, 1e-6


@dataclass(frozen=True)
class DevelopedChannel:
    """Profiles over the depth, in units of u* and the depth, at heights (n,) from zero to one.

    re_tau: u* h/nu; mean: depth-averaged velocity
    log_k, log_omega: (n,), from the second height on; the first is the wall
    """

    re_tau: float
    mean: float
    heights: Floats
    speed: Floats
    log_k: Floats
    log_omega: Floats

    @property
    def is_laminar(self) -> bool:
        return bool(self.log_k.max() <= LAMINAR)

    def logarithms(self, heights: Floats) -> Floats:
        """ln k and ln omega (2, ...) at heights, constant below the first height above the wall."""
        nodes = self.heights[1:]
        at = np.log(np.maximum(heights, nodes[0]))
        return np.array(
            [np.interp(at, np.log(nodes), values[1:]) for values in (self.log_k, self.log_omega)]
        )

    def shifted(self, away: float) -> DevelopedChannel:
        """Flow over a rough wall at a distance from the smooth one, over the depth."""
        start = float(np.interp(away, self.heights, self.speed))
        above = self.heights > away
        heights, speed, log_k, log_omega = (
            np.concatenate([[np.interp(away, self.heights, values)], values[above], values[-1:]])
            for values in (self.heights, self.speed, self.log_k, self.log_omega)
        )
        heights, speed = heights - away, speed - start
        heights[-1] = 1.0
        mean = float(0.5 * (speed[1:] + speed[:-1]) @ np.diff(heights))
        return replace(
            self, mean=mean, heights=heights, speed=speed, log_k=log_k, log_omega=log_omega
        )


class _Column:
    def __init__(self, re_tau: float):
        self.viscosity, self._laminar = 1.0 / re_tau, False
        first = min(FIRST / re_tau, 0.02)
        # Even in the logarithm next to the wall, evenly growing to the top.
        self.faces = first ** np.linspace(1.0, 0.0, VOLUMES + 1)
        self.centres = 0.5 * (self.faces[1:] + self.faces[:-1])
        self.sizes, self.apart = np.diff(self.faces), np.diff(self.centres)
        self.stress = 1.0 - self.centres

    def guess(self) -> Floats:
        y = self.centres
        damped = (1.0 - np.exp(-y / self.viscosity / 12.0)) ** 3
        k = (3.3 - 2.3 * y) * damped + 1e-8
        omega = 6.0 * self.viscosity / (INNER[2] * y**2) + 1.0 / (0.3 * 0.41 * y)
        return np.log(np.column_stack([k, omega]))

    def strain(self, k: Floats, omega: Floats) -> tuple[Floats, Floats]:
        nu, y = self.viscosity, self.centres
        viscous = 500.0 * nu / (y**2 * omega)
        argument = np.maximum(2.0 * np.sqrt(k) / (BETA_STAR * omega * y), viscous)
        limited = np.tanh(np.minimum(argument, LARGEST_ARGUMENT) ** 2)
        free = self.stress / (nu + k / omega)
        bounded = np.maximum((self.stress - A_1 * k / np.maximum(limited, 1e-12)) / nu, 0.0)
        strain = np.maximum(free, bounded)
        return strain, 1.0 / np.maximum(omega, strain * limited / A_1)

    def rates(self, logarithms: Floats) -> Floats:
        nu, y = self.viscosity, self.centres
        k, omega = np.exp(logarithms).T
        strain, time = self.strain(k, omega)
        slope_faces = np.diff(logarithms, axis=0) / self.apart[:, None]
        slopes = np.vstack([np.divide(POWERS, self.faces[0]), slope_faces, np.zeros((1, 2))])
        middle = 0.5 * (slopes[1:] + slopes[:-1])
        cross = np.maximum(y**2 * middle[:, 0] * middle[:, 1], 1e-10)
        argument = np.maximum(np.sqrt(k) / (BETA_STAR * omega * y), 500.0 * nu / (y**2 * omega))
        inner = np.tanh(np.minimum(np.minimum(argument, 2.0 / cross), LARGEST_ARGUMENT) ** 4)
        sigma_k, sigma_omega, beta, gamma = (
            inner * a + (1.0 - inner) * b for a, b in zip(INNER, OUTER, strict=True)
        )
        produced = np.minimum(strain**2 * time, MOST_PRODUCED * BETA_STAR * omega)
        carried = 2.0 * (1.0 - inner) * SIGMA_CROSS * k / omega * middle[:, 0] * middle[:, 1]
        sources = (produced - BETA_STAR * omega, gamma * strain**2 / omega - beta * omega + carried)
        changes = np.empty_like(logarithms)
        for i, sigma in enumerate((sigma_k, sigma_omega)):
            spread = nu + sigma * k * time
            at_faces = np.concatenate([spread[:1], 0.5 * (spread[1:] + spread[:-1]), spread[-1:]])
            # div(D grad K) + D |grad K|^2 = div(k D grad K)/k, k being its mean between neighbours.
            weight = np.exp(0.5 * np.diff(logarithms[:, i]))
            flux = at_faces * slopes[:, i]
            upper = flux[1:] * np.concatenate([weight, [0.0]])
            start = (self.faces[0] / y[0]) ** POWERS[i]
            lower = flux[:-1] * np.concatenate([[start], 1.0 / weight])
            changes[:, i] = upper - lower + sources[i] * self.sizes
        if self._laminar:
            changes[:, 0] = 0.0
        return changes

    def jacobian(self, logarithms: Floats) -> Floats:
        """Derivatives of the rates as a banded matrix (7, 2 n), unknowns K, W of each volume."""
        base, number = self.rates(logarithms).ravel(), logarithms.size
        bands, rows = np.zeros((7, number)), np.arange(number)
        for colour in range(6):
            changed = logarithms.ravel().copy()
            changed[colour::6] += SLIGHT
            change = (self.rates(changed.reshape(-1, 2)).ravel() - base) / SLIGHT
            for column in range(colour, number, 6):
                low, high = max(0, 2 * (column // 2) - 2), min(number, 2 * (column // 2) + 4)
                bands[3 + rows[low:high] - column, column] = change[low:high]
        return bands

    def solve(self, logarithms: Floats) -> Floats:
        """Steady logarithms by implicit pseudo-time steps; laminar flow has k = exp(-25). Raises ConvergenceError."""
        step, mass = STEP, np.repeat(self.sizes, 2)
        for _ in range(MOST_STEPS):
            bands = -self.jacobian(logarithms)
            bands[3] += mass / step
            correction = solve_banded((3, 3), bands, self.rates(logarithms).ravel())
            if not np.isfinite(size := float(np.abs(correction).max())):
                break
            bounded = np.clip(correction, -LARGEST_CORRECTION, LARGEST_CORRECTION)
            logarithms = logarithms + bounded.reshape(-1, 2)
            if size < ENOUGH and step > 1.0:
                return logarithms
            step = min(step * (GROWTH if size < SMALL else CUT if size > LARGE else 1.2), LONGEST)
            if not self._laminar and logarithms[:, 0].max() < LAMINAR:
                self._laminar = True
                logarithms[:, 0] = LAMINAR
        raise ConvergenceError("the developed flow of the k-omega model did not converge")

    def profiles(self, logarithms: Floats) -> DevelopedChannel:
        strain, _ = self.strain(*np.exp(logarithms).T)
        first, re_tau = self.faces[0], 1.0 / self.viscosity
        rise = strain * self.sizes
        start = (first - 0.5 * first**2) * re_tau
        speed = start + np.cumsum(rise) - 0.5 * rise
        below = re_tau * (first**2 / 2.0 - first**3 / 6.0)
        mean = below + float(speed @ self.sizes)
        heights = np.concatenate([[0.0], self.centres, [1.0]])
        speeds = np.concatenate([[0.0], speed, [speed[-1] + 0.5 * rise[-1]]])
        ends = (np.concatenate([values[:1], values, values[-1:]]) for values in logarithms.T)
        return DevelopedChannel(re_tau, mean, heights, speeds, *ends)


@lru_cache(maxsize=256)
def developed(re_tau: float, roughness: float = 0.0) -> DevelopedChannel:
    """Developed flow at u* h/nu, over a wall of a given roughness over depth. Raises ConvergenceError."""
    column = _Column(re_tau)
    smooth = column.profiles(column.solve(column.guess()))
    away = shift(roughness * re_tau) / re_tau
    return smooth.shifted(away) if away > SLIGHT else smooth


def of_discharge(reynolds: float, roughness: float = 0.0) -> DevelopedChannel:
    """Developed flow at a Reynolds number of mean velocity and depth. Raises ConvergenceError.

    roughness: k_s over the depth
    """
    # By Keulegan's law, or laminar; then by secants in logarithms.
    re_tau = max(math.sqrt(3.0 * reynolds), 0.09 * reynolds**0.88)
    slope, before = 1.1, None
    for _ in range(MOST_TRIALS):
        channel = developed(re_tau, roughness)
        away = math.log(reynolds / (channel.mean * re_tau))
        if abs(away) < SAME_DISCHARGE:
            return channel
        if before is not None and before[0] != re_tau:
            slope = float(np.clip((before[1] - away) / math.log(re_tau / before[0]), 0.5, 3.0))
        before = re_tau, away
        re_tau *= math.exp(away / slope)
    raise ConvergenceError(
        "the developed flow of the k-omega model did not converge for the discharge"
    )
