"""Grains and beds in space, and new ones in the plane: against closed formulae, quadrature and brute force."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from incipient.errors import SceneError
from incipient.geometry import (
    Box,
    Disc,
    Discs,
    EggCrate,
    Ellipse,
    Ellipsoid,
    Flat,
    Harmonics,
    HeightMap,
    Hemispheres,
    Placement,
    Plane,
    Polygon,
    Polyhedron,
    Rectangle,
    Relief,
    Ridges,
    Sphere,
    Spheres,
    Star,
    StarSolid,
    Superellipse,
    Superquadric,
    Triangulated,
    clearance,
    lifted,
    rest,
)
from incipient.geometry.placement import product, rotation_by
from incipient.geometry.surfaces import require_closed

TORUS = trimesh.creation.torus(0.5, 0.2, 16, 12)
POINTS = np.random.default_rng(5).normal(size=(14, 3)) * [0.5, 0.4, 0.3]


def bumpy(d):
    """A radius that depends on the direction smoothly, without symmetry."""
    return 0.5 + 0.1 * d[:, 0] * d[:, 1] + 0.1 * d[:, 2] ** 3 + 0.05 * d[:, 0]


SOLIDS = {
    "sphere": Sphere(1.2),
    "ellipsoid": Ellipsoid((0.7, 0.4, 0.3)),
    "superquadric": Superquadric((0.7, 0.4, 0.3), (4.0, 3.0)),
    "almost a cylinder": Superquadric((0.4, 0.4, 0.5), (12.0, 2.0)),
    "star": StarSolid(bumpy),
    "sharp box": Box((1.0, 0.6, 0.4)),
    "rounded box": Box((1.0, 0.6, 0.4), 0.1),
    "box rounded to a stadium": Box((1.0, 0.4, 0.4), 0.2),
    "polyhedron": Polyhedron(POINTS),
    "torus of triangles": Triangulated(TORUS.vertices, TORUS.faces),
    "spheres": Spheres([(0, 0, 0), (0.5, 0.0, 0.1), (0.1, 0.4, 0.2)], [0.4, 0.35, 0.3]),
}
HEXAGON = [(np.cos(k * np.pi / 3), np.sin(k * np.pi / 3)) for k in range(6)]
X, Y = np.meshgrid(np.linspace(-4.0, 4.0, 81), np.linspace(-4.0, 4.0, 81))
TERRAINS = {
    "plane": Plane((0.3, -0.2), 0.1),
    "square half-balls": Hemispheres(0.4, 1.0, "square", (0.1, 0.2), 0.3),
    "triangular overlapping half-balls": Hemispheres(0.5, 0.8, "triangular"),
    "ridges": Ridges(0.1, 1.0, 0.4, 0.2),
    "egg crate": EggCrate(0.2, (1.0, 1.2), (0.3, 0.0), 0.1),
    "callable": Relief(lambda x: 0.2 * np.sin(3.0 * x[:, 0]) * np.cos(2.0 * x[:, 1]), 0.5),
    "height map": HeightMap(0.2 * np.sin(3.0 * X) * np.cos(2.0 * Y), (0.1, 0.1), (-4.0, -4.0, 0.0)),
}
solids = pytest.mark.parametrize("solid", SOLIDS.values(), ids=SOLIDS.keys())
terrains = pytest.mark.parametrize("bed", TERRAINS.values(), ids=TERRAINS.keys())
vectors = st.tuples(*[st.floats(-3.0, 3.0)] * 3)


def counted_moments(solid, count=60):
    """Volume, centroid and inertia by counting random points, one in each cell of a grid, that are inside."""
    x = np.arange(count) / count - 0.5
    cells = np.stack(np.meshgrid(x, x, x), axis=-1).reshape(-1, 3)
    points = 1.02 * solid.size * (cells + np.random.default_rng(7).uniform(0.0, 1.0 / count, cells.shape))
    inside = points[solid.level(points) < 0.0]
    cell = (1.02 * solid.size / count) ** 3
    second = cell * inside.T @ inside
    return cell * len(inside), inside.mean(axis=0), np.trace(second) * np.eye(3) - second


class TestPlacementInSpace:
    @settings(max_examples=30, deadline=None)
    @given(vectors, vectors, vectors)
    def test_turns_are_rotations_and_go_there_and_back(self, turn, shift, point):
        placement = Placement((0.1, 0.2, 0.3)).moved(shift, turn)
        rotation = placement.rotation
        assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-14)
        assert np.linalg.det(rotation) == pytest.approx(1.0)
        x = np.array([point])
        assert placement.to_body(placement.to_scene(x)) == pytest.approx(x, abs=1e-13)
        # A rotation leaves its own axis in place.
        assert rotation @ np.array(turn) == pytest.approx(np.array(turn), abs=1e-12)

    def test_a_quarter_turn_about_the_vertical(self):
        placement = Placement((0.0, 0.0, 1.0)).moved((0, 0, 0), (0.0, 0.0, np.pi / 2))
        assert placement.to_scene([[1.0, 0.0, 0.0]]) == pytest.approx(np.array([[0.0, 1.0, 1.0]]))
        assert placement.raised(0.5).centre == (0.0, 0.0, 1.5)
        assert placement.raised(0.5).quaternion == placement.quaternion

    def test_turns_are_made_one_after_the_other(self):
        first, second = rotation_by((0.3, 0.0, 0.1)), rotation_by((0.0, -0.7, 0.2))
        both = Placement((0, 0, 0), quaternion=product(second, first)).rotation
        parts = [Placement((0, 0, 0), quaternion=q).rotation for q in (second, first)]
        assert both == pytest.approx(parts[0] @ parts[1])

    def test_in_the_plane_nothing_changes(self):
        placement = Placement((1.0, 2.0), 0.4)
        assert (placement.quaternion, placement.gdim) == (None, 2)
        assert placement.moved((0.5, 0.0), [0.1]) == Placement((1.5, 2.0), 0.5)

    @pytest.mark.parametrize(
        ("make", "reason"),
        [
            (lambda: Placement((0, 0, 0), 0.3), "no angle"),
            (lambda: Placement((0, 0), 0.0, (1, 0, 0, 0)), "no quaternion"),
            (lambda: Placement((0, 0, 0), quaternion=(1, 1, 0, 0)), "unit length"),
            (lambda: Placement((0, 0, 0), quaternion=(np.nan, 0, 0, 0)), "unit length"),
            (lambda: Placement((0, 0, np.inf)), "finite"),
        ],
    )
    def test_bad_placements_are_refused(self, make, reason):
        with pytest.raises(SceneError, match=reason):
            make()


class TestSolids:
    @solids
    def test_surface_lies_on_the_grain_is_closed_and_faces_outwards(self, solid):
        surface = solid.surface(solid.size / 15.0)
        if not isinstance(solid, Spheres):  # whose triangles are left whole at creases
            require_closed(surface, "the surface")
            assert solid.level(surface.points) == pytest.approx(0.0, abs=1e-13 * solid.size)
        mesh = trimesh.Trimesh(surface.points, surface.triangles, process=False)
        assert mesh.volume == pytest.approx(solid.volume, rel=0.05)

    @solids
    def test_level_is_negative_inside_and_grows_along_the_normal(self, solid):
        points = solid.surface(solid.size / 12.0).points
        points = points[np.abs(solid.level(points)) < 1e-12 * solid.size]
        normals = solid.normal(points)
        assert np.linalg.norm(normals, axis=1) == pytest.approx(1.0)
        step = 1e-4 * solid.size
        assert (solid.level(points + step * normals) > 0.0).all()
        # In a sharp corner, not everything against the bisector need be inside.
        corners = np.vstack(
            [core.points for core in solid.cores if core.radius == 0.0] or [np.full((1, 3), np.inf)]
        )
        smooth = np.linalg.norm(points[:, None] - corners, axis=2).min(axis=1) > 1e-6
        assert (solid.level(points - step * normals) < 0.0)[smooth].all()

    @solids
    @settings(max_examples=10, deadline=None)
    @given(direction=vectors.filter(lambda v: np.linalg.norm(v) > 0.1), far=st.floats(0.05, 0.4))
    def test_normal_is_the_gradient(self, solid, direction, far):
        # From far outside inwards; off the surface, where level functions are smooth almost everywhere.
        outward = np.array([direction]) / np.linalg.norm(direction)
        distance = np.linspace(1.0, 0.0, 201)[:, None] * solid.size
        ray = solid.level(distance * outward)
        point = distance[np.argmin(np.abs(ray - far * solid.size))] * outward
        h = 1e-5 * solid.size
        gradient = [(solid.level(point + h * e) - solid.level(point - h * e))[0] for e in np.eye(3)]
        sides = [solid.normal(point + h * e)[0] for e in np.vstack([np.eye(3), -np.eye(3)])]
        if np.ptp(sides, axis=0).max() < 1e-3:  # not across an edge of the level function
            expected = np.array([gradient]) / np.linalg.norm(gradient)
            assert solid.normal(point) == pytest.approx(expected, abs=1e-6)

    @pytest.mark.parametrize("name", [name for name in SOLIDS if "torus" not in name])
    def test_volume_centroid_and_inertia_by_counting_cells(self, name):
        solid = SOLIDS[name]
        volume, centroid, inertia = counted_moments(solid)
        # Only cells cut by the surface err: a part 1/60 of them, at random.
        assert volume == pytest.approx(solid.volume, rel=1e-2)
        assert centroid == pytest.approx(np.zeros(3), abs=2e-3 * solid.size)
        assert inertia == pytest.approx(solid.inertia, abs=2e-2 * solid.inertia.max())

    @solids
    def test_size_is_the_largest_diameter(self, solid):
        points = solid.surface(solid.size / 20.0).points
        largest = max(np.linalg.norm(points - p, axis=1).max() for p in points[::3])
        assert largest <= solid.size * (1.0 + 1e-12)
        assert largest == pytest.approx(solid.size, rel=5e-3)

    @solids
    def test_centroid_is_the_origin(self, solid):
        assert solid.centroid == pytest.approx(np.zeros(3))
        assert solid.inertia == pytest.approx(solid.inertia.T)


class TestClosedFormulae:
    def test_sphere(self):
        # V = 4/3 pi r^3, I = 2/5 V r^2.
        sphere = Sphere(1.4)
        assert sphere.volume == pytest.approx(4.0 / 3.0 * np.pi * 0.7**3)
        assert sphere.inertia == pytest.approx(0.4 * sphere.volume * 0.7**2 * np.eye(3))

    def test_ellipsoid(self):
        # I_xx = V (b^2 + c^2) / 5.
        a, b, c = 0.7, 0.4, 0.3
        solid = Ellipsoid((a, b, c))
        volume = 4.0 / 3.0 * np.pi * a * b * c
        assert solid.volume == pytest.approx(volume)
        expected = np.diag([b * b + c * c, a * a + c * c, a * a + b * b])
        assert solid.inertia == pytest.approx(0.2 * volume * expected)

    def test_superquadric_between_ellipsoid_and_box(self):
        axes = (0.7, 0.4, 0.3)
        round_one, ellipsoid = Superquadric(axes, (2.0, 2.0)), Ellipsoid(axes)
        assert round_one.volume == pytest.approx(ellipsoid.volume)
        assert round_one.inertia == pytest.approx(ellipsoid.inertia)
        # As the exponents grow it fills its box of 8 a b c; of volume 8 Gamma(1+1/n)^3 / Gamma(1+3/n) for equal ones.
        box = Superquadric(axes, (100.0, 100.0))
        assert box.volume == pytest.approx(8.0 * np.prod(axes), rel=1e-3)
        assert box.size == pytest.approx(2.0 * np.linalg.norm(axes), rel=0.02)

    def test_elliptic_cylinder_is_a_limit(self):
        # Exponent n = 2 across, m to infinity along: V -> 2 pi a b c.
        assert Superquadric((0.7, 0.4, 0.3), (100.0, 2.0)).volume == pytest.approx(
            2.0 * np.pi * 0.7 * 0.4 * 0.3, rel=1e-3
        )

    def test_box(self):
        # I_zz = V (width^2 + depth^2) / 12.
        box = Box((1.0, 0.6, 0.4))
        assert box.volume == pytest.approx(0.24)
        assert np.diag(box.inertia) == pytest.approx(0.02 * np.array([0.52, 1.16, 1.36]))

    def test_rounded_box_by_steiners_formula(self):
        # V = ABC + 2r (AB + BC + CA) + pi r^2 (A + B + C) + 4/3 pi r^3 with A, B, C the sides less 2r.
        a, b, c, r = 0.8, 0.4, 0.2, 0.1
        expected = a * b * c + 2 * r * (a * b + b * c + c * a) + np.pi * r * r * (a + b + c)
        assert Box((1.0, 0.6, 0.4), r).volume == pytest.approx(expected + 4.0 / 3.0 * np.pi * r**3)

    def test_box_rounded_to_a_sphere_is_one(self):
        box, sphere = Box((0.6, 0.6, 0.6), 0.3), Sphere(0.6)
        assert box.volume == pytest.approx(sphere.volume)
        assert box.inertia == pytest.approx(sphere.inertia)

    def test_regular_tetrahedron(self):
        # Side s: V = s^3 / (6 sqrt 2), I = V s^2 / 20 about every axis; given in any place.
        corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1.0]]) + np.array([3.0, 0.0, -1.0])
        solid, s = Polyhedron(corners), 2.0 * np.sqrt(2.0)
        assert solid.volume == pytest.approx(s**3 / (6.0 * np.sqrt(2.0)))
        assert solid.inertia == pytest.approx(solid.volume * s * s / 20.0 * np.eye(3))
        assert solid.size == pytest.approx(s)

    def test_two_spheres_less_their_lens(self):
        # V_lens = pi (R + r - d)^2 (d^2 + 2d(r + R) - 3(r - R)^2) / (12 d).
        R, r, d = 0.5, 0.4, 0.6
        lens = np.pi * (R + r - d) ** 2 * (d * d + 2 * d * (r + R) - 3 * (r - R) ** 2) / (12 * d)
        union = Spheres([(0, 0, 0), (d, 0, 0)], [R, r])
        assert union.volume == pytest.approx(4.0 / 3.0 * np.pi * (R**3 + r**3) - lens, rel=1e-9)
        # Turned by any angle the same, although the sections are others.
        turned = Spheres([(0, 0, 0), d * np.array([2.0, 3.0, 6.0]) / 7.0], [R, r])
        assert turned.volume == pytest.approx(union.volume, rel=1e-8)
        assert np.linalg.eigvalsh(turned.inertia) == pytest.approx(
            np.linalg.eigvalsh(union.inertia), rel=1e-7
        )

    def test_star_about_another_pole_is_the_sphere(self):
        # |p + r d - a| = R gives r = a.d + sqrt(R^2 - |a|^2 + (a.d)^2); the frame is shifted to the centre.
        a, R = np.array([0.1, -0.2, 0.05]), 0.5
        solid = StarSolid(lambda d: d @ a + np.sqrt(R * R - a @ a + (d @ a) ** 2))
        assert solid.volume == pytest.approx(Sphere(1.0).volume, rel=1e-12)
        assert solid.inertia == pytest.approx(Sphere(1.0).inertia, rel=1e-10, abs=1e-14)
        assert solid.pole == pytest.approx(-a)
        assert solid.size == pytest.approx(1.0, rel=1e-9)
        points = Sphere(1.0).surface(0.2).points
        assert solid.level(points) == pytest.approx(0.0, abs=1e-12)
        assert solid.normal(points) == pytest.approx(2.0 * points, abs=1e-9)

    def test_triangles_against_trimesh(self):
        solid = SOLIDS["torus of triangles"]
        assert solid.volume == pytest.approx(TORUS.volume)
        assert solid.inertia == pytest.approx(TORUS.moment_inertia, abs=1e-12)
        # In the hole of the torus one is outside, and as far as its inner circle is round.
        assert solid.level([[0.0, 0.0, 0.0]]) == pytest.approx(0.3, rel=0.05)

    @settings(max_examples=15, deadline=None)
    @given(vectors, st.floats(0.1, 10.0))
    def test_inertia_turns_and_scales(self, turn, scale):
        # I -> s^5 R I R^T, V -> s^3 V.
        rotation = Placement((0, 0, 0)).moved((0, 0, 0), turn).rotation
        solid, moved = Polyhedron(POINTS), Polyhedron(scale * POINTS @ rotation.T + turn)
        assert moved.volume == pytest.approx(scale**3 * solid.volume)
        expected = scale**5 * rotation @ solid.inertia @ rotation.T
        assert moved.inertia == pytest.approx(expected, rel=1e-9, abs=1e-9 * scale**5)


class TestPlaneGrains:
    GRAINS = (
        Superellipse((0.7, 0.3), 4.0),
        Superellipse((0.5, 0.5), 2.5),
        Star(Harmonics(0.5, (0.1, 0.2, 0.05), (0.0, 0.1))),
        Star(lambda angle: 0.5 + 0.1 * np.cos(3.0 * angle + 1.0)),
        Discs([(0, 0), (0.7, 0.2), (-0.3, 0.6)], [0.5, 0.3, 0.4]),
        Rectangle(1.0, 0.6, 0.1),
        Polygon([(0, 0), (2, 0.5), (1.5, 1.5), (-0.2, 1.0)]),
        Ellipse((0.7, 0.3)),
    )

    @pytest.mark.parametrize("grain", GRAINS, ids=lambda grain: type(grain).__name__)
    def test_outline_area_centroid_and_polar_moment(self, grain):
        """Green's theorem along the exact outline, Gauss rule on parts of each curve."""
        nodes, weights = np.polynomial.legendre.leggauss(20)
        total, h = np.zeros(4), 1e-5
        outline = grain.outline()
        for curve, following in zip(outline, (*outline[1:], outline[0]), strict=True):
            assert curve.end == pytest.approx(following.start, abs=1e-14)
            for part in range(16):
                s = (part + 0.5 * (nodes + 1.0)) / 16.0
                x, y = curve.point(s).T
                dx, dy = ((curve.point(s + h) - curve.point(s - h)) / (2.0 * h)).T * weights / 32.0
                total += [
                    (0.5 * (x * dy - y * dx)).sum(),
                    (0.5 * x * x * dy).sum(),
                    (-0.5 * y * y * dx).sum(),
                    ((x**3 * dy - y**3 * dx) / 3.0).sum(),
                ]
        assert total == pytest.approx([grain.volume, 0.0, 0.0, grain.inertia[2, 2]], abs=1e-8)
        assert grain.inertia == pytest.approx(np.diag([0.0, 0.0, grain.polar_moment]))

    @pytest.mark.parametrize("grain", GRAINS[:5], ids=lambda grain: type(grain).__name__)
    def test_outline_level_normal_and_size(self, grain):
        s = np.linspace(0.0, 1.0, 101)
        points = np.vstack([curve.point(s) for curve in grain.outline()])
        assert grain.level(points) == pytest.approx(0.0, abs=1e-14)
        apart = np.linalg.norm(points[:, None] - points, axis=2).max()
        assert apart <= grain.size * (1.0 + 1e-12)
        assert apart == pytest.approx(grain.size, rel=1e-3)
        for curve in grain.outline():
            tangents = curve.tangent(s[1:-1])
            outward = np.column_stack([tangents[:, 1], -tangents[:, 0]])
            assert grain.normal(curve.point(s[1:-1])) == pytest.approx(outward, abs=1e-9)

    @pytest.mark.parametrize("grain", GRAINS[:4], ids=lambda grain: type(grain).__name__)
    def test_splines_for_meshes_keep_to_the_outline(self, grain):
        """Where a mesh generator draws a cubic through the given points it errs by less than 1e-6 of the size."""
        from incipient.geometry import Spline

        for curve in grain.outline():
            points = Spline(curve.points).point(np.linspace(0.0, 1.0, 4001))
            assert np.abs(grain.level(points)).max() < 1e-6 * grain.size

    def test_superellipse_of_exponent_two_is_the_ellipse(self):
        grain, ellipse = Superellipse((0.7, 0.3), 2.0), Ellipse((0.7, 0.3))
        assert (grain.volume, grain.polar_moment) == pytest.approx((ellipse.volume, ellipse.polar_moment))
        assert grain.size == ellipse.size

    def test_one_disc_and_two_discs(self):
        one = Discs([(3.0, 1.0)], [0.5])
        assert (one.volume, one.polar_moment) == pytest.approx((np.pi / 4.0, np.pi / 32.0))
        # Two unit discs a distance 1 apart: each is cut by a segment of 2 pi/3, of area (2 pi/3 - sin(2 pi/3))/2.
        segment = 0.5 * (2.0 * np.pi / 3.0 - np.sin(2.0 * np.pi / 3.0))
        assert Discs([(0, 0), (1, 0)], [1, 1]).volume == pytest.approx(2.0 * np.pi - 2.0 * segment)

    def test_corners_of_a_union_are_exact(self):
        # The circles of radius 1 about (-1/2, 0) and (1/2, 0) meet in (0, +-sqrt(3)/2).
        starts = [curve.start for curve in Discs([(0, 0), (1, 0)], [1, 1]).outline()]
        for corner in ((0.0, np.sqrt(0.75)), (0.0, -np.sqrt(0.75))):
            assert min(np.hypot(x - corner[0], y - corner[1]) for x, y in starts) < 1e-15

    @pytest.mark.parametrize(
        ("make", "reason"),
        [
            (lambda: Superellipse((1.0, 1.0), 1.9), "exponent 1.9"),
            (lambda: Superellipse((1.0, 0.0), 3.0), "semi-axis"),
            (lambda: Star(lambda a: np.cos(a)), "-1 at 180 degrees"),
            (lambda: Star(lambda a: 1.0 + 0.1 * a), "periodic"),
            (lambda: Star(lambda a: 1.0), "one finite number"),
            (lambda: Discs([(0, 0), (3, 0)], [1, 1]), "number 1 .* does not overlap"),
            (lambda: Discs([(0, 0), (0.1, 0)], [1, 0.5]), "disc 1 .* lies within"),
            (lambda: Discs([(0, 0)], [1, 2]), "one radius"),
            (lambda: Discs([(0, 0)], [-1]), "positive"),
            (lambda: Discs(HEXAGON, [0.55] * 6), "hole"),
        ],
    )
    def test_bad_grains_are_refused(self, make, reason):
        with pytest.raises(SceneError, match=reason) as caught:
            make()
        assert "\n" not in str(caught.value)


