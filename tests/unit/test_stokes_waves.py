"""Stokes's wave of second order against the equations that it solves, and its wave number on streams."""

import numpy as np
import pytest

from incipient.errors import SceneError
from incipient.planning.plan import make_plan
from incipient.scene.file import loads
from incipient.setup.setup import Setup
from incipient.setup.waves import stokes_wave, wave_of

pytestmark = pytest.mark.quick
H, G, U, LATE = 1.0, 1.0, 0.2, 1e3


def uniform(y):
    return np.full_like(y, U)


def left_over(a):
    """What a wave of an amplitude leaves of both conditions on its surface and of its mean discharge; div v."""
    wave = stokes_wave(a, 1.5, H, G, uniform)
    x = np.linspace(0.0, 2 * np.pi / wave.number, 200, endpoint=False)
    y, e = H + wave.elevation(x, LATE), 1e-5

    def changes(of):
        return [
            (of(e, 0, 0) - of(-e, 0, 0)) / (2 * e),
            *((of(0, *d) - of(0, *-d)) / (2 * e) for d in e * np.eye(2)),
        ]

    def velocity(t, dx, dy):
        return np.array(wave.velocity(x + dx, y + dy, LATE + t))

    u, v = velocity(0, 0, 0)
    v_t, v_x, v_y = changes(velocity)
    h_t, h_x, _ = changes(lambda t, dx, dy: wave.elevation(x + dx, LATE + t))
    along, upwards = v_t + (U + u) * v_x + v * v_y
    kinematic, dynamic = h_t + (U + u) * h_x - v, along + (upwards + G) * h_x
    nodes, weights = np.polynomial.legendre.leggauss(20)
    heights = 0.5 * (1 + nodes[:, None]) * y
    through = (
        0.5 * y * (weights @ wave.velocity(np.broadcast_to(x, heights.shape), heights, LATE)[0])
    ).mean()
    return (
        np.abs(kinematic).max(),
        np.abs(dynamic).max(),
        abs(through),
        np.abs(v_x[0] + v_y[1]).max(),
    )


def test_what_is_left_is_of_third_order():
    """Halving the amplitude divides by eight; the mean discharge, which has even orders only, by sixteen."""
    (*high, _), (*low, divergence) = left_over(0.02), left_over(0.01)
    assert np.divide(high, low) == pytest.approx([8.0, 8.0, 16.0], rel=0.03)
    assert divergence < 1e-9


def test_the_second_harmonic_is_that_of_the_textbooks():
    """a^2 k cosh(kH) (2 + cosh 2kH)/(4 sinh^3 kH)."""
    wave = stokes_wave(0.02, 1.5, H, G, uniform)
    k = wave.number
    exact = 0.02**2 * k * np.cosh(k) * (2 + np.cosh(2 * k)) / (4 * np.sinh(k) ** 3)
    assert wave.second == pytest.approx(exact, rel=1e-12)
    assert (1.5 - k * U) ** 2 == pytest.approx(G * k * np.tanh(k * H), rel=1e-9)


def test_on_a_linear_shear_the_wave_is_exact():
    """U = U_s + S (y - H): (c - U_s)^2 k coth kH + S (c - U_s) = g and v as sinh(k y) (Thompson 1949)."""
    shear, surface = 0.4, 0.5
    wave = stokes_wave(1e-4, 1.5, H, G, lambda y: surface + shear * (y - H))
    k, y = wave.number, np.linspace(0.0, 1.0, 20)
    relative = 1.5 / k - surface
    assert relative**2 * k / np.tanh(k) + shear * relative == pytest.approx(G, rel=1e-7)
    assert wave.rise(y) == pytest.approx(np.sinh(k * y) / np.sinh(k), abs=1e-5)


def test_on_half_a_parabola_the_first_harmonic_solves_the_linear_equations():
    """The transport of vorticity, (w - k U) (k v - du/dy) = U'' v, and both conditions on the surface."""
    a, mean, crest = 1e-6, 0.3, 2e3 * np.pi / 1.5
    wave = stokes_wave(a, 1.5, H, G, lambda y: 1.5 * mean * y * (2.0 - y))
    k, y = wave.number, np.linspace(0.1, 0.9, 9)

    def along(y):
        return wave.velocity(np.zeros_like(y), y, crest)[0] / a

    def upwards(y):
        return wave.velocity(np.full_like(y, np.pi / (2 * k)), y, crest)[1] / a

    own = 1.5 - k * 1.5 * mean * y * (2.0 - y)
    vorticity = k * upwards(y) - (along(y + 1e-4) - along(y - 1e-4)) / 2e-4
    assert own * vorticity == pytest.approx(-3.0 * mean * upwards(y), abs=1e-4)
    own, top = 1.5 - k * 1.5 * mean, np.ones(1)
    assert upwards(top) == pytest.approx(own, rel=1e-5)
    assert own * along(top) == pytest.approx(G * k, rel=1e-5)


CHANNEL = """\
[domain]
kind = "channel"
length = 4.0
height = 1.0
top = "free-surface"
[fluid]
reynolds = 1e4
scale = "flow"
[flow]
kind = "uniform"
velocity = 0.2
[gravity]
acceleration = 1.0
[surface]
wave = {amplitude = 0.02, period = 3.5}
[time]
end = 1.0
step = 0.1
"""


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        (
            "height = 1.0",
            'height = 1.0\nwidth = 1.0\nsides = "wall"',
            "surface.wave: is two-dimensional but",
        ),
    ],
)
def test_what_is_refused(old, new, why):
    with pytest.raises(SceneError) as refused:
        loads(CHANNEL.replace(old, new))
    assert why in str(refused.value)


def test_a_wave_that_is_too_high_for_second_order():
    assert wave_of(Setup(loads(CHANNEL))).current == pytest.approx(0.2)
    assert "incoming waves are 3.12 long" in make_plan(loads(CHANNEL)).text()
    with pytest.raises(
        SceneError,
        match=r"surface.wave: its second harmonic is 0\.\d+ of the first, more than 0.25",
    ):
        wave_of(Setup(loads(CHANNEL.replace("amplitude = 0.02", "amplitude = 0.3"))))
