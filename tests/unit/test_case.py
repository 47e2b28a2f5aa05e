"""Cases given by hand: what a file means, and one line for everything that can be wrong with it."""

import re
from pathlib import Path

import numpy as np
import pytest

from incipient.errors import SceneError
from incipient.judging.case import Case, load_case

CASES = Path(__file__).parents[2] / "demos" / "cases"

PLANE = """
[load]
weight = [0.0, -1.0]
flow_force = [0.3, 0.1]
flow_couple = -0.2
centre = [1.0, 0.5]

[contacts]
points = [[1.0, 0.0]]
normals = [[0.0, -1.0]]
friction = 0.5

[grain]
mass = 2.0
inertia = 0.25
"""

SPACE = """
[load]
weight = [0, 0, -1]
flow_force = [0.3, 0, 0.1]
flow_couple = [0, 0.2, 0]
centre = [0, 0, 0.5]

[contacts]
points = [[0, 0, 0]]
normals = [[0, 0, -1]]
areas = [0.1]
friction = 0
"""

BODY = """
[load]
weight = [0.0, -1.0]
flow_force = [0.3, 0.0]
flow_couple = 0.0

[contacts]
points = [[0.0, -0.5]]
normals = [[0.0, -1.0]]
friction = 0.5

[body]
shape = "disc"
diameter = 1.0
centre = [0.0, 0.0]
density = 2.0
"""


@pytest.fixture
def case(tmp_path):
    """Reads a case from text."""

    def read(text, *overrides):
        path = tmp_path / "grain.toml"
        path.write_text(text)
        return load_case(path, overrides)

    return read


class TestMeaning:
    def test_plane(self, case):
        found = case(PLANE)
        acting, contacts = found.to_load(), found.to_contacts()
        assert acting.force == pytest.approx([0.3, -0.9, 0.0])
        assert acting.flow_couple == pytest.approx([0.0, 0.0, -0.2])
        assert acting.centre == pytest.approx([1.0, 0.5, 0.0])
        assert contacts.normals == pytest.approx(np.array([[0.0, -1.0, 0.0]]))
        assert contacts.areas is None
        mass, inertia = found.mass_and_inertia()
        assert mass == 2.0
        assert inertia == pytest.approx(0.25 * np.eye(3))

    def test_space(self, case):
        found = case(SPACE)
        assert found.gdim == 3
        assert found.to_load().flow_couple == pytest.approx([0.0, 0.2, 0.0])
        assert found.to_contacts().areas == pytest.approx([0.1])
        assert found.mass_and_inertia() is None

    @pytest.mark.parametrize(
        ("given", "matrix"),
        [
            ("[1.0, 2.0, 2.5]", np.diag([1.0, 2.0, 2.5])),
            ("[[2, 1, 0], [1, 2, 0], [0, 0, 3]]", None),
        ],
    )
    def test_inertia_in_space(self, case, given, matrix):
        _, inertia = case(f"{SPACE}\n[grain]\nmass = 1\ninertia = {given}").mass_and_inertia()
        expected = np.array([[2.0, 1, 0], [1, 2, 0], [0, 0, 3]]) if matrix is None else matrix
        assert inertia == pytest.approx(expected)

    def test_couple_about_another_point(self, case):
        # tau_c = tau_a + (a - c) ^ F: a - c = (0, -0.5), F = (0.3, 0.1): -0.2 + 0.5 * 0.3.
        found = case(PLANE.replace("centre =", "about = [1.0, 0.0]\ncentre ="))
        assert found.to_load().flow_couple == pytest.approx([0.0, 0.0, -0.05])

    def test_body_gives_centre_mass_and_inertia(self, case):
        found = case(BODY)
        assert found.to_load().centre == pytest.approx(np.zeros(3))
        mass, inertia = found.mass_and_inertia()
        # A disc of radius 1/2 and density 2: area pi/4, polar moment mass r^2 / 2.
        assert mass == pytest.approx(np.pi / 2.0)
        assert inertia[2, 2] == pytest.approx(np.pi / 2.0 * 0.125, rel=1e-5)

    def test_rounded_normals_are_made_unit(self, case):
        found = case(PLANE.replace("[[0.0, -1.0]]", "[[0.5, -0.866]]"))
        assert np.linalg.norm(found.to_contacts().normals[0]) == pytest.approx(1.0, abs=1e-15)

    def test_overrides(self, case):
        assert case(PLANE, "contacts.friction=0.7").contacts.friction == 0.7

    @pytest.mark.parametrize("path", sorted(CASES.glob("*.toml")), ids=lambda path: path.stem)
    def test_demos_are_read(self, path):
        found = load_case(path)
        assert found.source
        assert found.mass_and_inertia() is not None


SPHERE = """[body]
shape = "sphere"
diameter = 1.0
centre = [1.0, 0.5, 0.0]
"""
SPREAD = "\n[errors]\nflow_force = [0.1, 0.1]\n"

