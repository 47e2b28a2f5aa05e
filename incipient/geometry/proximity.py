"""One set of questions about a grain and its bed, in the plane and in space."""

from incipient.geometry.plane.bed import Bed
from incipient.geometry.plane.grain import Grain
from incipient.geometry.plane.planar import PlanarMinima, PlanarProximity
from incipient.geometry.rest import planar, spatial
from incipient.geometry.space.closest import DistanceMinima, SpatialProximity
from incipient.geometry.space.solid import Solid
from incipient.geometry.space.terrain import Terrain

Near = (
    PlanarMinima | DistanceMinima
)  # places where a grain is close to its bed: gaps, points and normals


def proximity(grain: Grain | Solid, bed: Bed | Terrain) -> PlanarProximity | SpatialProximity:
    """The questions for this grain and this bed. Raises SceneError if only one of them is planar."""
    return spatial(grain, bed) if isinstance(grain, Solid) else PlanarProximity(*planar(grain, bed))
