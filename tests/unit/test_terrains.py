"""Beds in 3-D: slopes by differences, nearest points by brute force, height maps from files, layers of spheres."""

import numpy as np
import pytest
from every_shape import terrains

from incipient.errors import SceneError
from incipient.geometry import HeightMap, Sphere, SphereBed, rest
from incipient.geometry.space.beds import LOWEST
from incipient.scene.terrains import HeightMapBed


class TestTerrains:
    @terrains
    def test_gradients_normals_and_hessians_by_differences(self, bed):
        x, h = np.random.default_rng(2).uniform(-2.0, 2.0, (80, 2)), 1e-6
        slope = np.column_stack(
            [(bed.height(x + h * e) - bed.height(x - h * e)) / (2 * h) for e in np.eye(2)]
        )
        gentle = np.abs(slope).max(axis=1) < 5.0
        assert bed.gradient(x)[gentle] == pytest.approx(slope[gentle], abs=1e-5)
        expected = np.column_stack([-slope, np.ones(len(x))])
        expected /= np.linalg.norm(expected, axis=1, keepdims=True)
        assert bed.normal(x)[gentle] == pytest.approx(expected[gentle], abs=1e-5)
        if hasattr(bed, "shape"):
            rows = [
                (bed.gradient(x + h * e) - bed.gradient(x - h * e)) / (2 * h) for e in np.eye(2)
            ]
            error = np.abs(np.stack(rows, axis=2) - bed.shape(x)[2]).max(axis=(1, 2))
            assert np.median(error) < 1e-6  # that of the map jumps between cells

    @terrains
    def test_nearest_point_against_brute_force(self, bed):
        generator = np.random.default_rng(3)
        x = generator.uniform(-2.0, 2.0, (30, 2))
        points = np.column_stack([x, bed.height(x) + generator.uniform(0.0, 0.3, 30)])
        # No farther than straight below; they lie 5e-3 apart.
        along = np.linspace(-0.3, 0.3, 121)
        offsets = np.stack(np.meshgrid(along, along), -1).reshape(-1, 2)
        brute = []
        for point in points:
            around = point[:2] + offsets
            brute.append(
                np.sqrt(
                    ((around - point[:2]) ** 2).sum(1) + (bed.height(around) - point[2]) ** 2
                ).min()
            )
        distance, feet = bed.distance(points), bed.nearest(points)
        assert bed.height(feet[:, :2]) == pytest.approx(feet[:, 2], abs=1e-7)
        # Brute force can only be too large, by its spacing of 5e-3 on the steepest flank.
        assert (distance <= np.array(brute) + 1e-12).all()
        assert distance == pytest.approx(brute, abs=5e-3)
        assert (bed.distance(points - [0, 0, 0.5]) < 0.0).any()

    def test_neighbours_of_the_arrays(self):
        """Square: 4 neighbours at the spacing; triangular: 6."""
        for arrangement, count in (("square", 4), ("triangular", 6)):
            bed = SphereBed.array(0.5, 1.3, arrangement, (0.2, 0.1))
            centres = bed.near((0.2, 0.1), 0.81)[1]
            away = np.linalg.norm(centres[:, :2] - [0.2, 0.1], axis=1)
            assert np.sort(away) == pytest.approx([0.0] + [1.3] * count)
            assert bed.height(centres[:, :2]) == pytest.approx(0.5)

    def test_a_map_reproduces_its_points_and_parabolas(self):
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

    def test_maps_from_files(self, tmp_path):
        from PIL import Image

        heights = np.arange(12.0).reshape(3, 4)
        np.save(tmp_path / "map.npy", heights)
        assert HeightMap.from_file(tmp_path / "map.npy", (0.1, 0.1), 2.0).heights == pytest.approx(
            2.0 * heights
        )
        # Images and ESRI grids begin with the northern row; whole numbers are parts of the largest.
        Image.fromarray((heights[::-1] * 20).astype(np.uint8)).save(tmp_path / "map.png")
        Image.fromarray((heights[::-1] * 4000).astype(np.uint16)).save(tmp_path / "fine.png")
        Image.fromarray(heights[::-1].astype(np.float32)).save(tmp_path / "map.tif")
        for name, relief in (
            ("map.png", 255.0 / 20.0),
            ("fine.png", 65535.0 / 4000.0),
            ("map.tif", 1.0),
        ):
            found = HeightMap.from_file(tmp_path / name, (0.1, 0.1), relief)
            assert found.heights == pytest.approx(heights, abs=1e-6), name
        rows = "\n".join(" ".join(str(h) for h in row) for row in heights[::-1])
        head = "ncols 4\nnrows 3\nxllcorner 10\nyllcorner 20\ncellsize 2\nNODATA_value -9999\n"
        (tmp_path / "map.asc").write_text(head + rows + "\n")
        grid = HeightMap.from_file(tmp_path / "map.asc")
        assert grid.heights == pytest.approx(heights)
        # Cells are 2 wide, so that the first height stands one in from the corner.
        assert (grid.cell, grid.origin) == ((2.0, 2.0), (11.0, 21.0, 0.0))

    def test_bad_maps(self, tmp_path):
        (tmp_path / "map.asc").write_text(
            "ncols 2\nnrows 2\ncellsize 1\nNODATA_value -9\n1 2\n3 -9\n"
        )
        (tmp_path / "short.asc").write_text("ncols 2\nnrows 2\ncellsize 1\n1 2 3\n")
        (tmp_path / "bare.asc").write_text("1 2\n3 4\n")
        (tmp_path / "hole.asc").write_text("ncols 2\nnrows 2\ncellsize 1\n1 2\n3 -9999\n")
        np.save(tmp_path / "hole.npy", np.where(np.eye(3) > 0.0, -32768.0, 1.0))
        (tmp_path / "map.png").write_text("no image")
        np.save(tmp_path / "map.npy", np.zeros((3, 3)))
        for name, reason in [
            ("missing.png", "No such file or directory"),
            ("map.asc", "cells without data"),
            ("short.asc", "3 heights instead of 2 x 2"),
            ("bare.asc", "lacks ncols"),
            ("hole.asc", "is -9999 in 1 cells, the first in row 0, column 1: that seems to stand"),
            ("map.png", "cannot be read"),
            ("map.npy", "give cell"),
        ]:
            with pytest.raises(SceneError, match=reason) as caught:
                HeightMap.from_file(tmp_path / name)
            assert "\n" not in str(caught.value)
        with pytest.raises(SceneError, match="is -32768 in 3 cells"):
            HeightMap.from_file(tmp_path / "hole.npy", (1.0, 1.0))
        # A relief in thousandths that passes through such a value is data.
        np.save(tmp_path / "deep.npy", np.arange(-11999.0, 1.0).reshape(100, 120))
        assert HeightMap.from_file(tmp_path / "deep.npy", (1.0, 1.0)).heights.min() == -11999.0

    def test_offset_is_where_the_first_height_is(self, tmp_path):
        """The corner of a grid in metres of a map is far from any domain; a cell's middle is half a cell from it."""
        head = "ncols 3\nnrows 2\nxllcorner 340620\nyllcorner 3917730\ncellsize 2\n"
        (tmp_path / "map.asc").write_text(head + "1 1 1\n1 1 1\n")
        asc = {"kind": "height-map", "file": "map.asc"}
        for given, place in (({}, (340621.0, 3917731.0)), ({"offset": (-1.0, 4.0)}, (-1.0, 4.0))):
            bed = HeightMapBed.model_validate(
                {**asc, **given}, context={"directory": str(tmp_path)}
            )
            assert bed.offset == place
            low = [side[0] for side in bed.terrain(0.0).extent]
            assert tuple(low) == place

    @pytest.mark.parametrize(
        ("make", "reason"),
        [
            (lambda: HeightMap(np.zeros(3), (1.0, 1.0)), "rows and columns"),
            (lambda: HeightMap([[0.0, np.nan], [0.0, 0.0]], (1.0, 1.0)), "row 0, column 1"),
        ],
    )
    def test_bad_beds_are_refused(self, make, reason):
        with pytest.raises(SceneError, match=reason):
            make()


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


def test_a_sphere_rests_on_disorder():
    bed = SphereBed.array(0.5, 1.2, "random", seed=3, layers=2)
    grain = Sphere(1.0)
    placement = rest(grain, bed, (0.2, 0.1))
    centres = bed.near((0.2, 0.1), 3.50)[1]
    assert np.linalg.norm(centres - placement.centre, axis=1).min() == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize(
    ("keys", "words"), [({"layers": 0}, "none"), ({"spacing": 4.0, "layers": 2}, "so far apart")]
)
def test_what_is_no_packing_is_refused(keys, words):
    with pytest.raises(SceneError, match=words):
        SphereBed.array(**{"radius": 0.5, "spacing": 1.0, **keys})
