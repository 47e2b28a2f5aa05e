"""Flows and grains whose velocity or acceleration jumps."""

import math

import numpy as np
import pytest
from scenes import IN_STREAM, history_of

import incipient
from incipient.scene.expression import kinks, of_time
from incipient.scene.file import loads
from incipient.scene.flows import Gust

FEW = "[numerics]\nmesh_size = 3.0\nerror_bars = false\n[output]\nfields = false\n"
STILL = IN_STREAM.replace("uniform", "still").replace("[domain]", '[domain]\nkind = "box"')
FORWARD = STILL + 'motion = "prescribed"\ncourse = ["1", "0", "0"]\n'
THROWN = STILL + 'motion = "free"\ndensity = 2.0\nvelocity = [1.0, 0.0]\n'


@pytest.mark.parametrize(
    ("scene", "scheme", "way"),
    [
        (IN_STREAM, "bdf1", 1.0),
        (IN_STREAM, "bdf2", 1.0),
        (FORWARD, "bdf2", -1.0),
        (THROWN, "bdf2", -1.0),
    ],
)
def test_the_impulse_acts_in_the_first_step_alone(tmp_path, scene, scheme, way):
    """Halved steps double it; afterwards the stream pushes the disc ahead, or still fluid resists it, ever less."""
    pushed = []
    for step in (0.1, 0.05):
        time = f'[time]\nend = 0.4\nstep = {step}\nscheme = "{scheme}"\n'
        incipient.run(loads(scene + time + FEW), tmp_path / str(step))
        pushed.append(way * history_of(tmp_path / str(step))["force_x"])
    assert pushed[1][0] == pytest.approx(2.0 * pushed[0][0], rel=0.2)
    for later in (force[1:] for force in pushed):
        assert later[-1] > 0.0
        assert (later[:-1] > later[1:]).all()


GUSTY = IN_STREAM.replace("[body]", "[flow.gust]\nshape = 'points'\npoints = {course}\n[body]")
SHAKEN = IN_STREAM.replace('"uniform"', '"expression"\ncomponents = ["{course}", "0"]')
PUSHED = STILL + 'motion = "prescribed"\ncourse = ["{course}", "0", "0"]\n'


@pytest.mark.parametrize(
    ("scene", "course", "mass"),
    [
        (GUSTY, "[[0, 0], [0.1, 0], [0.2, 0.1], [0.3, -0.1]]", 0.5 * math.pi),
        (PUSHED, "min(max(t - 0.1, 0), max(0.5 - 2*t, -0.1))", -0.25 * math.pi),
        (SHAKEN, "min(max(t - 0.1, 0), max(0.5 - 2*t, -0.1))", 0.5 * math.pi),
    ],
)
def test_the_force_follows_a_jump_of_the_acceleration_at_once(tmp_path, scene, course, mass):
    """A disc in potential flow: its added mass times its acceleration, in that of the flow with the mass displaced.

    The cells at the disc add 3% to the added mass, 12% if they are four times as large, and the box half a percent.
    """
    text = scene.replace("{course}", course).replace("[3.0, 2.0]", "[8.0, 8.0]")
    text = text.replace("length = 8.0", "length = 16").replace("height = 4.0", "height = 16")
    text = text.replace("reynolds = 20.0", "reynolds = 1e5")
    time, few = "[time]\nend = 0.4\nstep = 0.02\n", FEW.replace("3.0", "0.7")
    incipient.run(loads(text + time + few), tmp_path)
    expected = mass * np.repeat([0.0, 1.0, -2.0, 0.0], 5)
    assert history_of(tmp_path)["force_x"] == pytest.approx(expected, rel=0.04, abs=0.01)


@pytest.mark.parametrize(("start", "rise"), [(0.1, 0.02), (0.105, 0.01), (0.115, 0.005)])
def test_a_ramp_of_one_step_acts_in_that_step_alone(tmp_path, start, rise):
    """The same force of a top-hat that rises by 0.1 within a step of 0.02 and falls so."""
    text = GUSTY.replace("'points'", "'top-hat'").replace(
        "points = {course}", f"start = {start}\nduration = 0.1\nrise = {rise}\nstrength = 1.1"
    )
    text = text.replace("[3.0, 2.0]", "[8.0, 8.0]").replace("reynolds = 20.0", "reynolds = 1e5")
    text = text.replace("length = 8.0", "length = 16").replace("height = 4.0", "height = 16")
    time, few = "[time]\nend = 0.3\nstep = 0.02\n", FEW.replace("3.0", "0.7")
    incipient.run(loads(text + time + few), tmp_path)
    force, pushed = history_of(tmp_path)["force_x"], 0.5 * math.pi * 0.1 / 0.02
    assert force[[5, 10]] == pytest.approx([pushed, -pushed], rel=0.04)
    assert np.abs(np.delete(force, [0, 5, 10])).max() < 0.02 * pushed


