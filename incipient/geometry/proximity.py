"""One set of questions about a grain and its bed, in the plane and in space."""

from typing import Protocol, Self

import numpy as np

from incipient.arrays import Floats
from incipient.geometry.plane.bed import Bed
from incipient.geometry.plane.grain import Grain
from incipient.geometry.plane.planar import PlanarProximity
from incipient.geometry.rest import planar, spatial
from incipient.geometry.space.closest import SpatialProximity
from incipient.geometry.space.solid import Solid
from incipient.geometry.space.terrain import Terrain


class Near(Protocol):
    """Places where a grain is close to its bed."""

    @property
    def gaps(self) -> Floats:
        """Distances (k,)."""

    @property
    def points(self) -> Floats:
        """Points of the grain (k, gdim)."""

    @property
    def normals(self) -> Floats:
        """The bed's unit normals into the fluid (k, gdim)."""

    def __len__(self) -> int: ...

    def only(self, which: np.ndarray) -> Self:
        """Some of them, by a mask or by indices."""


def proximity(grain: Grain | Solid, bed: Bed | Terrain) -> PlanarProximity | SpatialProximity:
    """The questions for this grain and this bed. Raises SceneError if only one of them is planar."""
    return spatial(grain, bed) if isinstance(grain, Solid) else PlanarProximity(*planar(grain, bed))
