"""The angle of repose of a bead in the pockets of a bed of spheres against geometry, for every spacing and size.

A force through the bead's centre rolls it over the line through the centres of the spheres ahead of it as soon as the
resultant with its weight points beyond that line: tan(angle) = distance ahead / height above. The spheres behind could
hold it only with more friction than the height over the distance to them, above which a contact may pull down.
"""

from __future__ import annotations

from math import atan2, degrees, sqrt

import numpy as np
import pytest

from incipient.contact import Load
from incipient.contact.safety import safety_factor
from incipient.contact.verdict import judge
from incipient.geometry.closest import touching
from incipient.geometry.placement import Placement
from incipient.geometry.space.beds import SphereBed
from incipient.geometry.space.grains import Sphere

SPACINGS = (1.0, 1.05, 1.1, 1.2, 1.3, 1.4)
SIZES = (0.6, 1.0, 1.5, 2.0)
FRICTIONS = (0.0, 0.1, 0.5)
RIGHT = np.pi / 2
# Bed and flow: squared distances in spacings from the bead to the nearest centres, and from there ahead to the line
# through those that it rolls over; the angle of the rows; which centre stands where; how many spheres it rests on.
POCKETS = {
    "square": ("square", 1 / 2, 1 / 4, 0.0, (0.5, 0.5), 4),
    "square, over one": ("square", 1 / 2, 1 / 2, RIGHT / 2, (sqrt(0.5), 0.0), 4),
    "square, on two": ("square", 1 / 4, 1 / 4, 0.0, (0.5, 0.0), 2),
    "triangular": ("triangular", 1 / 3, 1 / 12, RIGHT, (sqrt(1 / 12), 0.5), 3),
    "triangular, over one": ("triangular", 1 / 3, 1 / 3, RIGHT, (sqrt(1 / 3), 0.0), 3),
    "triangular, on two": ("triangular", 1 / 4, 1 / 4, 0.0, (0.5, 0.0), 2),
}


def case_of(pocket, spacing, size):
    """Bed, height of a bead's centre above the base plane, distance ahead; None: it would lie on the plane."""
    kind, around, ahead, angle, offset, _ = POCKETS[pocket]
    height_2 = (0.5 + 0.5 * size) ** 2 - around * spacing**2
    if height_2 <= (0.5 * size) ** 2:
        return None
    bed = SphereBed.array(
        0.5, spacing, kind, (spacing * offset[0], spacing * offset[1]), 0.0, angle
    )
    return bed, sqrt(height_2), sqrt(ahead) * spacing


def angle_of(bed, height, size, friction):
    """The angle in degrees at which a force along x moves the bead, by the exact judge; its contacts."""
    centre = (0.0, 0.0, height)
    contacts = touching(Sphere(size), Placement(centre), bed, 1e-6 * size)
    load = Load(
        np.array([1.0, 0.0, 0.0]), np.zeros(3), np.array([0.0, 0.0, -1.0]), np.array(centre)
    )
    return degrees(atan2(safety_factor(load, contacts, friction).value, 1.0)), contacts


@pytest.mark.parametrize("pocket", POCKETS)
def test_angle_of_repose_of_every_pocket(pocket):
    checked = 0
    for spacing in SPACINGS:
        for size in SIZES:
            case = case_of(pocket, spacing, size)
            if case is None:
                continue
            bed, height, ahead = case
            expected = degrees(atan2(ahead, height))
            for friction in FRICTIONS:
                found, contacts = angle_of(bed, height, size, friction)
                assert len(contacts.points) == POCKETS[pocket][-1], (spacing, size)
                assert found == pytest.approx(expected, abs=1e-5), (spacing, size, friction)
                checked += 1
    assert checked >= 45


def test_known_angles_of_equal_spheres_that_touch():
    """Bead and bed make a pyramid or a tetrahedron, whose faces lean by arctan(sqrt(2)) and arctan(sqrt(8))."""
    for pocket, face in (("square", sqrt(2.0)), ("triangular", sqrt(8.0))):
        case = case_of(pocket, 1.0, 1.0)
        assert case is not None
        assert angle_of(*case[:2], 1.0, 0.3)[0] == pytest.approx(
            90.0 - degrees(atan2(face, 1.0)), abs=1e-6
        )


@pytest.mark.parametrize("spacing", [1.25, 1.4])
def test_a_bead_on_the_base_plane_leans_on_two_spheres(spacing):
    """Where the spheres of a square bed stand farther apart than sqrt(1.5), an equal bead lies on the plane."""
    ahead = sqrt(0.75 - 0.25 * spacing**2)
    bed = SphereBed.array(0.5, spacing, "square", (ahead, 0.5 * spacing))
    found, contacts = angle_of(bed, 0.5, 1.0, 0.5)
    assert len(contacts.points) == 3
    assert found == pytest.approx(degrees(atan2(ahead, 0.5)), abs=1e-5)


@pytest.mark.parametrize(("share", "mode"), [(0.999, "rest"), (1.001, "pivoting")])
def test_beyond_that_angle_the_bead_pivots(share, mode):
    """Over two spheres at once it turns about the line through its contacts, which keep their places."""
    pocket = case_of("triangular", 1.2, 1.0)
    assert pocket is not None
    bed, height, ahead = pocket
    contacts = touching(Sphere(1.0), Placement((0.0, 0.0, height)), bed, 1e-6)
    push, centre = np.array([share * ahead / height, 0.0, 0.0]), np.array([0.0, 0.0, height])
    load = Load(push, np.zeros(3), np.array([0.0, 0.0, -1.0]), centre)
    assert judge(load, contacts, 0.5, (1.0, 0.1 * np.eye(3))).equilibrium.label == mode
