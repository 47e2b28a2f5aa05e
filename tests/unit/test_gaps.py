"""Gaps between a grain and a bed in the plane: formulas for a disc, and the search for any grain."""

import math

import numpy as np
import pytest

from incipient.geometry.closest import NearBed
from incipient.geometry.placement import Placement
from incipient.geometry.plane.beds import Bed, Flat, HalfDiscs, Polyline
from incipient.geometry.plane.grains import Disc

RIDGE = Polyline(
    ((-9.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.5, 0.2), (1.0, 0.2), (1.4, -0.3), (9.0, 0.4))
)


def test_a_disc_between_two_half_discs_touches_both() -> None:
    """Its centre is sqrt((r + R)^2 - (s/2)^2) high where it rests: the triangle of centres."""
    height = math.sqrt(0.75)
    found = NearBed(Disc(1.0), HalfDiscs(0.5, 1.0)).gaps(Placement((0.5, height)), 0.1)
    assert found.gaps == pytest.approx([0.0, 0.0], abs=1e-12)
    assert sorted(found.normals[:, 0]) == pytest.approx([-0.5, 0.5], abs=1e-12)
    assert found.normals[:, 1] == pytest.approx([height, height])


@pytest.mark.parametrize("bed", [Flat(0.0), HalfDiscs(0.5, 1.0), HalfDiscs(0.3, 1.0), RIDGE])
def test_a_disc_is_nearest_where_the_bed_is_nearest_to_its_centre(bed: Bed) -> None:
    """The least gap is the distance of the bed from the centre less the radius, along the line to the nearest point."""
    random = np.random.default_rng(25)
    for radius, x, above in random.uniform((0.2, -2.0, 0.001), (0.8, 2.0, 0.6), (24, 3)):
        centre = np.array([x, float(bed.height([x])[0]) + radius + above])
        distance = float(bed.distance(centre[None])[0])
        if not radius < distance < radius + 0.3:
            continue
        found = NearBed(Disc(2.0 * radius), bed).gaps(Placement(tuple(centre)), 0.3)
        least = int(np.argmin(found.gaps))
        assert found.gaps[least] == pytest.approx(distance - radius, abs=1e-12)
        foot = bed.nearest(centre[None])[0]
        assert found.feet[least] == pytest.approx(foot, abs=1e-8)
        assert found.normals[least] == pytest.approx((centre - foot) / distance, abs=1e-8)
