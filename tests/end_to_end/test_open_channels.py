"""Channels with a free surface: the Nusselt film, filling and draining, what is refused, resumed runs, two ranks."""

import numpy as np
import pytest
from scenes import (
    history_of,
    ran,
)
from scipy.integrate import solve_ivp

import incipient
from incipient.planning.plan import make_plan
from incipient.scene.file import loads
from incipient.setup.setup import Setup
from incipient.setup.waves import wave_of

SPEED, LENGTH = 0.25, 3.0
# The slope at which the depth one is that of a film of this mean velocity at Re 1: g sin(a) H^2/(3 nu) = V.
SLOPE = float(np.degrees(np.arcsin(3.0 * SPEED**2)))
FILM = f"""\
title = "A film"
[domain]
kind = "channel"
length = {LENGTH}
height = 1.0
top = "free-surface"
[fluid]
reynolds = 1.0
scale = "flow"
[flow]
kind = "open-channel"
velocity = {SPEED}
[bed]
kind = "inclined"
slope = {SLOPE!r}
[gravity]
acceleration = 1.0
[surface]
elevation = "0"
stations = [0.0, 1.5, 3.0]
[time]
end = 5.0
step = 0.5
start = "steady"
[numerics]
mesh_size = 3.0
error_bars = false
tolerance = 1e-13
interface_tolerance = 1e-11
[output]
fields = false
"""


SHORT = FILM.replace(
    'elevation = "0"',
    'elevation = "0.1*exp(-4*(x - 1)**2)"\nsponge = 1.0\nwave = {amplitude = 0.03, period = 2.0}',
)
SHORT = SHORT.replace("end = 5.0\nstep = 0.5", "end = 0.8\nstep = 0.05").replace(
    "[output]", "[output]\ncheckpoint = 4"
)


def furthest_from_film(result):
    """The largest difference from the film's velocity, over the mean velocity; Nusselt: u = 1.5 V y (2 H - y)/H^2."""
    space = result.velocity.function_space
    x, v = space.tabulate_dof_coordinates(), result.velocity.x.array.reshape(-1, 2)
    exact = np.column_stack([1.5 * SPEED * x[:, 1] * (2.0 - x[:, 1]), 0.0 * x[:, 0]])
    return np.abs(v - exact).max() / SPEED


def test_a_nusselt_film_stays(tmp_path):
    result = incipient.run(loads(FILM), tmp_path)
    history = history_of(tmp_path)
    assert furthest_from_film(result) < 1e-12
    assert max(np.abs(history[f"elevation_{n}"]).max() for n in (1, 2, 3)) < 1e-12
    assert history["inflow"] == pytest.approx(SPEED, rel=1e-14)


def test_a_film_that_becomes_steady_ends_there(tmp_path):
    """From a depth a tenth too large; what is left then is about the change over the rate at which it decays."""
    deep = FILM.replace('elevation = "0"', 'elevation = "0.1"').replace("end = 5.0", "end = 40.0")
    asked = deep.replace("[time]", "[time]\nuntil_steady = 1e-5").replace("1e-13", "1e-9")
    result = incipient.run(loads(asked), tmp_path / "whole")
    history = history_of(tmp_path / "whole")
    assert result.steady.reached and 5.0 < result.steady.time < 40.0
    assert history["time"][-1] == result.steady.time
    assert history["change"][-1] == result.steady.change <= 1e-5 < history["change"][:-1].min()
    rate = -np.polyfit(history["time"][-6:], np.log(history["change"][-6:]), 1)[0]
    assert furthest_from_film(result) < 3 * 1e-3 / rate
    assert f"steady              at t = {result.steady.time:g}, changing by" in result.text()
    short = incipient.run(loads(asked.replace("end = 40.0", "end = 2.0")), tmp_path / "short")
    assert not short.steady.reached and short.steady.time == pytest.approx(2.0)
    assert "NOT steady          at t = 2: it changes by" in short.text()


def test_a_film_whose_level_is_held_up_beyond_its_end_follows_the_backwater_curve(tmp_path):
    """Half of the discharge that flows down the slope at the depth one, which the still level has.

    A slow film on a gentle slope has V H = g h^3 (sin a - cos a dh/dx)/(3 nu), so that dh/dx = tan a (1 - 1/(2 h^3)).
    """
    slope, reynolds, length = 0.05, 0.1, 6.0
    scene = (
        FILM.replace(f"length = {LENGTH}", f"length = {length}")
        .replace(f"velocity = {SPEED}", "velocity = 1.0")
        .replace("reynolds = 1.0", f"reynolds = {reynolds}")
        .replace(f"slope = {SLOPE!r}", f"slope = {float(np.degrees(slope))!r}")
        .replace("acceleration = 1.0", f"acceleration = {float(6.0 / reynolds / np.sin(slope))!r}")
        .replace("1.5, 3.0]", "1.0, 2.0, 4.0, 6.0]")
        .replace("end = 5.0\nstep = 0.5", "end = 8.0\nstep = 0.4")
        .replace("tolerance = 1e-13\ninterface_tolerance = 1e-11\n", "")
    )
    result = incipient.run(loads(scene), tmp_path)
    places = np.array([6.0, 4.0, 2.0, 1.0, 0.0])
    exact = solve_ivp(
        lambda x, h: np.tan(slope) * (1 - 0.5 / h**3), (6.0, 0.0), [1.0], t_eval=places, rtol=1e-9
    ).y[0]
    computed = 1.0 + np.array(result.surface["elevations"][::-1])
    assert exact[-1] < 0.9
    # Left out are the curvature of the surface and, at the inflow, that it comes in level within a cell of 0.45.
    assert computed[:-1] == pytest.approx(exact[:-1], abs=0.02 * (1.0 - exact[-1]))
    assert computed[-1] == pytest.approx(exact[-1], abs=0.45 * np.tan(slope) / 3)