@pytest.mark.parametrize("adaptive", ["", "tolerance = 0.01"])
def test_the_impulse_of_a_jump_acts_in_one_step(tmp_path, adaptive):
    """Of the grain's velocity at t = 0.8, to which eight steps of 0.1 add up less round-off."""
    time = f"[time]\nend = 1.0\nstep = 0.1\n{adaptive}\n"
    jump = PUSHED.replace("{course}", "where(t < 0.8, 0, 1)").replace("= 20.0", "= 1e4")
    incipient.run(loads(jump + time + FEW), tmp_path)
    force = history_of(tmp_path)["force_x"]
    pushed = np.argmin(force)
    assert force[pushed] < -5.0
    assert np.abs(np.delete(force, pushed)).max() < 0.05 * abs(force[pushed])


def test_points_closer_than_steps_sample_a_curve():
    times = [0.0, 1.0, *np.linspace(2.0, 2.5, 6), 3.0]
    gust = Gust(shape="points", start=1.0, points=[(time, time**2) for time in times])
    assert gust.kinks(0.05) == pytest.approx(1.0 + np.array(times))
    assert gust.kinks(0.1) == pytest.approx([1.0, 2.0, 3.0, 3.5, 4.0])
    assert len(Gust(shape="cosine").kinks(0.1)) == 0


@pytest.mark.parametrize(
    ("formulas", "times"),
    [
        (["min(t, 1)", "sin(2*t) + abs(t - 1.5)", "3"], [1.0, 1.5]),
        (["where(t < 1.004, 0, 2*t - 2.008)"], [1.0, 1.01]),
        (["max(t, 0.01) + max(t, 1.99)"], [0.01, 1.99]),
        (["exp(-t) * cos(20*t)", "t**3", "1e-9*t"], []),
    ],
)
def test_kinks_of_formulas_and_smooth_ones(formulas, times):
    instants = np.linspace(0.0, 2.0, 201)
    assert kinks(of_time(formulas, "")(instants).T, instants) == pytest.approx(times)


@pytest.mark.parametrize("scene", [SHAKEN.replace("{course}", "1 + {course}"), PUSHED])
@pytest.mark.parametrize("burst", ["max(0.2 - abs(t - 3.21), 0)", "exp(-100*(t - 3.21)**2)"])
def test_adaptive_steps_do_not_step_over_a_burst(tmp_path, scene, burst):
    """Of the flow at the inflow, or of the grain: in the steady state before, steps grow to twice its length."""
    time = '[time]\nend = 4.0\nstep = 0.05\ntolerance = 0.01\nstart = "steady"\n'
    result = incipient.run(loads(scene.replace("{course}", burst) + time + FEW), tmp_path)
    history = history_of(tmp_path)
    assert history["step"].max() > 0.8
    within = np.abs(history["time"] - 3.21) < 0.19
    assert history["step"][within].max() < 0.1
    if scene == PUSHED:
        area = 0.04 if "max" in burst else 0.1 * math.sqrt(math.pi)
        assert result.trajectory["place"][0] == pytest.approx(3.0 + area, rel=1e-6)


def test_adaptive_steps_begin_short_after_a_kink(tmp_path):
    """A ramp of half the length of the steps before: its force at the middle is that of fixed steps, 13.2."""
    course = "[[0, 1], [2, 1], [2.5, 3], [4, 3]]"
    time = '[time]\nend = 2.5\nstep = 0.05\ntolerance = 0.01\nstart = "steady"\n'
    incipient.run(loads(GUSTY.replace("{course}", course) + time + FEW), tmp_path)
    history = history_of(tmp_path)
    assert history["step"].max() > 0.4
    middle = np.interp(2.25, history["time"], history["force_x"])
    assert middle == pytest.approx(13.2, rel=0.02)
