"""Beds of the plane: brute force and elementary geometry; the level plane that one acts as in shear, published."""

from itertools import pairwise

import numpy as np
import pytest
from every_shape import BEDS, dense
from scenes import CHANNEL, message, scene
from scipy.spatial import cKDTree

from incipient.geometry import Arc, Curved, Flat, Line, Spline
from incipient.geometry import HalfDiscs as HalfDiscsBed
from incipient.geometry import Polyline as PolylineBed
from incipient.geometry import Sinusoidal as SinusoidalBed
from incipient.geometry.plane.beds import effective_level
from incipient.planning.flow_setup import Setup
from incipient.scene import HalfDiscs, Poiseuille, Polyline, Shear, Sinusoidal, Uniform
from incipient.scene.example import grain_in_pocket

beds = pytest.mark.parametrize("bed", BEDS.values(), ids=BEDS.keys())


class TestBeds:
    @beds
    def test_curves_join_and_lie_on_the_bed(self, bed):
        x0, x1 = -2.3, 3.1
        curves = bed.curves(x0, x1)
        assert (curves[0].start[0], curves[-1].end[0]) == (x0, x1)
        for curve, following in pairwise(curves):
            assert curve.end == following.start
        points = dense(curves, 301)
        # Only the spline of the wavy beds is an approximation: to 1e-6 of the wavelength, which is at most 1.
        assert bed.height(points[:, 0]) == pytest.approx(points[:, 1], abs=1e-6)

    @beds
    def test_normals_by_differences(self, bed):
        x, h = np.linspace(-2.0, 2.0, 173) + 1e-3, 1e-7
        smooth = np.abs(np.subtract(*bed.side_normals(x))).max(axis=1) == 0.0
        slope = (bed.height(x + h) - bed.height(x - h)) / (2.0 * h)
        normal = np.column_stack([-slope, np.ones(len(x))]) / np.hypot(slope, 1.0)[:, None]
        steep = np.abs(slope) > 5.0
        assert bed.normal(x)[smooth & ~steep] == pytest.approx(normal[smooth & ~steep], abs=1e-5)

    @beds
    def test_nearest_point_against_brute_force(self, bed):
        generator = np.random.default_rng(1)
        x = generator.uniform(-2.0, 2.0, 60)
        points = np.column_stack([x, bed.height(x) + generator.uniform(0.0, 1.5, 60)])
        track = np.linspace(-5.0, 5.0, 400001)
        track = np.column_stack([track, bed.height(track)])
        brute, _ = cKDTree(track, balanced_tree=False).query(points)
        feet = bed.nearest(points)
        assert bed.height(feet[:, 0]) == pytest.approx(feet[:, 1], abs=1e-7)
        # Brute force can only be too large, by its spacing of 2.5e-5 on the steepest flank.
        assert np.all(bed.distance(points) <= np.array(brute) + 1e-12)
        assert bed.distance(points) == pytest.approx(brute, abs=2e-4)

    def test_distance_is_negative_below(self):
        assert Flat(1.0).distance([[0.0, 0.4], [0.0, 1.4]]) == pytest.approx([-0.6, 0.4])

    def test_half_discs(self):
        bed = HalfDiscsBed(0.5, 2.0, 0.25, 1.0)
        assert bed.height([0.25, 0.75, 1.25, 2.25]) == pytest.approx([1.5, 1.0, 1.0, 1.5])
        assert bed.corners(0.0, 2.0) == pytest.approx([0.75, 1.75])
        kinds = [type(curve) for curve in bed.curves(0.25, 2.25)]
        assert kinds == [Arc, Line, Arc]
        assert [type(c) for c in HalfDiscsBed(0.5, 1.0).curves(-0.5, 1.5)] == [Arc] * 4

    def test_half_disc_cut_at_its_foot_has_no_sliver(self):
        for x0 in (-0.5 - 1e-13, -0.5, -0.5 + 1e-13):
            curves = HalfDiscsBed(0.5, 2.0).curves(x0, 0.0)
            assert len(curves) == 1
            assert curves[0].start == (x0, 0.0)

    def test_spline_error_is_below_a_millionth_of_the_wavelength(self):
        for amplitude in (0.01, 0.1, 0.5):
            bed = SinusoidalBed(amplitude, 2.0, 1.0)
            (curve,) = bed.curves(0.3, 4.9)
            x, y = curve.point(np.linspace(0.0, 1.0, 20011)).T
            assert np.abs(bed.height(x) - y).max() < 1e-6 * 2.0


