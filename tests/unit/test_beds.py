"""Beds: curves, profiles and heights."""

from itertools import pairwise

import numpy as np
import pytest
from every_shape import BEDS, TERRAINS, dense
from PIL import Image
from scenes import CHANNEL, grain_in_pocket, message, scene

from incipient.geometry import Curved, HeightMap, SphereBed, Spline
from incipient.geometry import HalfDiscs as HalfDiscsBed
from incipient.geometry import Polyline as PolylineBed
from incipient.geometry import Sinusoidal as SinusoidalBed
from incipient.geometry.plane.beds import effective_level
from incipient.geometry.space.beds import LOWEST
from incipient.scene import HalfDiscs, Poiseuille, Polyline, Shear, Sinusoidal, Uniform
from incipient.scene.beds import HeightMapBed
from incipient.setup.setup import Setup

# Beds by brute force and elementary geometry; the level plane that one acts as in shear, published.


beds = pytest.mark.parametrize("bed", BEDS.values(), ids=BEDS.keys())
EVERY_BED = BEDS | TERRAINS
every_bed = pytest.mark.parametrize("bed", EVERY_BED.values(), ids=EVERY_BED.keys())


def places(bed, x):
    """Points (n, gdim - 1) as the bed takes them."""
    return x if bed.gdim == 3 else x[:, 0]


@every_bed
def test_normals_and_hessians_by_differences(bed):
    x, h = np.random.default_rng(2).uniform(-2.0, 2.0, (80, bed.gdim - 1)), 1e-6
    steps = h * np.eye(bed.gdim - 1)
    ahead, behind = ([bed.height(places(bed, x + s * e)) for e in steps] for s in (1.0, -1.0))
    slope = np.subtract(ahead, behind).T / (2 * h)
    normals = np.column_stack([-slope, np.ones(len(x))])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    gentle = np.abs(slope).max(axis=1) < 5.0
    assert bed.normal(places(bed, x))[gentle] == pytest.approx(normals[gentle], abs=1e-5)
    if hasattr(bed, "shape"):
        rows = [(bed.gradient(x + e) - bed.gradient(x - e)) / (2 * h) for e in steps]
        error = np.abs(np.stack(rows, axis=2) - bed.shape(x)[2]).max(axis=(1, 2))
        assert np.median(error) < 1e-6  # that of the map jumps between cells


@every_bed
def test_nearest_point_against_brute_force(bed):
    """No farther than straight below; brute force can only be too large, by its spacing on the steepest flank."""
    generator, d = np.random.default_rng(3), bed.gdim - 1
    x = generator.uniform(-2.0, 2.0, (30, d))
    points = np.column_stack(
        [x, bed.height(places(bed, x)) + generator.uniform(0.0, (1.5, 0.3)[d - 1], 30)]
    )
    along = np.linspace(-1.5, 1.5, 120_001) if d == 1 else np.linspace(-0.3, 0.3, 121)
    offsets = np.stack(np.meshgrid(*[along] * d), -1).reshape(-1, d)
    brute = [
        np.sqrt((offsets**2).sum(1) + (bed.height(places(bed, p[:d] + offsets)) - p[d]) ** 2).min()
        for p in points
    ]
    distance, feet = bed.distance(points), bed.nearest(points)
    assert bed.height(places(bed, feet[:, :d])) == pytest.approx(feet[:, d], abs=1e-7)
    assert (distance <= np.array(brute) + 1e-12).all()
    assert distance == pytest.approx(brute, abs=(2e-4, 5e-3)[d - 1])
    assert (bed.distance(points - [*[0.0] * d, 0.5]) < 0.0).any()


