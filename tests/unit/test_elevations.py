"""Elevations of free surfaces and Stokes waves."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import TANK

from incipient.accuracy.coarse_runs import changed, farther
from incipient.accuracy.goal import Goal, relative
from incipient.accuracy.search import less_of_the_model
from incipient.accuracy.terms import (
    SAFETY,
    _resolve_waves,
    by_coarser_runs,
    doubt_of_stream,
    terms_of_model,
)
from incipient.errors import SceneError
from incipient.planning.discretisation import order_of
from incipient.planning.plan import make_plan
from incipient.results.errorbars import NO_GRAIN, ErrorBars, Loads
from incipient.results.loads import Elevations
from incipient.scene import Scene
from incipient.scene.file import loads
from incipient.setup.setup import Setup
from incipient.setup.waves import stokes_wave, wave_of

pytestmark = pytest.mark.quick


# Elevations of two runs side by side, what their differences are taken for, and what is asked for of them.


LONGER = TANK.replace("length = 1.0", "length = 2.0\norigin = [-1.0, 0.0]")
WAVE = f"""\
{LONGER}[surface]
elevation = "0.01*cos(pi*x)"
[time]
end = 4.0
step = 0.1
[numerics]
accuracy = 0.01
"""


def wave(steps: int, phase: float = 0.0, size: float = 1.0) -> Elevations:
    """A wave of a period of 2 pi, at its crest and halfway, in so many steps."""
    times = np.linspace(0.0, 4.0, steps + 1)
    crest = size * np.cos(times - phase * times)
    return Elevations(times, np.column_stack([crest, 0.5 * crest]), size)


def of(elevations: Elevations) -> Loads:
    values = {"elevation": elevations, "level": elevations.values[-1]}
    return Loads(NO_GRAIN, values)


def test_waves_are_compared_at_the_times_of_the_longer_steps():
    """The larger of two cosines' differences is sought on the coarse times; the finer ones have these or nearly so."""
    few, many = wave(10, phase=0.01), wave(40)
    expected = np.abs(np.cos(0.99 * few.times) - np.cos(few.times)).max()
    assert few.apart(many) == pytest.approx([expected, 0.5 * expected], rel=1e-12)
    assert many.apart(few) == pytest.approx(few.apart(many), rel=1e-15)
    # Times that do not lie on one another: by a cubic spline, which errs by 5/384 h^4 at most within.
    assert wave(27).apart(wave(40)).max() < 5 / 384 * 0.1**4 * 20.0


def term_of(step_error: float, mesh_error: float, order: int = 2):
    """The term of a run whose phase errs by so much for its steps, and whose height for its mesh."""
    scene = changed(loads(WAVE), numerics={"order": order})

    def solved(one: Scene) -> Loads:
        longer = (one.time.step / 0.1) ** 2
        size = 1.0 + (mesh_error if order_of(one) == order else 0.0)
        return of(wave(round(4.0 / one.time.step), phase=step_error * longer, size=size))

    return by_coarser_runs(scene, solved(scene), solved)


def test_step_and_mesh_are_told_apart():
    """Small errors of the second order in the steps: the part of the steps is the allowance times the error."""
    term = term_of(1e-4, 1e-3)
    of_step, of_mesh = (part.others["elevation"] for part in term.parts)
    exact = np.abs(np.cos((1 - 1e-4) * wave(10).times) - np.cos(wave(10).times)).max()
    assert of_step[0] == pytest.approx(SAFETY * exact, rel=0.01)
    assert of_mesh == pytest.approx([SAFETY * 1e-3, SAFETY * 5e-4], rel=1e-6)
    bars = ErrorBars((term,))
    # What an estimate leaves out is in proportion to the error, relative to the largest elevation.
    both = of_step + of_mesh
    assert bars.total.others["elevation"] == pytest.approx(both / (1.0 - both[0] / 1.001))
    assert bars.total.force.shape == (0,)
    (error, _) = bars.total.others["elevation"]
    assert f"discretisation    elevation {error:.1e}" in "\n".join(bars.lines())
    result = of(wave(40, size=0.5))
    assert relative(Goal.of(loads(WAVE)), result, term) == pytest.approx(2.0 * error)


def test_waves_out_of_phase_are_no_small_error():
    """At 0.06 of the phase longer steps are all out of it: what they change by then is less than sixteen times that."""
    term, result = term_of(0.06, 0.0), wave(40, phase=0.06)
    true = result.apart(wave(40))[0]
    assert term.parts[0].others["elevation"][0] > true
    assert (
        term.parts[0].others["elevation"][0] / SAFETY > 0.5
    )  # of the largest elevation, which nobody takes for small


def test_an_accuracy_without_a_grain_is_that_of_the_elevation():
    assert (
        "until the error of the elevation (of discretisation) is below 0.01"
        in make_plan(loads(WAVE)).text()
    )


