"""Scenes with a free surface, from file to history, files and resumed runs."""

import json

import numpy as np
import pytest
from scenes import (
    TANK,
    history_of,
    ran,
)

import incipient
from incipient.errors import ConvergenceError, IncipientError
from incipient.planning.plan import make_plan
from incipient.scene.file import loads

WAVE = f"""\
title = "A standing wave"
{TANK}[surface]
elevation = "0.01*cos(pi*x)"
stations = [0.0, 0.3, 1.0]
bottom = "slip"
[time]
end = 0.4
step = 0.05
[numerics]
mesh_size = 6.0
[output]
checkpoint = 4
every = 4
"""
WITH_GRAIN = (
    WAVE.replace("length = 1.0\nheight = 1.0", "length = 4.0\nheight = 2.0")
    .replace('bottom = "slip"\n', "")
    .replace("0.01*cos(pi*x)", "0.1*cos(pi*x/4)")
    .replace(
        "[time]",
        '[body]\nshape = "disc"\ndiameter = 1.0\nx = 2.0\ndensity = 2.65\n[bed]\nkind = "flat"\n[time]',
    )
    .replace("mesh_size = 6.0", "mesh_size = 4.0\nerror_bars = false")
    .replace("[output]", "[contact]\nfriction = 0.5\n[output]")
)


def test_the_plan_has_the_effect_and_says_why():
    told = make_plan(loads(WAVE)).text()
    assert 'yes  free surface: domain.top = "free-surface"' in told
    assert "yes  moving mesh: the mesh rises and falls with the free surface" in told
    assert "cells of order 3" in told


@pytest.fixture(scope="module")
def wave(tmp_path_factory):
    """The directory of a run, whole."""
    directory = tmp_path_factory.mktemp("wave")
    incipient.run(loads(WAVE), directory)
    return directory


def test_the_history_tells_of_the_surface(wave):
    history, result = history_of(wave), json.loads((wave / "result.json").read_text())
    assert len(history) == 8
    assert history["elevation_1"] == pytest.approx(-history["elevation_3"], abs=2e-4)
    assert (np.diff(history["elevation_1"]) < 0).all()
    assert np.abs(history["volume_above_level"]).max() < 1e-15
    assert (np.diff(history["energy_fluid"] + history["energy_potential"]) < 0).all()
    assert history["through_surface"].max() < 1e-2 * np.sqrt(2 * history["energy_fluid"].max())
    assert history["interface"].max() <= 3
    share = result["cost"]["effects"]["free surface"]
    assert share["unknowns"] == 16 and share["wall_time"] > 0


def test_the_fields_are_on_the_mesh_that_moves(wave):
    from incipient.output.series_file import read_step

    last = read_step(wave / "fields", 1)
    assert last.time == pytest.approx(0.4)
    top = last.points[:, 1].max()
    assert top == pytest.approx(1.0 + history_of(wave)["elevation_1"][-1], abs=1e-6)


def test_a_grain_below_a_wave_is_judged_at_every_step(tmp_path):
    result = incipient.run(loads(WITH_GRAIN), tmp_path)
    history = history_of(tmp_path)
    # The wave falls at the left end: the fluid above the middle goes to the right, and takes the grain along.
    assert (history["force_x"] > 0).all()
    assert set(history["mode"]) <= {"rolling", "sliding", "rest"}
    assert history["safety_factor"][-1] == result.verdict["safety_factor"]
    assert result.verdict is not None


@pytest.mark.slow
@pytest.mark.parametrize("accuracy", [0.03, 0.0003])
def test_an_accuracy_is_sought_below_a_wave(accuracy):
    """Cells, order and steps are chosen; beside a run of order four in steps of half of the scene's."""
    text = WITH_GRAIN.replace("mesh_size = 4.0\nerror_bars = false", f"accuracy = {accuracy}")
    text = text.replace("end = 0.4\nstep = 0.05", "end = 0.8\nstep = 0.02")
    computed = incipient.run(loads(text))
    fine = text.replace(f"accuracy = {accuracy}", "order = 4\nerror_bars = false").replace(
        "0.02", "0.01"
    )
    exact = incipient.run(loads(fine)).force.flow
    assert computed.adaptation.met
    assert np.linalg.norm(computed.force.flow - exact) < accuracy * np.linalg.norm(exact)


def test_still_water_over_a_bed_with_a_grain_stays(tmp_path):
    still = WITH_GRAIN.replace("0.1*cos(pi*x/4)", "0").replace(
        '[bed]\nkind = "flat"', '[bed]\nkind = "sinusoidal"\namplitude = 0.1\nwavelength = 1.3'
    )
    assert np.abs(incipient.run(loads(still), tmp_path).velocity.x.array).max() == 0.0
    assert history_of(tmp_path)["energy_fluid"].max() == 0.0


FLOATING = """\
title = "A light disc rising below a free surface"
[domain]
kind = "box"
length = 4.0
height = 3.0
top = "free-surface"
[fluid]
reynolds = 20.0
scale = "grain"
[flow]
kind = "still"
[gravity]
acceleration = 4.0
[surface]
elevation = "0.05*cos(pi*x/4)"
stations = [2.0]
[body]
shape = "disc"
diameter = 1.0
centre = [1.9, 1.2]
density = 0.5
motion = "free"
[time]
end = 0.6
step = 0.05
[numerics]
mesh_size = 5.0
error_bars = false
remesh_below = 0.95
[output]
checkpoint = 8
fields = false
"""


@pytest.fixture(scope="module")
def floating(tmp_path_factory):
    """The directory of a run of a disc that rises below a wave, on three meshes or more."""
    directory = tmp_path_factory.mktemp("floating")
    incipient.run(loads(FLOATING), directory)
    return directory