def test_the_nearest_place_on_a_long_smooth_curve_is_found():
    """Two hundred waves, for which its lines are long: distances as from four million points on it."""
    x = np.linspace(0.0, 400.0, 1601)
    bed = Curved(np.column_stack([x, 0.1 * np.cos(np.pi * x)]))
    above, dense = np.array([[150.3, 0.35], [201.12, 0.02]]), np.linspace(149.0, 203.0, 4_000_001)
    away = [np.hypot(dense - one[0], bed.height(dense) - one[1]).min() for one in above]
    assert np.linalg.norm(above - bed.nearest(above), axis=1) == pytest.approx(away, abs=1e-9)


def test_a_smooth_curve_through_points_of_a_circle_is_that_circle():
    """Radius 2 between two level stretches: as high as the circle to 1e-4, and its radius found from the points."""
    x = np.linspace(-1.0, 1.0, 41)
    arc = np.column_stack([x, np.sqrt(4.0 - x**2) - np.sqrt(3.0)])
    bed = Curved([(-4.0, 0.0), *arc, (4.0, 0.0)])
    within = np.linspace(-0.9, 0.9, 301)
    assert bed.height(within) == pytest.approx(np.sqrt(4.0 - within**2) - np.sqrt(3.0), abs=1e-4)
    assert bed.nearest([[0.5, 1.0]]) == pytest.approx(
        np.array([[0.5, 1.0 + 3.0**0.5]]) * 2.0 / np.hypot(0.5, 1.0 + 3.0**0.5) - [0.0, 3.0**0.5],
        abs=2e-3,
    )
    assert Curved(arc).feature == pytest.approx(2.0, rel=1e-3)
    assert [type(one) for one in bed.curves(-3.0, 3.0)] == [Line, Spline, Line]
    assert not np.isfinite(Curved([(0.0, 0.0), (1.0, 0.5), (3.0, 1.5)]).feature)


def test_a_polyline_may_step_vertically():
    """The x of the step belongs to its right side; it is a line of the bed, and it has no part in the mean."""
    bed = PolylineBed([(0, 1), (2, 1), (2, 0), (6, 0)])
    assert bed.feature == 1.0 and bed.mean(0, 6) == pytest.approx(2 / 6)
    assert bed.height([1.9, 2.0, 2.1]) == pytest.approx([1, 0, 0])
    assert [(line.start, line.end) for line in bed.curves(1, 6)] == [
        ((1, 1), (2, 1)),
        ((2, 1), (2, 0)),
        ((2, 0), (6, 0)),
    ]
    assert bed.nearest([(2.5, 0.7)]) == pytest.approx(np.array([[2.0, 0.7]]))
    assert bed.corners(0, 6) == pytest.approx([0, 2, 6])


# Beds, Reynolds number of shear rate 1 on the length 1, and the effective height found in one period with P2-P1
# elements and inertia (cells of 1/20, on ripples 1/25 of the wavelength); how far that may be off.
MEASURED = [
    (HalfDiscs(radius=0.5, spacing=1.2), 1e-9, 0.44680, 1e-4),
    (HalfDiscs(radius=0.5, spacing=2.0), 1e-9, 0.39354, 1e-4),
    (HalfDiscs(radius=0.5, spacing=6.0), 1e-9, 0.19362, 6e-4),
    (HalfDiscs(radius=0.5, spacing=1.05), 20.0, 0.45678, None),
    (HalfDiscs(radius=0.5, spacing=1.2), 20.0, 0.44802, None),
    (HalfDiscs(radius=0.5, spacing=1.2), 60.0, 0.45065, None),
    (HalfDiscs(radius=0.5, spacing=1.2), 1000.0, 0.46464, None),
    (HalfDiscs(radius=0.5, spacing=3.0), 60.0, 0.37395, None),
    (HalfDiscs(radius=0.5, spacing=6.0), 20.0, 0.24613, None),
    (HalfDiscs(radius=0.5, spacing=6.0), 1000.0, 0.39328, None),
    (Sinusoidal(amplitude=0.5, wavelength=4.0), 20.0, 0.32522, None),
    (Sinusoidal(amplitude=0.5, wavelength=4.0), 1000.0, 0.41175, None),
]


