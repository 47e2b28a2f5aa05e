"""Elevations of two runs side by side, what their differences are taken for, and what is asked for of them."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scenes import message

from incipient.accuracy.errorbars import OF_FEW_STEPS, by_coarser_runs, changed
from incipient.accuracy.goal import Goal, relative
from incipient.adaptive.balance import Parts, Powers, cheapest
from incipient.planning.plan import make_plan
from incipient.results.elevations import Elevations, Reading
from incipient.results.errorbars import NO_GRAIN, ErrorBars, Loads
from incipient.scene import Scene
from incipient.scene.file import loads
from incipient.scene.surface import stations_of

TANK = """\
[domain]
kind = "box"
length = 2.0
height = 1.0
origin = [-1.0, 0.0]
top = "free-surface"
[fluid]
reynolds = 100.0
scale = "flow"
[flow]
kind = "still"
[gravity]
acceleration = 1.0
[surface]
elevation = "0.01*cos(pi*x)"
[time]
end = 4.0
step = 0.1
[numerics]
accuracy = 0.01
"""
IN_SPACE = TANK.replace("height = 1.0", "width = 1.0\nheight = 1.0").replace(
    "[-1.0, 0.0]", "[-1.0, 0.0, 0.0]"
)

pytestmark = pytest.mark.quick


def wave(steps: int, phase: float = 0.0, size: float = 1.0) -> Elevations:
    """A wave of a period of 2 pi, at its crest and halfway, in so many steps."""
    times = np.linspace(0.0, 4.0, steps + 1)
    crest = size * np.cos(times - phase * times)
    return Elevations(times, np.column_stack([crest, 0.5 * crest]), size)


def of(elevations: Elevations) -> Loads:
    return Loads(NO_GRAIN, NO_GRAIN, elevations=elevations)


def test_waves_are_compared_at_the_times_of_the_longer_steps():
    """The larger of two cosines' differences is sought on the coarse times; the finer ones have these or nearly so."""
    few, many = wave(10, phase=0.01), wave(40)
    expected = np.abs(np.cos(0.99 * few.times) - np.cos(few.times)).max()
    assert few.apart(many) == pytest.approx([expected, 0.5 * expected], rel=1e-12)
    assert many.apart(few) == pytest.approx(few.apart(many), rel=1e-15)
    # Times that do not lie on one another: by a cubic spline, which errs by 5/384 h^4 at most within.
    assert wave(27).apart(wave(40)).max() < 5 / 384 * 0.1**4 * 20.0


def test_a_run_resumed_late_is_compared_from_there_on():
    whole, late = wave(40), wave(20, phase=0.01)
    late = Elevations(late.times[10:], late.values[10:], 1.0)
    expected = np.abs(np.cos(0.99 * late.times) - np.cos(late.times)).max()
    assert late.apart(whole)[0] == pytest.approx(expected, rel=1e-12)
    only = Elevations.of([Reading(4.0, [0.5, 0.25], 1.0)])
    assert only.apart(whole)[0] == pytest.approx(abs(0.5 - np.cos(4.0)), rel=1e-12)


def term_of(step_error: float, mesh_error: float, order: int = 2):
    """The term of a run whose phase errs by so much for its steps, and whose height for its mesh."""
    scene = changed(loads(TANK), numerics={"order": order})

    def solved(one: Scene) -> Loads:
        assert one.time is not None
        longer = (one.time.step / 0.1) ** 2
        size = 1.0 + (mesh_error if one.order == order else 0.0)
        return of(wave(round(4.0 / one.time.step), phase=step_error * longer, size=size))

    return by_coarser_runs(scene, solved(scene), solved)


