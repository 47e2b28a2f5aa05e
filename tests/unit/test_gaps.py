"""Gaps between a grain and a bed in the plane: formulas for a disc, and the search for any grain."""

import math

import numpy as np
import pytest

from incipient.geometry.gaps import NearBed
from incipient.geometry.placement import Placement
from incipient.geometry.plane.bed import Bed, Flat, HalfDiscs
from incipient.geometry.plane.disc_near_bed import disc_near_bed
from incipient.geometry.plane.grain import Disc, Ellipse
from incipient.geometry.plane.polyline import Polyline

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
def test_formulas_agree_with_the_search_over_outlines(bed: Bed) -> None:
    """The search samples outlines of any shape; here an ellipse that is round, for which formulas do not serve.

    Places where disc and bed cross are left out. Where two minima merge the search may see one where formulas see
    two, so each that it sees is looked for.
    """
    random = np.random.default_rng(25)
    for radius, x, above in random.uniform((0.2, -2.0, 0.001), (0.8, 2.0, 0.6), (24, 3)):
        centre = (x, float(bed.height([x])[0]) + radius + above)
        if float(bed.distance(np.array([centre]))[0]) < radius:
            continue
        formula = disc_near_bed(centre, radius, bed, 0.3)
        assert formula is not None
        for gap, point in zip(*_searched(radius, centre, bed), strict=True):
            away = np.hypot(*(formula[1] - point).T)
            near = int(np.argmin(away))
            assert away[near] < 0.02 * radius
            assert formula[0][near] == pytest.approx(gap, abs=1e-6 * radius)


def _searched(
    radius: float, centre: tuple[float, float], bed: Bed
) -> tuple[np.ndarray, np.ndarray]:
    """Gaps, and the bed's points there."""
    found = NearBed(Ellipse((radius, radius)), bed).gaps(Placement(centre), 0.25)
    return found.gaps, found.points - found.gaps[:, None] * found.normals


def test_a_disc_within_the_bed_is_left_to_the_search() -> None:
    assert disc_near_bed((0.0, 0.4), 0.3, HalfDiscs(0.5, 1.0), 0.1) is None