class TestFiles:
    @pytest.mark.parametrize("kind", ["stl", "ply", "obj"])
    def test_a_surface_is_read(self, tmp_path, kind):
        path = tmp_path / f"torus.{kind}"
        TORUS.export(path)
        solid = Triangulated.from_file(path, scale=2.0)
        # Formats write six or seven digits.
        assert solid.volume == pytest.approx(8.0 * TORUS.volume, rel=1e-5)
        assert solid.inertia == pytest.approx(32.0 * TORUS.moment_inertia, abs=1e-4)

    def test_triangles_turned_inwards_are_turned_back(self):
        assert Triangulated(TORUS.vertices, TORUS.faces[:, ::-1]).volume == pytest.approx(TORUS.volume)

    def test_an_open_surface_says_how_many_edges(self, tmp_path):
        # Two triangles that share a side leave a hole of four edges.
        box = trimesh.creation.box()
        shared = [sorted(set(box.faces[0]) & set(face)) for face in box.faces]
        partner = next(k for k in range(1, 12) if len(shared[k]) == 2)
        keep = np.delete(np.arange(12), [0, partner])
        trimesh.Trimesh(box.vertices, box.faces[keep], process=False).export(tmp_path / "open.ply")
        with pytest.raises(SceneError, match=r"open.ply is not watertight: it has 4 open edges; close"):
            Triangulated.from_file(tmp_path / "open.ply")

    def test_what_is_no_body_is_refused(self, tmp_path):
        first, second = trimesh.creation.box(), trimesh.creation.box()
        second.apply_translation([3.0, 0.0, 0.0])
        both = trimesh.util.concatenate([first, second])
        mixed = np.array(first.faces)
        mixed[0] = mixed[0, ::-1]
        (tmp_path / "text.stl").write_text("nothing of the kind")
        (tmp_path / "grain.txt").write_text("nothing of the kind")
        for make, reason in [
            (lambda: Triangulated(both.vertices, both.faces), "2 separate parts"),
            (lambda: Triangulated(first.vertices, mixed), "face different ways"),
            (lambda: Triangulated(first.vertices * [1, 1, 0], first.faces), "surface (is|has|encloses)"),
            (lambda: Triangulated(first.vertices * np.nan, first.faces), "not finite"),
            (lambda: Triangulated(first.vertices, first.faces + 1), "do not exist"),
            (lambda: Triangulated.from_file(tmp_path / "missing.stl"), "does not exist"),
            (lambda: Triangulated.from_file(tmp_path / "grain.txt"), "not an STL, PLY or OBJ"),
            (lambda: Triangulated.from_file(tmp_path / "text.stl"), "text.stl"),
        ]:
            with pytest.raises(SceneError, match=reason) as caught:
                make()
            assert "\n" not in str(caught.value)