WRONG = [
    (
        PLANE,
        "weight = [0.0, -1.0]\n",
        "",
        "load.weight: is missing; add it: force at the centre of mass",
    ),
    (
        PLANE,
        "[0.0, -1.0]\nflow_force",
        "[0.0, nan]\nflow_force",
        "load.weight: is not finite; give finite",
    ),
    (PLANE, "[0.3, 0.1]", "[0.3]", "load.flow_force: is not a vector; give [x, y]"),
    (PLANE, "[0.3, 0.1]", '"strong"', "load.flow_force: is not a vector"),
    (PLANE, "[0.3, 0.1]", "[[1, 2], [3]]", "load.flow_force: is not a vector"),
    (
        PLANE,
        "[0.3, 0.1]",
        "[0.3, 0.1, 0.0]",
        "load.flow_force: is for 3-D, load.weight has 2 components",
    ),
    (PLANE, "-0.2", "[0.0, 0.0, -0.2]", "load.flow_couple: is for 3-D, load.weight has 2"),
    (PLANE, "-0.2", "[0.0, -0.2]", "load.flow_couple: is not a torque"),
    (PLANE, "centre = [1.0, 0.5]\n", "", "load.centre: is missing"),
    (
        PLANE,
        "[[0.0, -1.0]]",
        "[[0.0, 0.0]]",
        "contacts.normals[0]: has length 0; give a unit vector",
    ),
    (PLANE, "[[0.0, -1.0]]", "[[0.0, -2.0]]", "contacts.normals[0]: has length 2; give a unit"),
    (PLANE, "[[0.0, -1.0]]", "[[0.0, 1.0]]", "contacts.normals[0]: points into the grain; give it"),
    (
        PLANE,
        "[[0.0, -1.0]]",
        "[[0.0, -1.0], [0, -1]]",
        "contacts.normals: 2 given for 1 point; give one",
    ),
    (PLANE, "[[1.0, 0.0]]", "[]", "contacts.points: has 0 items; give 1 or more"),
    (PLANE, "[[1.0, 0.0]]", "[[1.0, 0.5]]", "contacts.points[0]: lies at the centre of mass"),
    (PLANE, "[[1.0, 0.0]]", "[[1.0, nan]]", "contacts.points[0]: is not finite"),
    (
        PLANE,
        "friction = 0.5",
        "friction = -0.5",
        "contacts.friction: is -0.5; give a number of at least 0",
    ),
    (
        PLANE,
        "friction = 0.5",
        "fricton = 0.5",
        'contacts.fricton: unknown key; did you mean "friction"?',
    ),
    (PLANE, "friction = 0.5", "friction = 0.5\nareas = [-1.0]", "contacts.areas[0]: is -1.0; give"),
    (PLANE, "mass = 2.0", "mass = 0.0", "grain.mass: is 0.0; give a number greater than 0"),
    (
        PLANE,
        "inertia = 0.25",
        "inertia = -1.0",
        "grain.inertia: is not a symmetric positive matrix",
    ),
    (PLANE, "inertia = 0.25", "inertia = [1.0, 2.0, 4.0]", "grain.inertia: has principal moments"),
    (
        PLANE,
        "inertia = 0.25",
        "inertia = [1.0, 1.0, 1.0]",
        "grain.inertia: is for 3-D, load.weight has 2",
    ),
    (
        SPACE,
        "[0, 0.2, 0]",
        "0.2",
        "load.flow_couple: is for 2-D, load.weight has 3 components; give all",
    ),
    (
        BODY,
        "[[0.0, -0.5]]",
        "[[0.0, -0.6]]",
        "contacts.points[0]: lies 0.1 off the grain; give points",
    ),
    (BODY, "[[0.0, -0.5]]", "[[0.0, -0.4]]", "contacts.points[0]: lies 0.1 inside the grain"),
    (BODY, "centre = [0.0, 0.0]", "x = 0.0", "body.x: a case has no bed"),
    (PLANE, "[grain]\nmass = 2.0\ninertia = 0.25", SPHERE, "body.shape: is for 3-D, load.weight"),
    (
        BODY,
        "[body]",
        "[grain]\nmass = 1\ninertia = 1\n[body]",
        "body: both [body] and [grain] are given",
    ),
    (PLANE + SPREAD, "[0.1, 0.1]", "[0.1, -0.1]", "errors.flow_force: is -0.1; a standard error"),
    (
        PLANE + SPREAD,
        "[0.1, 0.1]",
        "[1e300, 1]",
        "errors.flow_force: holds 1e+300; give numbers of at most",
    ),
    (PLANE + SPREAD, "[0.1, 0.1]", "[0.1, 0.1, 0.1]", "errors.flow_force: is for 3-D"),
    (
        PLANE + SPREAD,
        "[0.1, 0.1]",
        "[0.1, 0.1]\nsamples = 1",
        "errors.samples: is 1; give a number of",
    ),
]


@pytest.mark.parametrize(("text", "old", "new", "message"), WRONG, ids=[w[3][:40] for w in WRONG])
def test_one_line_names_file_key_and_remedy(case, text, old, new, message):
    assert old in text
    with pytest.raises(SceneError) as caught:
        case(text.replace(old, new))
    line = str(caught.value)
    assert "\n" not in line
    assert re.match(r".*grain\.toml: ", line)
    assert message in line
    assert "; " in line


def test_a_normal_may_point_inward_on_a_grain_that_is_not_convex(case):
    hook = PLANE.replace("[[1.0, 0.0]]", "[[1.0, 0.0], [1.0, 1.0]]").replace(
        "[[0.0, -1.0]]", "[[0.0, -1.0], [0.0, -1.0]]"
    )
    with pytest.raises(SceneError, match=r"normals\[1\]: points into the grain"):
        case(hook)
    assert len(case(hook, "contacts.convex=false").to_contacts()) == 2
    with pytest.raises(SceneError, match=r"normals\[0\]: points into the grain"):
        case(PLANE.replace("[[0.0, -1.0]]", "[[0.0, 1.0]]"), "contacts.convex=false")


def test_built_from_python():
    with pytest.raises(SceneError, match=r"^Case: load: is missing"):
        Case(contacts={"points": [[0, 0]], "normals": [[0, -1]], "friction": 0.5})


def test_no_such_file(tmp_path):
    with pytest.raises(SceneError, match=r"cannot be read.*give the name of a case file"):
        load_case(tmp_path / "none.toml")