@beds
def test_curves_join_and_lie_on_the_bed(bed):
    x0, x1 = -2.3, 3.1
    curves = bed.curves(x0, x1)
    assert (curves[0].start[0], curves[-1].end[0]) == (x0, x1)
    for curve, following in pairwise(curves):
        assert curve.end == following.start
    points = dense(curves, 5001)
    # Only the spline of the wavy beds is an approximation: to 1e-6 of the wavelength, which is at most 1.
    assert bed.height(points[:, 0]) == pytest.approx(points[:, 1], abs=1e-6)


@pytest.mark.parametrize("x0", [-0.5 - 1e-13, -0.5, -0.5 + 1e-13])
def test_half_disc_cut_at_its_foot_has_no_sliver(x0):
    (curve,) = HalfDiscsBed(0.5, 2.0).curves(x0, 0.0)
    assert curve.start == (x0, 0.0)


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
    assert [type(curve) for curve in bed.curves(-3.0, 3.0)] == [Spline]
    assert not np.isfinite(Curved([(0.0, 0.0), (1.0, 0.5), (3.0, 1.5)]).feature)


def test_a_polyline_may_step_vertically():
    """The x of the step belongs to its right side; it is a line of the bed, and it has no part in the mean."""
    bed = PolylineBed([(0, 1), (2, 1), (2, 0), (6, 0)])
    assert bed.feature == 1.0 and bed.mean((0, 6)) == pytest.approx(2 / 6)
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
    result = effective_level(SinusoidalBed(amplitude, 1.0, 0.3, 7.0))
    assert result == pytest.approx(amplitude**2 * k, rel=(amplitude * k) ** 2 + 1e-3)


@pytest.mark.parametrize(("forms", "reynolds", "height", "error"), MEASURED)
def test_against_finite_elements(forms, reynolds, height, error):
    """With inertia within the uncertainty that is said; without the panels' error."""
    result, uncertainty = Setup(
        scene(bed=forms, fluid={"reynolds": reynolds, "scale": "grain"})
    ).base_flow.effective_height
    assert result == pytest.approx(height, abs=error or uncertainty)


ROW = HalfDiscs(radius=0.5, spacing=1.2)
ZIGZAG = Polyline(points=[(0.6 * k, 0.5 * (k % 2)) for k in range(21)])


def datum_of(**changes):
    return Setup(scene(**{"bed": ROW, **changes})).base_flow.datum


@pytest.mark.parametrize(
    ("changes", "datum"),
    [
        ({}, 0.44802),
        ({"fluid": {"reynolds": 20, "scale": "grain", "inertia": False}}, 0.4468),
        # Elsewhere it is the crest.
        ({"flow": Uniform()}, 0.5),
        ({"bed": Sinusoidal(amplitude=0.5, wavelength=CHANNEL.length)}, 0.5),
        ({"bed": ZIGZAG}, 0.5),
    ],
)
def test_the_datum_is_the_effective_height_where_a_stream_shears_a_row_of_forms(changes, datum):
    assert datum_of(**changes) == pytest.approx(datum, abs=1e-4)


def test_a_stream_between_walls_shears_a_row_at_six_times_its_mean_speed_over_the_depth():
    same = {"flow": Shear(rate=6 / 5.5), "fluid": {"reynolds": 20 * 6 / 5.5, "scale": "grain"}}
    between_walls = datum_of(flow=Poiseuille(velocity=1.0))
    assert between_walls == pytest.approx(datum_of(**same), rel=1e-12)


def test_the_effective_height_of_points_is_not_computed():
    asked = message(lambda: datum_of(bed=ZIGZAG, flow=Shear(datum="effective")))
    assert asked.startswith('flow.datum: is "effective" over a Polyline bed')


def test_in_space_it_is_the_crest():
    assert Setup(grain_in_pocket()).base_flow.datum == grain_in_pocket().bed_shape.crest


# Beds in 3-D: slopes by differences, nearest points by brute force, height maps from files, layers of spheres.


