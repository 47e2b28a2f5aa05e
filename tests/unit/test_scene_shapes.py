"""Shapes, lengths and formulas in scenes."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes import message, scene
from test_scene_file import CHARACTERS

from incipient.errors import SceneError
from incipient.planning.plan import make_plan
from incipient.scene import Disc, Gravity, Star, Time
from incipient.scene.expression import MAXIMUM_LENGTH, Expression
from incipient.scene.file import loads
from incipient.scene.grains import mass_and_inertia
from incipient.setup.geometry import rigid_body
from incipient.setup.setup import Setup


def test_a_star_is_that_of_its_formula():
    grain = Star(radius=0.5, cosines=(0, 0.2), sines=(0, 0, 0.1), x=4.0).grain
    angle = np.linspace(0.0, 2.0 * np.pi, 50)
    radius = 0.5 * (1.0 + 0.2 * np.cos(2.0 * angle) + 0.1 * np.sin(3.0 * angle))
    outline = grain.pole + radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    assert grain.level(outline) == pytest.approx(0.0, abs=1e-12)


# A grain's mass has one source for all that weighs or turns.


AREA, MASS = math.pi / 4, 2.0
GRAVITY = Gravity(acceleration=10)


@pytest.mark.parametrize(
    ("keys", "moment"),
    [
        ({"density": MASS / AREA}, MASS / 8),
        ({"mass": MASS}, MASS / 8),
        ({"mass": MASS, "inertia": 0.5}, 0.5),
    ],
)
def test_mass_or_density_give_the_same_grain(keys, moment):
    """Weight, moment of inertia (m d^2/8 of a disc), stress unit of the Shields number, and a free grain's inertia."""
    result = scene(body=Disc(diameter=1, x=4, **keys), gravity=GRAVITY)
    assert (result.mass, result.density) == pytest.approx((MASS, MASS / AREA))
    mass, inertia = mass_and_inertia(result.body)
    assert mass == pytest.approx(MASS) and inertia == pytest.approx(moment * np.eye(3), rel=1e-4)
    assert Setup(result).stress_unit == pytest.approx((MASS / AREA - 1) * 10)
    body = Disc(diameter=1, centre=(4, 2), motion="free", **keys)
    inert = rigid_body(scene(body=body, time=Time(end=1, step=0.1)).body).inertia
    assert (inert.mass, inert.moments[0]) == pytest.approx((MASS, moment), rel=1e-4)
    assert make_plan(result).numbers.density_ratio == pytest.approx(MASS / AREA)


@pytest.mark.parametrize("keys", [{}, {"density": 0.0}, {"mass": 1.0, "inertia": 0.0}])
def test_how_a_grain_turns_is_not_known_without_mass_or_moment(keys):
    assert mass_and_inertia(Disc(diameter=1, x=4, **keys)) is None


# Formulas: values against numpy and against hand calculation, and the message for each kind of mistake.


