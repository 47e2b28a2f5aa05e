"""The closed space next to the contacts of a grain in the plane: its geometry, and the load of its pressure."""

from itertools import pairwise

import numpy as np
import pytest

from incipient.coupled.enclosed import load_of
from incipient.errors import SceneError
from incipient.geometry.closest import rest, touching
from incipient.geometry.plane.beds import Flat, HalfDiscs, Sinusoidal
from incipient.geometry.plane.closing import closing
from incipient.geometry.plane.curves import part
from incipient.geometry.plane.grains import Disc, Discs, Ellipse, Polygon, Superellipse

GRAINS = {
    "disc": Disc(1.0),
    "ellipse": Ellipse((0.7, 0.4)),
    "square": Polygon([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]),
    "superellipse": Superellipse((0.6, 0.4), 3.0),
    "two discs": Discs([[0.0, 0.0], [0.7, 0.0]], [0.4, 0.5]),
}
BEDS = {"flat": Flat(), "wavy": Sinusoidal(0.3, 1.5), "half-discs": HalfDiscs(0.5, 1.2)}


def closed(grain, bed, x=0.6, angle=0.0, width=0.01):
    placement = rest(grain, bed, x, angle)
    contacts = touching(grain, placement, bed, 1e-6).points[:, :2]
    return closing(
        tuple(curve.moved(placement) for curve in grain.drawn()), bed, contacts, width
    ), placement


@pytest.mark.parametrize("angle", [0.0, 0.3])
@pytest.mark.parametrize("bed", BEDS)
@pytest.mark.parametrize("grain", GRAINS)
def test_the_lines_are_as_long_as_the_width_and_the_outline_goes_from_one_to_the_other(
    grain, bed, angle
):
    found, _ = closed(GRAINS[grain], BEDS[bed], angle=angle)
    for line in (found.left, found.right):
        assert line.length == pytest.approx(
            0.01, rel=0.03
        )  # where a crumb of a curve is left out it is longer
        assert BEDS[bed].distance([line.start])[0] == pytest.approx(0.0, abs=1e-9)
    x = found.contacts[:, 0]
    assert found.left.start[0] <= x.min() and x.max() <= found.right.start[0]
    assert found.outline[0].start == pytest.approx(found.right.end, abs=1e-9)
    assert found.outline[-1].end == pytest.approx(found.left.end, abs=1e-9)
    for one, other in pairwise(found.outline):
        assert one.end == pytest.approx(other.start, abs=1e-9)
    s = np.linspace(0.0, 1.0, 50)
    distances = BEDS[bed].distance(np.vstack([curve.point(s) for curve in found.outline]))
    assert distances.min() > (0.0099 if grain == "disc" else 0.0)


@pytest.mark.parametrize("grain", GRAINS)
def test_a_pressure_that_is_the_same_all_round_neither_pushes_nor_turns(grain):
    """What is enclosed and what is exposed close the outline; the second by quadrature along its curves."""
    found, placement = closed(GRAINS[grain], BEDS["wavy"], angle=0.3)
    s = np.linspace(0.0, 1.0, 2001)
    exposed = np.vstack([curve.point(s) for curve in found.outline]) - placement.centre
    force, couple = load_of(exposed, np.full(len(exposed) - 1, 3.0))
    below = np.vstack([found.left.end, found.contacts, found.right.end]) - placement.centre
    others = load_of(below, np.full(len(below) - 1, 3.0))
    assert force + others[0] == pytest.approx(0.0, abs=1e-8)
    assert couple + others[1] == pytest.approx(0.0, abs=1e-8)


def test_the_load_of_a_pressure_below_a_disc_is_its_integral():
    """On the lower right quarter of a unit circle it is p (-1, 1), through the circle's centre."""
    angles = np.linspace(-np.pi / 2, 0.0, 3)
    arms = np.column_stack([2.0 + np.cos(angles), np.sin(angles)])
    force, couple = load_of(arms, np.array([1.5, 1.5]))
    # The centre lies two to the right of where the couple is about.
    assert force == pytest.approx([-1.5, 1.5, 0.0])
    assert couple == pytest.approx([0.0, 0.0, 2.0 * 1.5])


def test_a_part_of_a_curve_lies_on_it():
    for grain in GRAINS.values():
        curve = grain.drawn()[0]
        found = part(curve, 0.2, 0.7)
        assert found.start == pytest.approx(curve.point([0.2])[0], abs=1e-12)
        assert found.end == pytest.approx(curve.point([0.7])[0], abs=1e-12)
        middle = grain.level(found.point([0.5]))
        assert middle == pytest.approx(0.0, abs=1e-6)


def test_a_space_that_is_nowhere_wider_is_refused():
    with pytest.raises(SceneError, match=r"contact\.gap"):
        closed(GRAINS["disc"], BEDS["flat"], width=2.0)


def test_edges_of_an_open_outline_are_put_in_order_from_one_end_to_the_other():
    """An outline whose contacts are closed has two ends; its edges come in any order and sense."""
    from incipient.pictures.mesh import directed

    shuffled = np.array([[2, 3, 12], [1, 0, 10], [4, 3, 13], [1, 2, 11]])
    found = directed(shuffled)
    assert found[:, 2].tolist() in ([10, 11, 12, 13], [13, 12, 11, 10])
    assert (found[1:, 0] == found[:-1, 1]).all()