def test_a_map_reproduces_its_points_and_parabolas():
    # Cubic convolution is exact for polynomials of second degree (Keys 1981), away from the edges.
    x, y = np.meshgrid(np.arange(8.0), 2.0 * np.arange(9.0))
    bed = HeightMap(1.0 + x * y - 0.3 * x**2 + 0.1 * y**2, (1.0, 2.0), (10.0, 20.0, 5.0))
    inner = np.random.default_rng(1).uniform([11.0, 22.0], [16.0, 34.0], (50, 2))
    u, v = (inner - [10.0, 20.0]).T
    assert bed.height(inner) == pytest.approx(6.0 + u * v - 0.3 * u**2 + 0.1 * v**2)
    assert bed.gradient(inner)[:, 0] == pytest.approx(v - 0.6 * u)
    assert bed.height([[13.0, 26.0]]) == pytest.approx(5.0 + bed.heights[3, 3])
    assert bed.extent == ((10.0, 17.0), (20.0, 36.0))
    # Beyond the edge it goes on level.
    assert bed.height([[5.0, 26.0]]) == pytest.approx(bed.height([[10.0, 26.0]]))
    assert bed.gradient([[5.0, 26.0]])[0, 0] == 0.0


HEIGHTS = np.arange(12.0).reshape(3, 4)
# A relief in thousandths that passes through values that may stand for holes is data.
DEEP = np.arange(-11999.0, 1.0).reshape(100, 120)


def as_image(heights, kind):
    """What writes an image of heights, whose first row is the northern one, in numbers of a kind."""
    return Image.fromarray(heights[::-1].astype(kind)).save


def as_array(heights):
    return lambda path: np.save(path, heights)


def as_text(text):
    return lambda path: path.write_text(text)


@pytest.mark.parametrize(
    ("name", "write", "heights"),
    [
        ("map.npy", as_array(HEIGHTS), HEIGHTS),
        ("deep.npy", as_array(DEEP), DEEP),
        # Whole numbers are parts of the largest.
        ("map.png", as_image(20 * HEIGHTS, np.uint8), 20 * HEIGHTS / 255),
        ("fine.png", as_image(4000 * HEIGHTS, np.uint16), 4000 * HEIGHTS / 65535),
        ("map.tif", as_image(HEIGHTS, np.float32), HEIGHTS),
    ],
)
def test_maps_are_read_from_files(name, write, heights, tmp_path):
    write(tmp_path / name)
    result = HeightMap.from_file(tmp_path / name, (0.1, 0.1)).heights
    assert result == pytest.approx(heights, rel=1e-7)


def test_a_grid_of_esri_begins_with_the_northern_row(tmp_path):
    """Cells are 2 wide, so that the first height stands one in from the corner."""
    rows = "\n".join(" ".join(str(h) for h in row) for row in HEIGHTS[::-1])
    head = "ncols 4\nnrows 3\nxllcorner 10\nyllcorner 20\ncellsize 2\nNODATA_value -9999\n"
    (tmp_path / "map.asc").write_text(head + rows + "\n")
    grid = HeightMap.from_file(tmp_path / "map.asc")
    assert grid.heights == pytest.approx(HEIGHTS)
    assert (grid.cell, grid.origin) == ((2.0, 2.0), (11.0, 21.0, 0.0))


TWO_BY_TWO = "ncols 2\nnrows 2\ncellsize 1\n"


