"""Scene files with superellipses, stars, discs and grains that settle: placed properly, or refused in one line."""

import math
from functools import cache

import numpy as np
import pytest

from incipient.contact import touching
from incipient.errors import SceneError
from incipient.scene.file import dumps, load, loads

SCENE = """\
[domain]
length = 10
height = 5
[fluid]
reynolds = 1
scale = "grain"
[flow]
kind = "shear"
[gravity]
acceleration = 10
[contact]
friction = 0.5
"""
SUPERELLIPSE = 'shape = "superellipse"\nsemi_axes = [0.6, 0.4]\nexponent = 4'
STAR = 'shape = "star"\nradius = 0.5\ncosines = [0, 0.2]\nsines = [0, 0, 0.1]'
DISCS = 'shape = "discs"\ndiscs = [[0, 0, 0.4], [0.5, 0.1, 0.3], [0.1, 0.5, 0.25]]'
FLAT = 'kind = "flat"'
HALF_DISCS = 'kind = "half-discs"\nradius = 0.4\nspacing = 0.9'
SINUSOIDAL = 'kind = "sinusoidal"\namplitude = 0.1\nwavelength = 1.2'
bodies = pytest.mark.parametrize(
    "body", [SUPERELLIPSE, STAR, DISCS], ids=["superellipse", "star", "discs"]
)
beds = pytest.mark.parametrize(
    "bed", [FLAT, HALF_DISCS, SINUSOIDAL], ids=["flat", "half-discs", "sinusoidal"]
)


def text(body, bed=FLAT, place="x = 4\nangle = 20\ndensity = 2.65\nsettle = true"):
    return f"{SCENE}[body]\n{body}\n{place}\n[bed]\n{bed}\n"


@cache
def settled(body, bed):
    """The scene of a grain that settles: some are looked at by several tests."""
    return loads(text(body, bed))


def refused(content, path):
    path.write_text(content)
    with pytest.raises(SceneError) as caught:
        load(path)
    assert "\n" not in str(caught.value)
    return str(caught.value).removeprefix(f"{path}: ")


class TestPlaces:
    @bodies
    @beds
    def test_without_settling_it_is_lowered_where_it_is(self, body, bed):
        scene = loads(text(body, bed, "x = 4\nangle = 20"))
        assert scene.placement.centre[0] == 4.0
        assert scene.placement.angle == pytest.approx(math.radians(20))
        touching(scene.grain, scene.placement, scene.bed_shape, scene.contact_tolerance)

    @pytest.mark.parametrize(
        ("body", "bed"),
        [
            *((body, bed) for bed in (FLAT, HALF_DISCS) for body in (SUPERELLIPSE, STAR, DISCS)),
            (SUPERELLIPSE, SINUSOIDAL),
            *(pytest.param(body, SINUSOIDAL, marks=pytest.mark.slow) for body in (STAR, DISCS)),
        ],
        ids=lambda text: text.split('"')[1],
    )
    def test_settled_its_weight_lies_between_its_contacts(self, body, bed):
        scene = settled(body, bed)
        found = touching(scene.grain, scene.placement, scene.bed_shape, scene.contact_tolerance)
        x = found.points[:, 0]
        # On one contact it stands straight above it, on two it leans on both.
        slack = 1e-9 * scene.grain.size
        assert x.min() - slack <= scene.placement.centre[0] <= x.max() + slack
        assert len(found) == (1 if bed == FLAT and body != DISCS else 2)

    def test_a_superellipse_settles_on_its_long_side(self):
        placement = settled(SUPERELLIPSE, FLAT).placement
        assert placement.centre[1] == pytest.approx(0.4, abs=1e-12)
        assert placement.angle == pytest.approx(0.0, abs=1e-9)

    def test_two_discs_settle_side_by_side(self):
        placement = loads(text('shape = "discs"\ndiscs = [[0, 0, 0.4], [0.7, 0, 0.4]]')).placement
        assert placement.centre[1] == pytest.approx(0.4, abs=1e-10)
        assert math.sin(placement.angle) == pytest.approx(0.0, abs=1e-9)

    def test_a_slope_turns_gravity_for_settling_too(self):
        # A box of 0.4 x 1 topples at tan(30 deg) = 0.58 > 0.4, and then lies on its long side.
        box = 'shape = "rectangle"\nwidth = 0.4\nheight = 1'
        place = "x = 4\nsettle = true"
        upright, fallen = (
            loads(
                text(box, f'kind = "inclined"\nslope = {slope}', place),
                overrides=["contact.friction=1"],
            )
            for slope in (20, 30)
        )
        assert (upright.placement.centre[1], fallen.placement.centre[1]) == pytest.approx(
            (0.5, 0.2)
        )

    @bodies
    def test_written_and_read_again_it_is_the_same(self, body):
        scene = loads(text(body, HALF_DISCS))
        again = loads(dumps(scene))
        assert again == scene
        assert again.placement == scene.placement

    def test_the_grain_is_that_of_its_formula(self):
        scene = loads(text(STAR, FLAT, "x = 4"))
        angle = np.linspace(0.0, 2.0 * np.pi, 50)
        radius = 0.5 * (1.0 + 0.2 * np.cos(2.0 * angle) + 0.1 * np.sin(3.0 * angle))
        outline = scene.grain.pole + radius[:, None] * np.column_stack(
            [np.cos(angle), np.sin(angle)]
        )
        assert scene.grain.level(outline) == pytest.approx(0.0, abs=1e-12)