class TestBadSolids:
    @pytest.mark.parametrize(
        ("make", "reason"),
        [
            (lambda: Sphere(0.0), "diameter"),
            (lambda: Sphere(float("nan")), "diameter"),
            (lambda: Ellipsoid((1.0, 1.0, -1.0)), "semi-axis"),
            (lambda: Superquadric((1.0, 1.0, 1.0), (1.0, 2.0)), "exponent 1.0"),
            (lambda: Box((1.0, 1.0, 0.0)), "side"),
            (lambda: Box((1.0, 1.0, 0.5), 0.3), "edge_radius"),
            (lambda: Polyhedron([(0, 0, 0), (1, 0, 0), (0, 1, 0)]), "four or more"),
            (lambda: Polyhedron([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)]), "no volume"),
            (lambda: Polyhedron([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, np.inf)]), "finite"),
            (lambda: StarSolid(lambda d: d[:, 0]), "keep it positive"),
            (lambda: StarSolid(lambda d: 1.0), "one finite number"),
            (lambda: Spheres([(0, 0, 0), (3, 0, 0)], [1, 1]), "does not overlap"),
            (lambda: Spheres([(0, 0, 0), (0.1, 0, 0)], [1, 0.2]), "sphere 1 .* lies within"),
        ],
    )
    def test_one_clear_line(self, make, reason):
        with pytest.raises(SceneError, match=reason) as caught:
            make()
        assert "\n" not in str(caught.value)


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
        if hasattr(bed, "hessian"):
            rows = [(bed.gradient(x + h * e) - bed.gradient(x - h * e)) / (2 * h) for e in np.eye(2)]
            error = np.abs(np.stack(rows, axis=2) - bed.hessian(x)).max(axis=(1, 2))
            assert np.median(error) < 1e-6  # that of the map jumps between cells

    @terrains
    def test_nearest_point_against_brute_force(self, bed):
        generator = np.random.default_rng(3)
        x = generator.uniform(-2.0, 2.0, (30, 2))
        points = np.column_stack([x, bed.height(x) + generator.uniform(0.0, 0.3, 30)])
        offsets = np.stack(np.meshgrid(np.linspace(-0.5, 0.5, 201), np.linspace(-0.5, 0.5, 201)), -1).reshape(
            -1, 2
        )
        brute = []
        for point in points:
            around = point[:2] + offsets
            brute.append(
                np.sqrt(((around - point[:2]) ** 2).sum(1) + (bed.height(around) - point[2]) ** 2).min()
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
            bed = Hemispheres(0.5, 1.3, arrangement, (0.2, 0.1))
            centres = bed.centres((0.2, 0.1), 1.31)
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
        for name, relief in (("map.png", 255.0 / 20.0), ("fine.png", 65535.0 / 4000.0), ("map.tif", 1.0)):
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
        (tmp_path / "map.asc").write_text("ncols 2\nnrows 2\ncellsize 1\nNODATA_value -9\n1 2\n3 -9\n")
        (tmp_path / "short.asc").write_text("ncols 2\nnrows 2\ncellsize 1\n1 2 3\n")
        (tmp_path / "bare.asc").write_text("1 2\n3 4\n")
        (tmp_path / "map.png").write_text("no image")
        np.save(tmp_path / "map.npy", np.zeros((3, 3)))
        for name, reason in [
            ("missing.png", "does not exist"),
            ("map.asc", "cells without data"),
            ("short.asc", "3 heights instead of 2 x 2"),
            ("bare.asc", "lacks ncols"),
            ("map.png", "cannot be read as heights"),
            ("map.npy", "give cell"),
        ]:
            with pytest.raises(SceneError, match=reason) as caught:
                HeightMap.from_file(tmp_path / name)
            assert "\n" not in str(caught.value)

    @pytest.mark.parametrize(
        ("make", "reason"),
        [
            (lambda: Plane((np.nan, 0.0)), "slope"),
            (lambda: Hemispheres(0.0, 1.0), "radius"),
            (lambda: Hemispheres(0.5, 1.0, "hexagonal"), "arrangement"),
            (lambda: Ridges(0.1, 0.0), "wavelength"),
            (lambda: EggCrate(-0.1, (1.0, 1.0)), "amplitude"),
            (lambda: Relief(lambda x: 1.0, 0.5), "one finite height"),
            (lambda: HeightMap(np.zeros(3), (1.0, 1.0)), "rows and columns"),
            (lambda: HeightMap([[0.0, np.nan], [0.0, 0.0]], (1.0, 1.0)), "row 0, column 1"),
        ],
    )
    def test_bad_beds_are_refused(self, make, reason):
        with pytest.raises(SceneError, match=reason):
            make()


class TestRestInSpace:
    """Heights at rest from elementary geometry, stated case by case."""

    def height(self, grain, bed, x, quaternion=0.0):
        return rest(grain, bed, x, quaternion).centre[2]

    def test_sphere_on_a_slope(self):
        # The contact is R along the normal: z = slope.x + R sqrt(1 + |slope|^2).
        expected = 0.1 + 0.3 * 2.0 - 0.2 * 1.0 + 0.5 * np.sqrt(1.0 + 0.09 + 0.04)
        assert self.height(Sphere(1.0), Plane((0.3, -0.2), 0.1), (2.0, 1.0)) == pytest.approx(
            expected, abs=1e-13
        )

    def test_sphere_on_a_ball_beside_its_top(self):
        # Distance of the centres R + r: z^2 = (R + r)^2 - |x|^2.
        expected = np.sqrt(0.9**2 - 0.2**2 - 0.1**2)
        assert self.height(Sphere(1.0), Hemispheres(0.4, 3.0), (0.2, 0.1)) == pytest.approx(
            expected, abs=1e-12
        )

    @pytest.mark.parametrize(("arrangement", "third"), [("square", 2.0), ("triangular", 3.0)])
    @pytest.mark.parametrize("spacing", [0.7, 1.0, 1.2])
    def test_sphere_in_a_pocket(self, arrangement, third, spacing):
        # The middle of a square (triangle) of side s is s/sqrt(2) (s/sqrt(3)) from its corners.
        bed = Hemispheres(0.5, spacing, arrangement)
        middle = spacing * np.array([0.5, 0.5 if arrangement == "square" else np.sqrt(1.0 / 12.0)])
        expected = np.sqrt(1.0 - spacing**2 / third)
        assert self.height(Sphere(1.0), bed, middle) == pytest.approx(expected, abs=1e-13)

    @settings(max_examples=20, deadline=None)
    @given(vectors)
    def test_ellipsoid_on_a_plane_by_its_support_function(self, turn):
        # Downwards it reaches |diag(a, b, c) R^T e_z|.
        placement = Placement((0, 0, 0)).moved((0, 0, 0), turn)
        expected = np.linalg.norm(np.array([0.7, 0.5, 0.3]) * placement.rotation[2])
        height = self.height(Ellipsoid((0.7, 0.5, 0.3)), Plane(), (0.0, 0.0), placement.quaternion)
        assert height == pytest.approx(expected, abs=1e-12)

    @settings(max_examples=20, deadline=None)
    @given(vectors)
    def test_rounded_box_on_a_plane_by_its_support_function(self, turn):
        # The core reaches sum of half sides times |R_zi| down, the ball r more.
        placement = Placement((0, 0, 0)).moved((0, 0, 0), turn)
        expected = np.array([0.4, 0.2, 0.1]) @ np.abs(placement.rotation[2]) + 0.1
        height = self.height(Box((1.0, 0.6, 0.4), 0.1), Plane(), (0.0, 0.0), placement.quaternion)
        assert height == pytest.approx(expected, abs=1e-13)

    @settings(max_examples=40, deadline=None)
    @given(
        solid=st.sampled_from(list(SOLIDS.values())),
        bed=st.sampled_from(list(TERRAINS.values())),
        turn=vectors,
        x=st.tuples(st.floats(-0.7, 0.7), st.floats(-0.7, 0.7)),
    )
    def test_resting_touches_and_enters_nowhere(self, solid, bed, turn, x):
        placement = rest(solid, bed, x, rotation_by(turn))
        assert placement.centre[:2] == x
        distance, on_grain, on_bed = clearance(solid, placement, bed)
        assert distance == pytest.approx(0.0, abs=1e-12 * solid.size)
        assert solid.level(placement.to_body([on_grain])) == pytest.approx(0.0, abs=1e-9)
        assert bed.height(on_bed[None, :2]) == pytest.approx(on_bed[2], abs=1e-9)
        points = solid.surface(solid.size / 60.0).points
        points = placement.to_scene(points[np.abs(solid.level(points)) < 1e-12])
        assert (points[:, 2] - bed.height(points[:, :2])).min() >= -1e-12

    @pytest.mark.parametrize("gap", [0.003, 0.05])
    def test_lifted_out_of_a_pocket(self, gap):
        # The triangle of centres with sides R + r + gap.
        bed = Hemispheres(0.5, 1.0, "triangular")
        x = (0.5, np.sqrt(1.0 / 12.0))
        raised = lifted(Sphere(1.0), rest(Sphere(1.0), bed, x), bed, gap)
        assert raised.centre[2] == pytest.approx(np.sqrt((1.0 + gap) ** 2 - 1.0 / 3.0), abs=1e-10)
        assert clearance(Sphere(1.0), raised, bed)[0] == pytest.approx(gap, abs=1e-10)

    def test_overlap_is_negative(self):
        assert clearance(Sphere(1.0), Placement((0.0, 0.0, 0.3)), Plane())[0] == pytest.approx(-0.2)

    def test_planar_and_spatial_do_not_mix(self):
        for grain, bed in ((Disc(1.0), Plane()), (Sphere(1.0), Flat())):
            with pytest.raises(SceneError, match="one is planar, the other is not"):
                rest(grain, bed, 0.0 if isinstance(grain, Disc) else (0.0, 0.0))