POINTS = np.array([[0.25, 1.0, 2.0], [0.5, 1.5, 3.0], [0.1, 0.2, 0.3]])
X, Y, Z = POINTS
T = 0.75


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("sin(pi*t)*y", np.sin(np.pi * T) * Y),
        ("x + 2*y - z/4", X + 2 * Y - Z / 4),
        ("-x**2", -(X**2)),
        ("+x", X),
        ("2**-1", 0.5 + 0 * X),
        ("cos(x)*tan(y)*exp(-z)", np.cos(X) * np.tan(Y) * np.exp(-Z)),
        ("log(x) + sqrt(y) + tanh(z) + abs(-x)", np.log(X) + np.sqrt(Y) + np.tanh(Z) + X),
        ("min(x, y, 1.25)", [0.25, 1.0, 1.25]),
        ("max(x, y, 1.25)", [1.25, 1.5, 3.0]),
        ("where(y < 1, x, 2*x)", [0.25, 2.0, 4.0]),
        ("where(0.3 <= x <= 1, 1, 0)", [0, 1, 0]),
        ("where(x > 0.5 and not y >= 3, 1, 0)", [0, 1, 0]),
        ("where(x < 0.5 or y > 2, 1, 0)", [1, 0, 1]),
        ("y*(y < 1) - (x > 1)", [0.5, 0.0, -1.0]),
        ("+".join("x" * (MAXIMUM_LENGTH // 2)), MAXIMUM_LENGTH // 2 * X),
        ("where(x - 1, 1, 2)", [1, 2, 1]),
        ("3", [3.0, 3.0, 3.0]),
        ("t", [T, T, T]),
        (" y ", Y),
    ],
)
def test_values(text, expected):
    values = Expression(text)(POINTS, T)
    assert values.shape == (3,)
    assert values.dtype == np.float64
    np.testing.assert_allclose(values, expected, rtol=1e-15, atol=1e-15)


@pytest.mark.parametrize("text", ["1", "x"])
def test_values_are_no_view_of_a_number_or_of_the_points(text):
    Expression(text)(POINTS)[:] = 7.0
    assert POINTS[0, 0] == 0.25 and Expression("x*t")(np.empty((3, 0)), 1.0).shape == (0,)


def test_the_branch_not_taken_may_be_undefined():
    points = np.array([[-1.0, 4.0], [0, 0], [0, 0]])
    np.testing.assert_array_equal(Expression("where(x > 0, sqrt(x), 0)")(points), [0.0, 2.0])


@pytest.mark.parametrize(
    ("text", "value"),
    [("1/x", "inf"), ("log(x)", "-inf"), ("sqrt(x - 1)", "nan"), ("10**1000", "inf")],
)
def test_values_that_are_not_finite(text, value):
    at = "x = 1, y = 2" if text == "10**1000" else "x = 0, y = 5"
    said = message(lambda: Expression(text)(np.array([[1.0, 0.0], [2.0, 5.0], [0.0, 0.0]]), 0.5))
    expected = f'"{text}" is {value} at {at}, z = 0, t = 0.5; give a formula that is finite there'
    assert said.startswith(expected)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("y*(", "is not a formula ('(' was never closed); use numbers, x, y, z, t, pi"),
        ("", "is not a formula (invalid syntax)"),
        ("x = 1", "is not a formula"),
        ("x\0", "is not a formula"),
        ("q + 1", 'contains the unknown name "q"'),
        ("sinh(x)", 'contains the unknown name "sinh"'),
        ("sin + 1", "gives sin 0 argument(s); give it 1"),
        ("sin(x, y)", "gives sin 2 argument(s); give it 1"),
        ("max(x)", "gives max 1 argument(s); give it at least 2"),
        ("where(x == 1, 1, 2)", 'contains "x == 1", which is not allowed'),
        ("x^2", 'contains "x ^ 2", which is not allowed; use numbers, x, y, z, t, pi, + - * / **'),
        ("x // 2", 'contains "x // 2", which is not allowed'),
        ("1j", 'contains "1j", which is not allowed'),
        ("True", 'contains "True", which is not allowed'),
        ("'x'", "contains \"'x'\", which is not allowed"),
        ("x.real", 'contains "x.real", which is not allowed'),
        ("x[0]", 'contains "x[0]", which is not allowed'),
        ("(lambda: 1)()", "which is not allowed"),
        ("__import__('os').system('true')", "which is not allowed"),
        ("sin(*[x])", 'contains "*[x]", which is not allowed'),
        ("sin(x=1)", 'contains "sin(x=1)", which is not allowed'),
        ("[y for y in x]", "which is not allowed"),
        ("1" + "0" * 400, "contains a number that is too large"),
        ("1e999", "contains a number that is too large"),
        ("x+" * 250 + "x", "has 501 characters; shorten it to 500"),
        ("(" * 240 + "x" + ")" * 240, "is not a formula (too "),
    ],
)
def test_what_is_not_a_formula(text, words):
    said = message(lambda: Expression(text))
    assert f'"{text[:20]}' in said and words in said


@given(
    st.text(CHARACTERS, max_size=40)
    | st.text(alphabet="xyzt0123.+-*/()<>, wherminaxsqp", max_size=30)
)
def test_any_text_gives_numbers_or_one_clear_error(text):
    try:
        values = Expression(text)(POINTS, T)
    except SceneError as error:
        assert "; " in str(error)
    else:
        assert values.shape == (3,) and np.isfinite(values).all()


FORMULAS = """
[domain]
length = 8.0
height = 4.0
[fluid]
reynolds = 1.0
scale = "flow"
[flow]
kind = "expression"
components = ["{flow}", "0"]
[time]
end = 1.0
step = 0.1
{more}
"""
MOVING = """
[body]
shape = "disc"
diameter = 1.0
centre = [4.0, 2.0]
motion = "prescribed"
course = ["0", "1/t", "0"]
"""


@pytest.mark.parametrize(
    ("flow", "more", "act", "said"),
    [
        (
            *("1/y", "", lambda scene: Setup(scene).base_flow.entering(np.zeros((3, 1)), 0.0)),
            r'flow\.components\[0\]: "1/y" is inf at x = 0, y = 0,',
        ),
        ("y", MOVING, make_plan, r'body\.course\[1\]: "1/t" is inf at .* t = 0;'),
    ],
)
def test_formulas_that_become_infinite_only_in_the_run_are_refused_with_their_keys(
    flow, more, act, said
):
    scene = loads(FORMULAS.format(flow=flow, more=more))
    with pytest.raises(SceneError, match=f"^{said}"):
        act(scene)
