"""The numbers that the tutorials print are those that their scenes give. The pages are the source of both."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from pytest import approx

import incipient
from incipient.scene import loads

TUTORIALS = Path(__file__).parents[2] / "docs/tutorials"
# Meshes of another gmsh change loads by some 1e-4, safety factors and thresholds alike.
SHOWN = 2e-3


def scene_of(page: str, *overrides: str) -> incipient.Scene:
    """The scene that a tutorial tells its reader to write."""
    found = re.search(r"as `(\w+)\.toml`:\n\n```toml\n(.*?)^```", text_of(page), re.M | re.S)
    assert found
    return loads(found[2], Path(), list(overrides), name=found[1])


def text_of(page: str) -> str:
    return (TUTORIALS / f"{page}.md").read_text()


def numbers(pattern: str, page: str) -> list[float]:
    """The numbers that the first match of a pattern in a tutorial has."""
    found = re.search(pattern, text_of(page))
    assert found, pattern
    return [float(group) for group in found.groups()]


def test_the_first_verdict() -> None:
    result = incipient.run(scene_of("verdict"))
    x, y, turning = numbers(
        r"force of the flow +\(([\d.]+), ([\d.]+)\).* +torque about the centre of mass (-[\d.]+)",
        "verdict",
    )
    assert result.force and result.torque and result.verdict
    assert result.force.flow[:2] == approx([x, y], rel=SHOWN)
    assert result.torque.flow[-1] == approx(turning, rel=SHOWN)
    shown = r"certain [\w ]+: it rests; safety factor ([\d.]+), between ([\d.]+) and ([\d.]+)"
    assert result.error_bars and result.error_bars.safety
    bar = result.error_bars.safety
    assert (bar.value, bar.low, bar.high) == approx(tuple(numbers(shown, "verdict")), rel=SHOWN)
    assert bar.certain and not result.verdict["moves"]


@pytest.mark.slow
def test_a_lighter_grain() -> None:
    result = incipient.run(scene_of("verdict", "gravity.acceleration=1"))
    (factor,) = numbers(r"begins to move \(pivoting\), safety factor ([\d.]+)", "verdict")
    assert result.verdict
    assert result.verdict["safety_factor"] == approx(factor, rel=SHOWN)
    assert result.verdict["mode"] == "pivoting"


@pytest.mark.slow
def test_the_threshold() -> None:
    critical = incipient.threshold(scene_of("verdict"))
    factor, error = numbers(r"threshold +([\d.]+) \+- ([\d.]+)", "threshold")
    assert critical.factor == approx(factor, abs=0.005)
    computed = critical.errors["factor"]
    assert computed and error - 0.01 < computed <= error  # printed rounded up
    (shields,) = numbers(r"Shields number +([\d.]+)", "threshold")
    assert critical.shields == approx(shields, rel=SHOWN)


@pytest.mark.slow
@pytest.mark.parametrize("reynolds", [1, 10, 100])
def test_the_curve(reynolds: int) -> None:
    """Each point of the page's table, within the error that stands beside it."""
    critical = incipient.threshold(scene_of("verdict", f"fluid.reynolds={reynolds}"))
    shields, error = numbers(rf"\| {reynolds} \| ([\d.]+) ± ([\d.]+)", "threshold")
    assert critical.shields == approx(shields, abs=error)


def test_the_shear_velocity_of_the_flume() -> None:
    """By its plan; by hand u* d/nu = 60 and a Shields number of 0.0278 are wanted."""
    said = incipient.make_plan(scene_of("flume")).text()
    (line,) = re.findall(r"Re\* [\d.]+, Shields number [\d.]+", said)
    assert line in text_of("flume")
    assert [float(word) for word in re.findall(r"[\d.]+", line)] == approx([60.0, 0.0278], rel=5e-3)


@pytest.mark.slow
def test_the_grain_in_the_flume() -> None:
    result = incipient.run(scene_of("flume"))
    (factor,) = numbers(r"a safety factor of ([\d.]+)\. ", "flume")
    assert result.verdict
    assert result.verdict["safety_factor"] == approx(factor, abs=0.02)
    assert result.verdict["mode"] == "pivoting"


@pytest.mark.slow
@pytest.mark.parametrize(("duration", "leaves"), [(2.0, True), (1.0, False)])
def test_a_grain_that_leaves_its_pocket(duration: float, leaves: bool) -> None:
    """By the gust of the page, and not by half of it, as the page says."""
    scene = scene_of("moving", f"flow.gust.duration={duration}", "output.every=0")
    trajectory = incipient.run(scene).trajectory
    assert trajectory
    on_bed = trajectory["on_bed"]
    assert (on_bed["left_pocket"] is not None) is leaves
    assert on_bed["first_motion"] is not None
