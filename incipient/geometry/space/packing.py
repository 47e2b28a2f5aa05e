"""Beds of spheres in layers, in order or disorder: an endless array whose every sphere follows from where it is."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from incipient.arrays import Floats, rows
from incipient.errors import SceneError
from incipient.geometry.shape import require_positive
from incipient.geometry.space.terrain import BallLattice

LOWEST = 0.5  # of the radius, by which a sphere in disorder may lie lower
AROUND = 2  # places of the lattice on either side at which a sphere above a point may belong


@dataclass(frozen=True)
class Packing(BallLattice):
    """Spheres of one size in layers; the centres of the lowest lie on the plane z = origin_z, into which they sink.

    arrangement "square" and "triangular": as `Hemispheres`, every further layer in the pockets of that below it.
    "random": the triangular array whose every sphere is shifted horizontally as far as its neighbours leave room,
    and lowered by at most half a radius, by chance: the same for the same seed, wherever the bed is looked at.
    """

    radius: float
    spacing: float
    arrangement: Literal["square", "triangular", "random"] = "triangular"
    offset: tuple[float, float] = (0.0, 0.0)
    origin_z: float = 0.0
    angle: float = 0.0
    layers: int = 1
    seed: int = 0

    def __post_init__(self) -> None:
        require_positive("radius", self.radius)
        require_positive("spacing", self.spacing)
        if self.layers < 1:
            raise SceneError(f"layers {self.layers} is none; give one or more")
        if self.layers > 1 and not self._rise_squared > 0.0:
            raise SceneError(
                "spheres so far apart carry no further layer; reduce spacing or give layers = 1"
            )

    @property
    def crest(self) -> float:
        """The top of the uppermost spheres, in disorder of one that is not lowered."""
        return self.origin_z + (self.layers - 1) * self._rise + self.radius

    @property
    def _pocket(self) -> Floats:
        """Where, in steps of the lattice, the pockets of a layer are."""
        return np.full(2, 0.5 if self.arrangement == "square" else 1.0 / 3.0)

    @property
    def _rise_squared(self) -> float:
        across = float(np.linalg.norm(self._pocket @ self._lattice))
        return 4.0 * self.radius**2 - across**2

    @property
    def _rise(self) -> float:
        """The height of a layer above that below it; 0 for a single one."""
        return float(np.sqrt(self._rise_squared)) if self.layers > 1 else 0.0

    def _at(self, places: np.ndarray, layer: int) -> Floats:
        """The centres (n, 3) of the spheres of a layer at whole places (n, 2) of the lattice."""
        ideal = np.asarray(self.offset) + (places + layer % 2 * self._pocket) @ self._lattice
        height = np.full(len(places), self.origin_z + layer * self._rise)
        if self.arrangement != "random":
            return np.column_stack([ideal, height])
        reach, turn, drop = (self._chance(places, layer, number) for number in range(3))
        room = max(0.5 * self.spacing - self.radius, 0.0) * np.sqrt(reach)
        shift = room[:, None] * np.column_stack(
            [np.cos(2.0 * np.pi * turn), np.sin(2.0 * np.pi * turn)]
        )
        return np.column_stack([ideal + shift, height - LOWEST * self.radius * drop])

    def _chance(self, places: np.ndarray, layer: int, number: int) -> Floats:
        """Numbers (n,) from 0 to 1 that belong to places (n, 2): bits mixed as by Steele, Lea & Flood (2014)."""
        key = np.array([self.seed, layer, number], dtype=np.uint64)
        state = np.zeros(len(places), dtype=np.uint64)
        with np.errstate(over="ignore"):
            for part in (*key, *places.T.astype(np.int64).astype(np.uint64)):
                state = (state ^ part) + np.uint64(0x9E3779B97F4A7C15)
                state = (state ^ (state >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
                state = (state ^ (state >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
                state ^= state >> np.uint64(31)
        return np.asarray((state >> np.uint64(11)) / 2.0**53)

    def centres(self, middle: ArrayLike, reach: float) -> Floats:
        """All centres (k, 3) within a horizontal distance of a point (2,)."""
        middle = np.asarray(middle, dtype=float)
        places = self._places(middle, reach, AROUND)
        found = np.vstack([self._at(places, layer) for layer in range(self.layers)])
        return np.asarray(found[np.linalg.norm(found[:, :2] - middle, axis=1) <= reach])

    def _highest(self, x: Floats) -> tuple[Floats, Floats]:
        """Heights (n,) at points (n, 2), and the vectors (n, 2) there from the sphere's centre, inf on the base."""
        home = np.round(np.linalg.solve(self._lattice.T, (x - np.asarray(self.offset)).T).T)
        height, away = np.full(len(x), self.origin_z), np.full((len(x), 2), np.inf)
        for layer in range(self.layers):
            for step in np.ndindex(2 * AROUND + 1, 2 * AROUND + 1):
                centre = self._at(home + np.array(step) - AROUND, layer)
                beside = x - centre[:, :2]
                below = self.radius**2 - (beside**2).sum(axis=1)
                top = np.where(
                    below >= 0.0, centre[:, 2] + np.sqrt(np.maximum(below, 0.0)), -np.inf
                )
                higher = top > height
                height, away = (
                    np.where(higher, top, height),
                    np.where(higher[:, None], beside, away),
                )
        return height, away

    def height(self, x: ArrayLike) -> Floats:
        """b at points (n, 2), (n,)."""
        return self._highest(rows(x))[0]

    def gradient(self, x: ArrayLike) -> Floats:
        """The derivatives (n, 2), infinite at the feet of spheres."""
        _, away = self._highest(rows(x))
        on_base = ~np.isfinite(away).all(axis=1, keepdims=True)
        beside = np.where(on_base, 0.0, away)
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = -beside / np.sqrt(self.radius**2 - (beside**2).sum(axis=1, keepdims=True))
        return np.asarray(np.where(on_base, 0.0, slope))