CHANNEL_OF_STOKES_WAVES = """\
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
CHANNEL = (
    WAVE.replace('kind = "box"', 'kind = "channel"')
    .replace("length = 2.0", "length = 12.0")
    .replace('kind = "still"', 'kind = "uniform"\nvelocity = 0.2')
    .replace('elevation = "0.01*cos(pi*x)"', "sponge = 4.0\nstations = [3.0]")
)
WAVES = "wave = {amplitude = 0.01, period = 5.0}\nsponge"


@pytest.mark.parametrize(
    ("text", "origin", "length", "sponge"),
    [
        # The still level stays where the scene has it: without waves the inflow moves, by half of 12.
        (CHANNEL, -7.0, 18.0, 4.0),
        # Waves come in at the same place, whatever makes them.
        (CHANNEL.replace("sponge", WAVES), -1.0, 18.0, 6.0),
        # The flow comes in over the same place of the bed: three periods of 2.5 are the next above 6.
        (
            CHANNEL + '[bed]\nkind = "sinusoidal"\namplitude = 0.1\nwavelength = 2.5\n',
            -8.5,
            19.5,
            4.0,
        ),
    ],
)
def test_the_end_of_a_channel_moves_away_at_which_nothing_is_asked_for(
    text, origin, length, sponge
):
    longer = farther(loads(text))
    assert (longer.domain.origin, longer.domain.length) == ((origin, 0.0), length)
    assert longer.surface.sponge == pytest.approx(sponge)
    assert longer.surface.stations == (3.0,)
    assert longer.viscosity == pytest.approx(loads(text).viscosity)


def test_an_accuracy_of_all_makes_a_channel_longer():
    """The waves' height errs as the inverse square of the length: by 0.2 at first, of which both ends may keep 0.05."""
    scene = loads(CHANNEL.replace("sponge", WAVES).replace("accuracy = 0.01", "accuracy = 0.1"))

    def solved(one: Scene) -> Loads:
        return of(wave(20, size=1.0 + 0.2 * (12.0 / one.domain.length) ** 2))

    computed = solved(scene)
    term = terms_of_model(scene)["domain"](computed, solved)
    error = relative(Goal.of(scene), computed, term)
    # Relative to waves that are higher by the error itself.
    assert error == pytest.approx(0.2 / 1.2, rel=1e-6)
    longer = less_of_the_model(scene, 0.1, (term,), {"domain": error})
    assert 0.2 * (12.0 / longer.domain.length) ** 2 < 0.05
    assert longer.domain.origin == (-1.0, 0.0)


OPEN_CHANNEL = """
[domain]
kind = "channel"
length = 6.0
height = 1.0
top = "free-surface"
[fluid]
reynolds = 10.0
scale = "flow"
[flow]
{stream}
[gravity]
acceleration = 10.0
[surface]
stations = [1.0]
[time]
end = 1.0
step = 0.1
[numerics]
order = 2
mesh_size = {size}
"""


@pytest.mark.parametrize(
    ("stream", "size", "doubted"),
    [
        ('kind = "open-channel"\nvelocity = 1.0', 2.0, False),
        ('kind = "open-channel"\nvelocity = 1.0', 4.0, True),
        ('kind = "still"', 4.0, False),
    ],
)
def test_levels_of_streams_on_cells_above_a_quarter_of_the_depth_are_in_doubt(
    stream: str, size: float, doubted: bool
) -> None:
    """Estimates fell to 0.3 of the error on cells of 0.4 (mesh_size 4), held at 2 (docs/explanation/surface.md)."""
    doubt = doubt_of_stream(loads(OPEN_CHANNEL.format(stream=stream, size=size)))
    assert bool(doubt) is doubted
    assert ("use numerics.mesh_size = 2.5 or" in doubt) is doubted


# Stokes's wave of second order against the equations that it solves, and its wave number on streams.


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


def test_a_wave_that_is_too_high_for_second_order():
    assert wave_of(Setup(loads(CHANNEL_OF_STOKES_WAVES))).current == pytest.approx(0.2)
    assert "incoming waves are 3.12 long" in make_plan(loads(CHANNEL_OF_STOKES_WAVES)).text()
    with pytest.raises(
        SceneError,
        match=r"surface.wave: its second harmonic is 0\.\d+ of the first, more than 0.25",
    ):
        wave_of(
            Setup(loads(CHANNEL_OF_STOKES_WAVES.replace("amplitude = 0.02", "amplitude = 0.3")))
        )


def test_waves_in_steps_that_do_not_resolve_them_tell_no_order():
    """Second differences of cos t are about dt^2 of it: 0.16, 1.8 and, seen from those of the run, 16 here."""
    fine = of(wave(100))
    assert [_resolve_waves(fine, of(wave(steps))) for steps in (10, 3, 1)] == [True, False, False]
    assert _resolve_waves(Loads(np.zeros(6)), Loads(np.ones(6)))
