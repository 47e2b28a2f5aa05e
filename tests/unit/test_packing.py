"""Beds of spheres in layers and in disorder."""

import numpy as np
import pytest

from incipient.errors import SceneError
from incipient.geometry import Hemispheres, Sphere, rest
from incipient.geometry.space.beds import LOWEST


@pytest.mark.parametrize(
    ("arrangement", "rise"), [("square", 0.5**0.5), ("triangular", (2.0 / 3.0) ** 0.5)]
)
def test_layers_lie_in_pockets_and_touch(arrangement, rise):
    """Spheres that touch: the height of a pyramid on a square, and on a triangle, with equal edges."""
    bed = Hemispheres(0.5, 1.0, arrangement, layers=3)
    centres = bed.centres_near((0.0, 0.0), 6.0)
    assert np.unique(centres[:, 2].round(9)) == pytest.approx([0.0, rise, 2 * rise])
    apart = np.linalg.norm(centres[:, None] - centres, axis=2) + 9.0 * np.eye(len(centres))
    assert apart.min() == pytest.approx(1.0)
    assert (
        bed.crest
        == pytest.approx(2 * rise + 0.5)
        == pytest.approx(float(bed.height(centres[:, :2]).max()))
    )


def test_disorder_is_the_same_wherever_it_is_looked_at_and_keeps_spheres_apart():
    bed = Hemispheres(0.5, 1.2, "random", seed=3)
    whole = bed.centres_near((0.0, 0.0), 15.0)
    part = bed.centres_near((4.0, -3.0), 2.0)
    assert all((np.abs(whole - one).max(axis=1) < 1e-12).any() for one in part)
    apart = np.linalg.norm(whole[:, None, :2] - whole[:, :2], axis=2) + 9.0 * np.eye(len(whole))
    assert 1.0 <= apart.min() < 1.05
    assert -LOWEST * 0.5 <= whole[:, 2].min() < -0.2 and whole[:, 2].max() <= 0.0
    assert not np.allclose(
        whole[:5], Hemispheres(0.5, 1.2, "random", seed=4).centres_near((0.0, 0.0), 15.0)[:5]
    )


def test_a_sphere_rests_on_disorder():
    bed = Hemispheres(0.5, 1.2, "random", seed=3, layers=2)
    grain = Sphere(1.0)
    placement = rest(grain, bed, (0.2, 0.1))
    centres = bed.centres_near((0.2, 0.1), 4.0)
    assert np.linalg.norm(centres - placement.centre, axis=1).min() == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize(
    ("keys", "words"), [({"layers": 0}, "is none"), ({"spacing": 4.0, "layers": 2}, "so far apart")]
)
def test_what_is_no_packing_is_refused(keys, words):
    with pytest.raises(SceneError, match=words):
        Hemispheres(**{"radius": 0.5, "spacing": 1.0, **keys})