def test_a_wave_maker_in_a_stream_makes_the_wave_that_is_asked_for(tmp_path):
    """Froude number 0.2, k H = 2; the reference is Stokes's formula at two gauges for a whole period.

    At 35 steps a period the phase of the steps makes 3% of the amplitude there, and the cells at the inflow 3%.
    """
    scene = (
        FILM.replace(
            f'kind = "open-channel"\nvelocity = {SPEED}', 'kind = "uniform"\nvelocity = 0.2'
        )
        .replace(f'[bed]\nkind = "inclined"\nslope = {SLOPE!r}\n', "")
        .replace("reynolds = 1.0", "reynolds = 1e4")
        .replace('elevation = "0"', 'wave = {amplitude = 0.01, period = 3.5123}\nbottom = "slip"')
        .replace("[0.0, 1.5, 3.0]", "[0.0, 0.8]")
        .replace("end = 5.0\nstep = 0.5", "end = 12.0\nstep = 0.1")
        .replace("tolerance = 1e-13\ninterface_tolerance = 1e-11", "")
    )
    history, wave = ran(loads(scene), tmp_path), wave_of(Setup(loads(scene)))
    late = history["time"] > 12.0 - 3.5123
    for name, place in (("elevation_1", 0.0), ("elevation_2", 0.8)):
        exact = np.array([wave.elevation(np.array([place]), t)[0] for t in history["time"][late]])
        assert history[name][late] == pytest.approx(exact, abs=0.1 * 0.01)


@pytest.mark.slow
def test_elevations_of_a_channel_have_error_bars_and_so_have_its_ends():
    """Beside a run in steps of a quarter in elements of order four, and one in a channel twice as long."""
    scene = SHORT.replace(
        "error_bars = false\ntolerance = 1e-13\ninterface_tolerance = 1e-11", "order = 2"
    )
    scene = scene.replace("checkpoint = 4", "")
    computed = incipient.run(loads(scene))
    bars = computed.error_bars
    assert [term.name for term in bars.terms] == ["discretisation", "domain"] and not bars.failed
    plain = ("numerics.error_bars=false", "output.fields=false")
    fine = incipient.run(loads(scene, overrides=(*plain, "time.step=0.0125", "numerics.order=4")))
    longer = incipient.run(loads(scene, overrides=(*plain, "domain.length=6", "surface.sponge=2")))
    for term, other in zip(bars.terms, (fine, longer), strict=True):
        true = computed.elevations.apart(other.elevations).max()
        assert 0.5 < term.others["elevation"].max() / true < 4.0, term.name


def test_the_plan_tells_of_the_ends():
    told = make_plan(loads(SHORT)).text()
    assert "Froude number 0.2" in told
    assert "the level is free at the inflow, that of the still fluid beyond the outflow" in told
    fast = make_plan(loads(SHORT.replace(f"velocity = {SPEED}", "velocity = 1.5"))).text()
    assert "Froude number 1.5; the level is the still one at the inflow" in fast


@pytest.mark.quick
@pytest.mark.parametrize(
    ("froude", "warned"), [(0.5, False), (0.94, False), (0.96, True), (1.29, True), (1.31, False)]
)
def test_a_stream_near_the_critical_one_is_warned_of(froude, warned):
    """Of unit gravity and depth; across the bed it is the cosine of the slope."""
    speed = froude * np.sqrt(np.cos(np.radians(SLOPE)))
    warnings = make_plan(
        loads(SHORT.replace(f"velocity = {SPEED}", f"velocity = {float(speed)!r}"))
    ).warnings
    assert (
        any(f"the Froude number, {froude:g}, is between 0.95 and 1.3" in one for one in warnings)
        == warned
    )
    assert len(warnings) == warned


def test_the_plan_tells_what_error_bars_take(tmp_path, said_by):
    path, key = tmp_path / "short.toml", "numerics.error_bars"
    path.write_text(SHORT)
    with_bars, without = (said_by("plan", path, "--set", f"{key}={on}") for on in ("true", "false"))
    # In longer steps, these in another order, and coarse ones of this channel and of a longer one.
    runs = ", ".join(f"P{k}-P{k - 1} in steps of 0.1" for k in (3, 4, 2, 2))
    assert f"error bars take 4 more runs of the same duration ({runs})" in with_bars
    assert "numerics.error_bars = false leaves them out" in with_bars
    assert "leaves them out" not in without