def test_a_free_grain_and_the_surface_keep_volume_and_energy(floating):
    history, result = history_of(floating), json.loads((floating / "result.json").read_text())
    assert len(result["trajectory"]["remeshings"]) >= 1
    assert np.ptp(history["volume_above_level"]) < 1e-15
    assert history["interface"][0] <= 4 and history["interface"][1:].max() <= 3
    # What the grain's weight less that of the fluid in its place loses in height, and waves and both motions get.
    lift = (0.5 - 1.0) * np.pi / 4 * 4.0 * history["y"]
    energy = lift + history["energy_body"] + history["energy_fluid"] + history["energy_potential"]
    spent = (
        (history["dissipation"][1:] + history["dissipation"][:-1]) / 2 * np.diff(history["time"])
    )
    scale = np.ptp(history["energy_fluid"])
    assert np.diff(energy).sum() == pytest.approx(-spent.sum(), abs=0.05 * scale)


@pytest.mark.slow
def test_new_meshes_above_the_still_level(tmp_path):
    """A disc pushed up below a crest beyond the still level: new meshes have their tops above that."""
    up = FLOATING.replace(
        'density = 0.5\nmotion = "free"', 'motion = "prescribed"\ncourse = ["0", "2*t", "0"]'
    )
    up = up.replace("0.05*cos(pi*x/4)", "-0.4*cos(pi*x/2)").replace(
        "acceleration = 4.0", "acceleration = 1.0"
    )
    up = up.replace("centre = [1.9, 1.2]", "centre = [2.0, 2.3]").replace(
        "mesh_size = 5.0", "mesh_size = 3.0"
    )
    result, history = incipient.run(loads(up), tmp_path), history_of(tmp_path)
    made = [one["time"] for one in result.trajectory["remeshings"]]
    assert np.interp(made, history["time"], history["y"]).max() + 0.5 > 3.05
    assert np.ptp(history["volume_above_level"]) < 1e-14
    assert history["interface"].max() <= 5


@pytest.mark.parametrize(
    ("text", "error", "reason"),
    [
        # From trough to crest 0.45 of its length: 0.22 is the most a standing wave can have (Penney & Price 1952).
        pytest.param(
            WAVE.replace("0.01*cos(pi*x)", "0.45*cos(pi*x)")
            .replace("reynolds = 100.0", "reynolds = 1000.0")
            .replace("end = 0.4", "end = 8.0"),
            ConvergenceError,
            "is too steep, ",
            id="wave that would break",
        ),
        pytest.param(
            WAVE.replace("0.01*cos(pi*x)", "-0.985"),
            ConvergenceError,
            r"the free surface touches the bottom: use an earlier time\.end",
            id="down to the bed",
        ),
        pytest.param(
            FLOATING.replace("remesh_below = 0.95\n", "").replace("end = 0.6", "end = 9.0"),
            IncipientError,
            r"the grain .* the free surface",
            id="grain that rises to it",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_what_ends_a_free_surface_stops_by_name(text, error, reason, tmp_path):
    told = rf"{reason}.*; the state at t = .* is saved: incipient resume"
    with pytest.raises(error, match=told):
        incipient.run(loads(text), tmp_path)
    assert (tmp_path / "checkpoint.h5").exists()


def test_the_first_elevation_may_be_a_file(tmp_path):
    (tmp_path / "elevation.csv").write_text("x, elevation\n0, 0.01\n1, -0.01\n")
    text = WAVE.replace('elevation = "0.01*cos(pi*x)"', 'file = "elevation.csv"')
    scene = loads(text, tmp_path)
    assert scene.surface.points == ((0.0, 0.01), (1.0, -0.01))
    assert scene.surface.height(np.array([[0.25], [0.0], [0.0]])) == pytest.approx([0.005])


IN_SPACE = """\
[domain]
kind = "box"
length = 4.0
width = 3.0
height = 2.0
top = "free-surface"
sides = "wall"
[fluid]
reynolds = 100.0
scale = "grain"
[flow]
kind = "still"
[gravity]
acceleration = 10.0
[surface]
elevation = "0.1*cos(pi*x/4)"
stations = [[0.0, 1.5], [0.0, 0.0]]
[body]
shape = "sphere"
diameter = 1.0
x = 2.0
density = 1.3
[bed]
kind = "flat"
[contact]
friction = 0.5
gap = 0.03
[time]
end = 0.1
step = 0.05
[numerics]
order = 2
mesh_size = 4.0
error_bars = false
"""


def test_a_sphere_below_a_wave_in_space(tmp_path):
    """Half of a tank by blocks, between sides to which the fluid sticks, where the surface is pinned."""
    told = make_plan(loads(IN_SPACE)).text()
    assert "linear systems by a block method" in told and "no slip at left, where" in told
    history = ran(loads(IN_SPACE), tmp_path)
    assert (np.diff(history["elevation_1"]) < 0).all()
    assert history["elevation_2"] == pytest.approx(0.1, abs=1e-14)
    assert np.ptp(history["volume_above_level"]) < 1e-14
    assert (history["force_x"] > 0.0).all()


@pytest.mark.slow
def test_error_bars_below_a_wave_in_space(tmp_path):
    """The force of a run of order three in steps of a quarter lies within them."""
    text = IN_SPACE.replace("error_bars = false\n", "").replace('sides = "wall"\n', "")
    computed = incipient.run(loads(text))
    fine = text.replace(
        "order = 2\nmesh_size = 4.0", "order = 3\nmesh_size = 3.0\nerror_bars = false"
    )
    exact = incipient.run(loads(fine.replace("step = 0.05", "step = 0.0125")))
    assert "discretisation" not in computed.error_bars.failed
    error = np.abs(exact.force.flow - computed.force.flow)
    assert (error <= computed.error_bars.total.force).all() and error[0] > 0.0
