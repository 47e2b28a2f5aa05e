"""Formulas: values against numpy and against hand calculation, and the message for each kind of mistake."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from incipient.effects.plan import make_plan
from incipient.errors import SceneError
from incipient.planning.flow_setup import Setup
from incipient.scene import loads
from incipient.scene.expression import MAXIMUM_LENGTH, Expression, expressions

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


def test_time_defaults_to_zero():
    np.testing.assert_array_equal(Expression("x + t")(POINTS), X)


def test_result_may_be_written_to():
    """Neither a number spread over the points nor a coordinate is a view of what it came from."""
    for text in ("1", "x"):
        values = Expression(text)(POINTS)
        values[:] = 7.0
    assert POINTS[0, 0] == 0.25


def test_no_points():
    assert Expression("x*t")(np.empty((3, 0)), 1.0).shape == (0,)


def test_the_branch_not_taken_may_be_undefined():
    points = np.array([[-1.0, 4.0], [0, 0], [0, 0]])
    np.testing.assert_array_equal(Expression("where(x > 0, sqrt(x), 0)")(points), [0.0, 2.0])


@pytest.mark.parametrize(
    ("text", "value"),
    [("1/x", "inf"), ("log(x)", "-inf"), ("sqrt(x - 1)", "nan"), ("10**1000", "inf")],
)
def test_values_that_are_not_finite(text, value):
    points = np.array([[1.0, 0.0], [2.0, 5.0], [0.0, 0.0]])
    at = "x = 1, y = 2" if text == "10**1000" else "x = 0, y = 5"
    message = f'"{text}" is {value} at {at}, z = 0, t = 0.5; give a formula that is finite there'
    with pytest.raises(SceneError) as caught:
        Expression(text)(points, 0.5)
    assert str(caught.value).startswith(message)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("y*(", "is not a formula ('(' was never closed); use numbers, x, y, z, t, pi"),
        ("", "is not a formula (invalid syntax)"),
        ("x = 1", "is not a formula"),
        ("x\0", "is not a formula"),
        ("q + 1", 'contains the unknown name "q"'),
        ("sinh(x)", 'calls the unknown function "sinh"'),
        ("sin + 1", "uses the function sin as a number; write sin(...)"),
        ("sin(x, y)", "gives sin 2 argument(s); give it 1"),
        ("max(x)", "gives max 1 argument(s); give it at least 2"),
        ("where(x, 1, 2)", 'takes "x" for a condition; compare two numbers with < <= > or >='),
        ("where(x == 1, 1, 2)", 'takes "x == 1" for a condition'),
        ("y*(y < 1)", "uses a comparison as a number; write where(condition, a, b)"),
        ("x^2", "contains ^; write ** for a power"),
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
    ],
)
def test_what_is_not_a_formula(text, words):
    with pytest.raises(SceneError) as caught:
        Expression(text)
    assert str(caught.value).startswith(f'"{text}" ')
    assert words in str(caught.value)


def test_long_and_deep_formulas():
    terms = "+".join("x" * (MAXIMUM_LENGTH // 2))
    np.testing.assert_allclose(Expression(terms)(POINTS), MAXIMUM_LENGTH // 2 * X, rtol=1e-14)
    with pytest.raises(SceneError, match=r'"x\+x.*" has 501 characters; shorten it to 500'):
        Expression(terms + "+x")
    with pytest.raises(SceneError, match=r"is not a formula|too deeply nested"):
        Expression("(" * 240 + "x" + ")" * 240)


def test_variables():
    assert Expression("where(t > 1, sin(x), pi)").variables == {"x", "t"}
    assert Expression("2*pi").variables == frozenset()


def test_equal_by_text():
    assert Expression("x") == Expression("x") != Expression("y")


def gives_numbers_or_one_clear_error(text):
    try:
        values = Expression(text)(POINTS, T)
    except SceneError as error:
        return "; " in str(error)
    return values.shape == (3,) and bool(np.isfinite(values).all())


# What `st.text` has without an alphabet as well, by a table that takes a second to make.
CHARACTERS = st.characters(exclude_categories=["Cs"])


@given(st.text(CHARACTERS, max_size=40))
def test_any_text_gives_numbers_or_one_clear_error(text):
    assert gives_numbers_or_one_clear_error(text)


@given(st.text(alphabet="xyzt0123.+-*/()<>, wherminaxsqp", max_size=30))
def test_any_text_of_our_alphabet_gives_numbers_or_one_clear_error(text):
    assert gives_numbers_or_one_clear_error(text)


def test_a_value_that_is_not_finite_names_the_key_of_its_formula():
    with pytest.raises(SceneError, match=r'^flow\.components\[1\]: "1/x" is inf at x = 0,'):
        expressions(("y", "1/x"), "flow.components")[1](np.zeros((3, 1)))
    with pytest.raises(SceneError, match=r'^"1/x" is inf at x = 0,'):
        Expression("1/x")(np.zeros((3, 1)))


FORMULAS = """
[domain]
length = 8.0
height = 4.0
{top}
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
MOVING = '[body]\nshape = "disc"\ndiameter = 1.0\ncentre = [4.0, 2.0]\nmotion = "prescribed"\n'
MOVING += 'course = ["0", "1/t", "0"]\n'


def test_formulas_that_become_infinite_only_in_the_run_are_refused_with_their_keys():
    scene = loads(FORMULAS.format(top="", flow="1/y", more=""))
    with pytest.raises(SceneError, match=r'^flow\.components\[0\]: "1/y" is inf at x = 0, y = 0,'):
        Setup(scene).base_flow.entering(np.zeros((3, 1)), 0.0)
    scene = loads(FORMULAS.format(top="", flow="y", more=MOVING))
    with pytest.raises(SceneError, match=r'^body\.course\[1\]: "1/t" is inf at .* t = 0;'):
        make_plan(scene)
