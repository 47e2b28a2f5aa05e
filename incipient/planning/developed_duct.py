"""Developed flow along a duct by the k-omega SST model, in two dimensions: what enters between side walls.

Side walls and the floor, and a top with friction, are smooth or rough. An eddy viscosity makes no flow across it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from scipy.interpolate import RectBivariateSpline

from ..arrays import Floats
from ..forms.k_omega_sst import EXPONENT, at_smooth_wall
from .duct_section import DuctSection, middles

NEAREST = 1e-3  # of the first volume at a smooth wall, below which what enters does not change
LAMINAR = 0.01  # eddy over molecular viscosity up to which a flow is laminar


@dataclass(frozen=True, eq=False)
class DevelopedDuct:
    """Profiles over a section next to its corner, in units of V and h. No method is collective.

    reynolds: V h/nu
    ends:     of volumes with the distance from the side (n + 1,) and with the height (m + 1,), from zero on
    values:   (3, n, m) speed, ln k and ln omega; of the latter two not in the first volumes along smooth walls
    gradient: by which the pressure falls along the duct
    stresses: shear stresses over rho V^2 along the volumes of the side (m,) and of the floor (n,)
    on_sand:  ln k and ln omega (2, m) and (2, n) along these two; None: that wall is smooth
    """

    reynolds: float
    ends: tuple[Floats, Floats]
    values: Floats
    gradient: float
    stresses: tuple[Floats, Floats]
    on_sand: tuple[Floats | None, Floats | None]

    @property
    def shear_velocities(self) -> tuple[float, float]:
        """u* over V on a side and on the floor: of the stress in the mean along each."""
        along = zip(self.stresses, self.ends[::-1], strict=True)
        side, floor = (
            math.sqrt(float(stress @ np.diff(ends)) / ends[-1]) for stress, ends in along
        )
        return side, floor

    @property
    def shear_velocity(self) -> float:
        """u* over V of the stress in the mean along all walls."""
        lengths = np.array([self.ends[1][-1], self.ends[0][-1]])
        return math.sqrt(float(np.square(self.shear_velocities) @ lengths / lengths.sum()))

    @property
    def is_laminar(self) -> bool:
        """Whether k hardly adds to the viscosity at this Reynolds number."""
        side, floor = self._begin
        _, log_k, log_omega = self.values[:, side:, floor:]
        return bool(np.exp(log_k - log_omega).max() * self.reynolds < LAMINAR)

    def speed(self, y: Floats, z: Floats) -> Floats:
        """Speeds (n,) at distances (n,) from the side and heights (n,)."""
        along = (np.log1p(one / ends[1]) for one, ends in zip((y, z), self.ends, strict=True))
        return np.asarray(self._speed.ev(*along))

    def logarithms(self, y: Floats, z: Floats) -> Floats:
        """ln k and ln omega (2, n) at distances (n,) from the side and heights (n,)."""
        places = [self._stretched(axis, one) for axis, one in enumerate((y, z))]
        log_k, log_omega = (one.ev(*places) for one in self._logarithms)
        smooth = [axis for axis in (0, 1) if self.on_sand[axis] is None]
        if not smooth:
            return np.array([log_k, log_omega])
        first = self.ends[smooth[0]][1]
        near = np.maximum(np.min([(y, z)[axis] for axis in smooth], axis=0), NEAREST * first)
        inside = near < first
        log_k[inside] += EXPONENT * np.log(near[inside] / first)
        log_omega[inside] = at_smooth_wall(1.0 / self.reynolds, near[inside], np)
        return np.array([log_k, log_omega])

    @property
    def _begin(self) -> tuple[int, int]:
        """The first volume along each axis that has logarithms."""
        side, floor = (1 if one is None else 0 for one in self.on_sand)
        return side, floor

    def _stretched(self, axis: int, away: Floats) -> Floats:
        """Distances from a wall as logarithms are interpolated in; they do not change next to a smooth one."""
        first = self.ends[axis][1]
        return (
            np.log(np.maximum(away, first))
            if self.on_sand[axis] is None
            else np.log1p(away / first)
        )

    @cached_property
    def _speed(self) -> Any:
        values = np.pad(self.values[0], 1, mode="edge")
        values[0], values[:, 0] = 0.0, 0.0
        places = (np.concatenate([[0.0], middles(ends), ends[-1:]]) for ends in self.ends)
        return RectBivariateSpline(
            *(np.log1p(one / ends[1]) for one, ends in zip(places, self.ends, strict=True)), values
        )

    @cached_property
    def _logarithms(self) -> tuple[Any, ...]:
        """Linear in the logarithms of distances from smooth walls, next to which the powers of these are taken out."""
        begin = self._begin
        nodes = [
            np.concatenate([ends[start : start + 1], middles(ends)[start:], ends[-1:]])
            for ends, start in zip(self.ends, begin, strict=True)
        ]
        places = [self._stretched(axis, one) for axis, one in enumerate(nodes)]
        grids = np.meshgrid(*nodes, indexing="ij")
        inner = np.meshgrid(*(one.clip(one[1]) for one in nodes), indexing="ij")
        smooth = [axis for axis, start in enumerate(begin) if start]
        ratio = 0.0
        if smooth:
            away, beside = (
                np.min([one[axis] for axis in smooth], axis=0) for one in (grids, inner)
            )
            ratio = np.log(away / beside)
        found = []
        for number, power in enumerate((EXPONENT, -2.0)):
            padded = np.pad(self.values[number + 1, begin[0] :, begin[1] :], 1, mode="edge")
            for axis, wall in enumerate(self.on_sand):
                if wall is not None:
                    along = np.pad(wall[number, begin[1 - axis] :], 1, mode="edge")
                    np.moveaxis(padded, axis, 0)[0] = along
            found.append(RectBivariateSpline(*places, padded + power * ratio, kx=1, ky=1))
        return tuple(found)


@lru_cache(maxsize=8)
def developed_duct(
    reynolds: float, half_width: float, coarse: float = 1.0, sand: tuple[float, float] = (0.0, 0.0)
) -> DevelopedDuct:
    """The developed flow at V h/nu between sides two half widths, in units of h, apart. Not collective.

    coarse: factor of the size of all volumes
    sand:   equivalent sand roughness of the sides and of the floor, over h; 0: smooth

    Raises:
        ConvergenceError: it was not found.
    """
    section = DuctSection(reynolds, half_width, sand, coarse)
    state, gradient = section.solve(*section.guess())
    return DevelopedDuct(
        reynolds, section.ends, state, gradient, section.stresses(state), section.walls(state)
    )