@pytest.mark.parametrize("amplitude", [0.005, 0.01, 0.02])
def test_low_ripples(amplitude):
    """d = a^2 k + O(a^4 k^3): u = y - a sin(kx) (1 - ky) exp(-ky) + u_2, and the mean of u_2 on the bed is -a^2 k."""
    k = 2.0 * np.pi
    found = effective_level(SinusoidalBed(amplitude, 1.0, 0.3, 7.0))
    assert found == pytest.approx(amplitude**2 * k, rel=(amplitude * k) ** 2 + 1e-3)


def test_where_a_bed_begins_does_not_matter():
    rows = [HalfDiscsBed(0.5, 1.2, offset, base) for offset, base in ((0, 0), (0.7, 0), (1e4, 1e3))]
    assert len({effective_level(row) for row in rows}) == 1


@pytest.mark.parametrize("spacing", [1.0, 1.0001, 1.01, 1.2, 60.0])
def test_between_base_and_crests(spacing):
    """It falls with the distance of the half-discs, and touching ones leave little below the crests."""
    found = effective_level(HalfDiscsBed(0.5, spacing))
    farther = effective_level(HalfDiscsBed(0.5, 1.1 * spacing))
    assert 0.0 < farther < found < 0.4592


@pytest.mark.parametrize(("forms", "reynolds", "height", "error"), MEASURED)
def test_against_finite_elements(forms, reynolds, height, error):
    """With inertia within the uncertainty that is said; without the panels' error."""
    found = Setup(
        scene(bed=forms, fluid={"reynolds": reynolds, "scale": "grain"})
    ).base_flow.effective_height
    assert found.height == pytest.approx(height, abs=error or found.uncertainty)
    assert found.height >= found.creeping


def test_the_datum_is_the_effective_height_where_a_stream_shears_a_row_of_forms():
    row = HalfDiscs(radius=0.5, spacing=1.2)
    assert (
        Setup(scene(bed=row)).base_flow.datum
        == Setup(scene(bed=row)).base_flow.effective_height.height
    )
    slow = {"reynolds": 20, "scale": "grain", "inertia": False}
    assert Setup(scene(bed=row, fluid=slow)).base_flow.datum == pytest.approx(0.4468, abs=1e-4)
    between_walls = scene(bed=row, flow=Poiseuille(velocity=1.0))  # sheared at 6 V over the depth
    same = scene(
        bed=row, flow=Shear(rate=6 / 5.5), fluid={"reynolds": 20 * 6 / 5.5, "scale": "grain"}
    )
    assert Setup(between_walls).base_flow.datum == pytest.approx(
        Setup(same).base_flow.datum, rel=1e-12
    )
    for crests in (
        {"flow": Uniform()},
        {"bed": Sinusoidal(amplitude=0.5, wavelength=CHANNEL.length)},
    ):
        assert Setup(scene(**{"bed": row, **crests})).base_flow.datum == pytest.approx(0.5)
    points = [(0.6 * k, 0.5 * (k % 2)) for k in range(21)]
    assert Setup(scene(bed=Polyline(points=points))).base_flow.datum == 0.5
    flow = Shear(datum="effective")
    asked = message(lambda: Setup(scene(bed=Polyline(points=points), flow=flow)).base_flow.datum)
    assert asked.startswith('flow.datum: is "effective" over a Polyline bed')


def test_in_space_it_is_refused():
    assert Setup(grain_in_pocket()).base_flow.datum == grain_in_pocket().bed_shape.crest
    asked = {**grain_in_pocket().model_dump(), "flow": {"kind": "shear", "datum": "effective"}}
    found = message(lambda: type(grain_in_pocket())(**asked))
    assert 'flow.datum: is "effective" in 3-D, where it is not computed; use "auto"' in found