@pytest.mark.parametrize(
    ("name", "write", "cell", "reason"),
    [
        ("missing.png", str, None, "No such file or directory"),
        ("map.asc", as_text(f"{TWO_BY_TWO}NODATA_value -9\n1 2\n3 -9\n"), None, "cells without data"),
        ("short.asc", as_text(f"{TWO_BY_TWO}1 2 3\n"), None, "3 heights instead of 2 x 2"),
        ("bare.asc", as_text("1 2\n3 4\n"), None, "lacks ncols"),
        (
            *("hole.asc", as_text(f"{TWO_BY_TWO}1 2\n3 -9999\n"), None),
            "is -9999 in 1 of its cells, the first in row 0, column 1: that seems to stand",
        ),
        ("map.png", as_text("no image"), None, "cannot be read"),
        ("map.npy", as_array(np.zeros((3, 3))), None, "give cell"),
        (
            *("hole.npy", as_array(np.where(np.eye(3) > 0.0, -32768.0, 1.0)), (1.0, 1.0)),
            "is -32768 in 3 of its cells",
        ),
    ],
)  # fmt: skip
def test_bad_maps_are_refused(name, write, cell, reason, tmp_path):
    write(tmp_path / name)
    assert reason in message(lambda: HeightMap.from_file(tmp_path / name, cell))


@pytest.mark.parametrize(
    ("given", "place"), [({}, (340621.0, 3917731.0)), ({"offset": (-1.0, 4.0)}, (-1.0, 4.0))]
)
def test_offset_is_where_the_first_height_is(given, place, tmp_path):
    """The corner of a grid in metres of a map is far from any domain; a cell's middle is half a cell from it."""
    head = "ncols 3\nnrows 2\nxllcorner 340620\nyllcorner 3917730\ncellsize 2\n"
    (tmp_path / "map.asc").write_text(head + "1 1 1\n1 1 1\n")
    keys = {"kind": "height-map", "file": "map.asc", **given}
    bed = HeightMapBed.model_validate(keys, context={"directory": str(tmp_path)})
    assert bed.offset == place
    assert tuple(low for low, _ in bed.shape(0.0, (0.0, 0.0)).extent) == place


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda: HeightMap(np.zeros(3), (1.0, 1.0)), "rows and columns"),
        (lambda: HeightMap([[0.0, np.nan], [0.0, 0.0]], (1.0, 1.0)), "row 0, column 1"),
        (lambda: SphereBed.array(0.5, 1.0, layers=0), "none"),
        (lambda: SphereBed.array(0.5, 4.0, layers=2), "so far apart"),
    ],
)
def test_bad_beds_are_refused(make, reason):
    assert reason in message(make)


@pytest.mark.parametrize(
    ("arrangement", "rise"), [("square", 0.5**0.5), ("triangular", (2.0 / 3.0) ** 0.5)]
)
def test_layers_lie_in_pockets_and_touch(arrangement, rise):
    """Spheres that touch: the height of a pyramid on a square, and on a triangle, with equal edges."""
    bed = SphereBed.array(0.5, 1.0, arrangement, layers=3)
    centres = bed.near((0.0, 0.0), 5.50)[1]
    assert np.unique(centres[:, 2].round(9)) == pytest.approx([0.0, rise, 2 * rise])
    apart = np.linalg.norm(centres[:, None] - centres, axis=2) + 9.0 * np.eye(len(centres))
    assert apart.min() == pytest.approx(1.0)
    assert (
        bed.crest
        == pytest.approx(2 * rise + 0.5)
        == pytest.approx(float(bed.height(centres[:, :2]).max()))
    )


def test_disorder_is_the_same_wherever_it_is_looked_at_and_keeps_spheres_apart():
    bed = SphereBed.array(0.5, 1.2, "random", seed=3)
    whole = bed.near((0.0, 0.0), 14.50)[1]
    part = bed.near((4.0, -3.0), 1.50)[1]
    assert all((np.abs(whole - one).max(axis=1) < 1e-12).any() for one in part)
    apart = np.linalg.norm(whole[:, None, :2] - whole[:, :2], axis=2) + 9.0 * np.eye(len(whole))
    assert 1.0 <= apart.min() < 1.05
    assert -LOWEST * 0.5 <= whole[:, 2].min() < -0.2 and whole[:, 2].max() <= 0.0
    assert not np.allclose(
        whole[:5], SphereBed.array(0.5, 1.2, "random", seed=4).near((0.0, 0.0), 14.50)[1][:5]
    )