def test_step_and_mesh_are_told_apart():
    """Small errors of the second order in the steps: the part of the steps is the allowance times the error."""
    term = term_of(1e-4, 1e-3)
    of_step, of_mesh = (part.elevation for part in term.parts)
    exact = np.abs(np.cos((1 - 1e-4) * wave(10).times) - np.cos(wave(10).times)).max()
    assert of_step[0] == pytest.approx(OF_FEW_STEPS * exact, rel=0.01)
    assert of_mesh == pytest.approx([1e-3, 5e-4], rel=1e-6)
    bars = ErrorBars((term,))
    assert bars.elevation == pytest.approx(of_step + of_mesh)
    assert bars.force.shape == (0,)
    assert f"discretisation    elevation {bars.elevation[0]:.1e}" in "\n".join(bars.lines())
    found = SimpleNamespace(force=None, couple=None, elevations=wave(40, size=0.5))
    assert relative(Goal.of(loads(TANK)), found, term) == pytest.approx(2.0 * bars.elevation[0])


def test_waves_out_of_phase_are_no_small_error():
    """At 0.06 of the phase longer steps are all out of it: what they change by then is less than sixteen times that."""
    term, found = term_of(0.06, 0.0), wave(40, phase=0.06)
    true = found.apart(wave(40))[0]
    assert term.parts[0].elevation[0] > true
    assert (
        term.parts[0].elevation[0] / OF_FEW_STEPS > 0.5
    )  # of the largest elevation, which nobody takes for small


def test_the_highest_order_is_compared_with_the_one_below():
    """The coarsest mesh has four cells a side whatever numerics.mesh_size: a coarser one would be the same."""
    assert term_of(0.0, 1e-3, order=4).parts[1].elevation[0] == pytest.approx(1e-3)


def test_no_order_above_that_of_the_elevation_is_sought():
    wanted = cheapest(Parts(1e-6, 1e-2), 1e-5, 2, Powers(2), highest=3)
    assert wanted.order == 3
    assert cheapest(Parts(1e-6, 1e-2), 1e-5, 2, Powers(2)).order == 4


@pytest.mark.parametrize(
    ("text", "places"),
    [
        (TANK, [(-1.0,), (-0.5,), (0.0,), (0.5,), (1.0,)]),
        (TANK.replace("[time]", "stations = [0.3]\n[time]"), [(0.3,)]),
        (IN_SPACE, [(x, y) for x in (-1.0, 0.0, 1.0) for y in (0.0, 0.5, 1.0)]),
    ],
)
def test_without_stations_there_are_a_few(text, places):
    assert np.array(stations_of(loads(text))) == pytest.approx(np.array(places))


def test_an_accuracy_without_a_grain_is_that_of_the_elevation():
    assert (
        "until the error of the elevation (of discretisation) is below 0.01" in make_plan(loads(TANK)).text()
    )


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        (
            'top = "free-surface"',
            'top = "slip"',
            "numerics.accuracy: is that of the load on a grain or of a free surface but there is neither; add",
        ),
        (
            "accuracy = 0.01",
            'accuracy = "verdict"',
            'numerics.accuracy: "verdict" is that of a grain but there is',
        ),
        (
            "accuracy = 0.01",
            'accuracy = 0.01\naccuracy_of = "couple"',
            'numerics.accuracy_of: "couple" is that of a grain but there is none; add a section [body] or use',
        ),
    ],
)
def test_accuracies_of_what_is_not_there_are_refused(old, new, why):
    text = TANK.replace(old, new)
    if "slip" in new:
        text = text.replace('[surface]\nelevation = "0.01*cos(pi*x)"\n', "")
    assert why in message(lambda: loads(text))


def test_an_elevation_needs_a_surface():
    text = (
        TANK.replace('top = "free-surface"', 'top = "slip"')
        .replace("[surface]", "#")
        .replace("elevation =", "#")
    )
    text = text.replace("accuracy = 0.01", 'accuracy = 0.01\naccuracy_of = "elevation"')
    text = text.replace("[time]", '[body]\nshape = "disc"\ndiameter = 0.2\ncentre = [0.0, 0.5]\n[time]')
    assert 'numerics.accuracy_of: "elevation" is that of a free surface but there is none' in message(
        lambda: loads(text)
    )
