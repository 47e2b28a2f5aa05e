"""Outlines of very many vertices: the same answers as by brute force, in memory that lets one plan."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from allocated import allocated
from numpy.typing import NDArray
from scenes import message

from incipient import load
from incipient.accuracy.first_mesh import planned
from incipient.geometry import Flat, HalfDiscs, Placement, Polygon, Sinusoidal, clearance, rest
from incipient.geometry import Polyline as PolylineBed
from incipient.geometry.plane.curves import Line
from incipient.geometry.plane.grains import meeting_sides
from incipient.geometry.shape import largest_distance

Floats = NDArray[np.float64]
SCENE = """\
[domain]
length = 8
height = 4
[fluid]
reynolds = 20
scale = "grain"
[flow]
kind = "shear"
[body]
shape = "polygon"
file = "grain.csv"
x = 4
density = 2.65
[bed]
kind = "flat"
[gravity]
acceleration = 1
[contact]
friction = 0.5
"""


def written_scene(directory: Path, count: int, settle: bool) -> Path:
    """A scene file with a pebble of so many vertices in a file of its own."""
    points = pebble(count)
    np.savetxt(
        directory / "grain.csv", np.vstack([points, points[:1]]), delimiter=",", header="x,y"
    )
    path = directory / "scene.toml"
    path.write_text(SCENE.replace("density", f"settle = {str(settle).lower()}\ndensity"))
    return path


def pebble(count: int) -> Floats:
    """Vertices of a smooth outline that is nowhere convex for long."""
    a = 2.0 * np.pi * np.arange(count) / count
    r = 0.5 * (
        1.0 + 0.15 * np.cos(3.0 * a + 1.0) + 0.08 * np.sin(5.0 * a) + 0.02 * np.cos(17.0 * a)
    )
    return np.column_stack([r * np.cos(a), r * np.sin(a)])


@pytest.mark.parametrize("count", [2, 3, 4, 5, 30, 300])
def test_the_diameter_is_the_largest_distance(count: int) -> None:
    random = np.random.default_rng(count)
    clouds = [random.normal(size=(count, 2)) * [1.0, scale] for scale in (1.0, 0.01)]
    square = np.array([[x, y] for x in (0.0, 1.0, 2.0) for y in (0.0, 1.0, 2.0)])
    for points in (*clouds, square, pebble(count + 2)):
        brute = np.linalg.norm(points[:, None] - points[None], axis=2).max()
        assert largest_distance(points) == pytest.approx(brute, rel=1e-14)


def met(corners: Sequence[Sequence[float]]) -> tuple[int, int] | None:
    """The first two sides that meet, by looking at every pair."""

    def side(a: Sequence[float], b: Sequence[float], p: Sequence[float]) -> float:
        return float(np.sign((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])))

    n = len(corners)
    for i in range(n):
        for j in range(i + 2, n - (i == 0)):
            a, b, c, d = corners[i], corners[i + 1], corners[j], corners[(j + 1) % n]
            boxes = all(
                max(a[k], b[k]) >= min(c[k], d[k]) and max(c[k], d[k]) >= min(a[k], b[k])
                for k in (0, 1)
            )
            if boxes and side(a, b, c) * side(a, b, d) <= 0 and side(c, d, a) * side(c, d, b) <= 0:
                return i, j
    return None


def test_sides_that_meet_are_found() -> None:
    random = np.random.default_rng(5)
    found = set()
    for _ in range(60):
        corners = random.integers(0, 7, size=(random.integers(4, 9), 2)).astype(float)
        found.add(met(corners.tolist()))
        assert meeting_sides(corners) == met(corners.tolist())
    assert None in found and len(found) > 5
    many = pebble(3000)
    assert meeting_sides(many) is None
    many[[700, 701]] = many[[701, 700]]
    assert meeting_sides(many) == (699, 701)


@pytest.mark.parametrize(
    "bed",
    [
        Flat(),
        Sinusoidal(0.1, 0.7),
        HalfDiscs(0.2, 0.45),
        PolylineBed([(-3.0, 0.0), (-0.2, 0.3), (0.1, -0.2), (3.0, 0.4)]),
    ],
    ids=lambda bed: type(bed).__name__,
)
@pytest.mark.parametrize("count", [7, 60, 900])
def test_a_grain_comes_down_where_its_points_first_meet_the_bed(bed: Flat, count: int) -> None:
    grain = Polygon(pebble(count))
    x, angle = 0.13, 0.4
    placement = rest(grain, bed, x, angle)
    corners = Placement((x, 0.0), angle).to_scene(grain.vertices)
    s = np.linspace(0.0, 1.0, 4000 // count + 2)[:, None, None]
    points = ((1.0 - s) * corners + s * np.roll(corners, -1, axis=0)).reshape(-1, 2)
    lowest = float((points[:, 1] - bed.height(points[:, 0])).min())
    assert placement.centre[1] == pytest.approx(-lowest, abs=2e-3)
    assert placement.centre[1] >= -lowest - 1e-12  # no sample goes deeper than the resting grain
    assert clearance(grain, placement, bed)[0] == pytest.approx(0.0, abs=1e-10)


def test_an_outline_of_many_points_is_drawn_as_curves_between_its_corners() -> None:
    s = np.linspace(-0.5, 0.5, 500, endpoint=False)
    edge = np.column_stack([s, np.full(500, -0.5)])
    square = np.vstack(
        [edge @ np.array([[c, d], [-d, c]]) for c, d in ((1, 0), (0, 1), (-1, 0), (0, -1))]
    )
    drawn = Polygon(square).drawn()
    assert sorted((round(c.start[0], 9), round(c.start[1], 9)) for c in drawn) == [
        (-0.5, -0.5),
        (-0.5, 0.5),
        (0.5, -0.5),
        (0.5, 0.5),
    ]
    assert len(Polygon(pebble(2000)).drawn()) <= 8
    few = Polygon(pebble(40))
    assert all(isinstance(curve, Line) for curve in few.drawn()) and len(few.drawn()) == 40


@pytest.mark.slow
@pytest.mark.parametrize("settle", [False, True])
def test_an_outline_of_ten_thousand_points_is_planned_without_tables_of_pairs(
    tmp_path: Path, settle: bool
) -> None:
    """A number for every pair of vertices takes 800 MB, and minutes; a coarse outline has about as many cells.

    Measured: 17 MiB.
    """
    path = written_scene(tmp_path, 10_000, settle)
    with allocated() as most:
        scene = load(path)
        plan = planned(scene)
    assert most() < 100.0
    assert scene.body is not None and len(scene.body.vertices) == 10_000  # type: ignore[union-attr]
    assert plan.geometry_order == plan.order == 3
    assert plan.estimate is not None and 500 < plan.estimate.cells < 3000


def test_files_of_points_have_a_limit(tmp_path) -> None:  # type: ignore[no-untyped-def]
    text = SCENE.replace('kind = "flat"', 'kind = "polyline"\nfile = "/dev/zero"')
    (tmp_path / "grain.csv").write_text("0,0\n1,0\n0,1\n")
    (tmp_path / "scene.toml").write_text(text)
    found = message(lambda: load(tmp_path / "scene.toml"))
    assert "bed.file: /dev/zero is a pipe or a device; give the name of a CSV" in found
    (tmp_path / "grain.csv").write_text("1,0\n" * 100_001)
    found = message(lambda: load(tmp_path / "scene.toml"))
    assert (
        "body.file: " in found
        and "grain.csv has 100001 points; give three or more points, 100000" in found
    )
    assert "/dev/zero: is a pipe or a device; give" in message(lambda: load("/dev/zero"))
    with (tmp_path / "large.toml").open("wb") as stream:
        stream.truncate(17 << 20)
    said = message(lambda: load(tmp_path / "large.toml"))
    assert "large.toml: cannot be read (it is larger than 16 MiB); give the name of a scene" in said