class TestBadScenes:
    @pytest.mark.parametrize(
        ("body", "expected"),
        [
            ('shape = "superellipse"\nsemi_axes = [1, 1]', "body.exponent: is missing"),
            (
                'shape = "superellipse"\nsemi_axes = [1, 1]\nexponent = 20.5',
                "body.exponent: is 20.5; give a number of at most 20",
            ),
            (
                'shape = "superellipse"\nsemi_axes = [1, 0]\nexponent = 3',
                "body.semi_axes[1]: is 0; give a number greater than 0",
            ),
            ('shape = "star"', "body.radius: is missing"),
            (
                'shape = "star"\nradius = 1\nsines = [1.5]',
                "body.sines: the radius of the star is -0.5 at 270 degrees; keep it positive",
            ),
            (
                'shape = "star"\nradius = 1\ncosines = ["a"]',
                'body.cosines[0]: is "a"; give a number',
            ),
            (
                'shape = "star"\nradius = 1\ncosines = [nan]',
                "body.cosines[0]: is nan; give a finite number",
            ),
            ('shape = "discs"\ndiscs = []', "body.discs: has 0 items; give 1 or more"),
            (
                'shape = "discs"\ndiscs = [[0, 0]]',
                "body.discs[0]: has 2 items; give three, as in [x, y, radius]",
            ),
            (
                'shape = "discs"\ndiscs = [[0, 0, -1]]',
                "body.discs[0][2]: is -1; give a number greater than 0",
            ),
            (
                'shape = "discs"\ndiscs = [[0, 0, 1], [0.1, 0, 0.5]]',
                "body.discs: disc 1 of the union lies within the others; leave it out",
            ),
            (
                f'{SUPERELLIPSE}\nsettle = "yes"',
                'body.settle: is "yes"; give true, false, "frictionless" or "level"',
            ),
        ],
    )
    def test_shapes(self, tmp_path, body, expected):
        assert refused(text(body, FLAT, "x = 4"), tmp_path / "case.toml").startswith(expected)

    @pytest.mark.parametrize(
        ("place", "bed", "expected"),
        [
            (
                "centre = [4, 2]\nsettle = true",
                FLAT,
                "body.settle: a grain with a given centre does not settle; "
                "give x instead of centre, or leave settle out",
            ),
            (
                "x = 4\nsettle = true",
                'kind = "inclined"\nslope = 40',
                "body.x: the grain rolls off: it leaves the bed, or its surroundings, before it finds a rest; "
                "change x or angle, or leave settle out",
            ),
            (
                "x = 4\nangle = 90\nsettle = true",
                FLAT,
                "body.x: the grain balances: the least disturbance makes it fall; "
                "change x or angle, or leave settle out",
            ),
        ],
    )
    def test_places(self, tmp_path, place, bed, expected):
        ellipse = 'shape = "ellipse"\nsemi_axes = [0.6, 0.4]'
        assert refused(text(ellipse, bed, place), tmp_path / "case.toml") == expected

    def test_it_settles_on_a_bed_only(self, tmp_path):
        without = text(STAR).split("[bed]")[0].replace("[contact]\nfriction = 0.5\n", "")
        found = refused(without, tmp_path / "case.toml")
        assert found.startswith(
            "body.x: the grain rests on a bed but there is none; add a section [bed]"
        )

    def test_settled_it_must_still_lie_within_the_domain(self, tmp_path):
        # Started beside the inflow it rests with its left side beyond it.
        path, ellipse = tmp_path / "case.toml", 'shape = "ellipse"\nsemi_axes = [0.6, 0.4]'
        found = refused(text(ellipse, FLAT, "x = 0.3\nsettle = true"), path)
        assert found.startswith(
            "body.x: the grain reaches x = -0.3, the domain's left side is at 0; "
        )


def test_points_dumped_are_read_again():
    """Coarse runs change a scene through its plain data; the file that points might have come from is none."""
    polygon = 'shape = "polygon"\nvertices = [[0.0, 0.0], [2.0, 0.0], [2.0, 0.5]]'
    scene = loads(text(polygon, 'kind = "polyline"\npoints = [[0, 0], [5, 0.1], [10, 0]]'))
    assert type(scene)(**scene.model_dump()) == scene
