"""Flows that a gust multiplies in time: they are what they are to be, and act on grains as accelerated fluid does."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pytest

import incipient
from incipient.errors import SceneError
from incipient.geometry.placement import Placement
from incipient.geometry.plane.grains import Disc, Ellipse
from incipient.scene import Scene, loads
from incipient.setup.driving_force import DisplacedFluid
from incipient.setup.setup import Setup

CHANNEL = """
[domain]
length = {length}
height = {length}
top = "{top}"
[fluid]
reynolds = {reynolds}
scale = "{scale}"
[flow]
kind = "{kind}"
gust = {{{gust}}}
[time]
end = {end}
step = {step}
start = "stokes"
[numerics]
error_bars = false
mesh_size = 2
[output]
fields = false
"""
DISC = """
[body]
shape = "disc"
diameter = 1.0
centre = [{middle}, {middle}]
"""
TOP_HAT = "start = 0.1, duration = 0.2, strength = 3.0"


def channel(**given: object) -> str:
    """A channel as long as it is high, as text."""
    asked = {
        "length": 4.0,
        "top": "auto",
        "reynolds": 20,
        "scale": "flow",
        "kind": "uniform",
        "gust": TOP_HAT,
    }
    return CHANNEL.format(**{**asked, "end": 0.4, "step": 0.02, **given})


def columns_of(directory: Path) -> dict[str, np.ndarray]:
    """Columns of numbers of a history."""
    with (directory / "history.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    return {
        name: np.array([float(row[name] or np.nan) for row in rows])
        for name in rows[0]
        if name != "mode"
    }


@pytest.mark.parametrize("kind", ["shear", "poiseuille", "uniform", "open-channel"])
def test_a_flow_without_a_grain_is_the_factor_times_itself(kind: str) -> None:
    """Whatever the size of the domain: f(t) U(y) is the flow."""
    places = np.array([[1.0, 1.0], [2.0, 2.5], [3.5, 0.3]])
    for end, factor in ((0.2, 3.0), (0.4, 1.0)):
        scene = loads(channel(kind=kind, end=end))
        found = np.array([one.velocity for one in incipient.run(scene).at(places)])
        plain = Setup(scene).base_flow.velocity(np.vstack([places.T, np.zeros(3)]), 0.0).T
        assert np.abs(found - factor * plain).max() < 2e-4 * np.abs(plain).max()


def test_a_grain_as_dense_as_the_fluid_goes_with_a_uniform_flow(tmp_path: Path) -> None:
    """Exact: what accelerates the fluid accelerates the fluid displaced, and the grain in its place."""
    disc = DISC.format(middle=2.0) + 'motion = "free"\ndensity = 1.0\nvelocity = [1.0, 0.0]\n'
    incipient.run(
        loads(channel(top="stream", scale="grain", gust="duration = 0.2, strength = 3.0") + disc),
        tmp_path,
    )
    found = columns_of(tmp_path)
    assert found["gust"].max() == 3.0
    assert found["velocity_x"] == pytest.approx(found["gust"], rel=1e-5)
    assert (
        np.abs(found["step"] - 0.02).max() < 1e-12
    )  # round-off of the spin, which is zero, halves no step


def test_a_held_disc_feels_the_fluid_displaced_and_its_added_mass(tmp_path: Path) -> None:
    """In a short rise of the flow by V the force's impulse is 2 pi a^2 V: a disc far from walls in a potential flow.

    Viscosity adds 4/sqrt(pi) sqrt(nu T)/a of the half of it, 2% here, and the cells at the disc as much.
    """
    gust = "duration = 0.5, strength = 2.0, rise = 0.01"
    text = channel(
        length=10.0, top="stream", reynolds=1e4, scale="grain", gust=gust, end=0.011, step=0.001
    )
    incipient.run(
        loads(text.replace("mesh_size = 2", "mesh_size = 1") + DISC.format(middle=5.0)), tmp_path
    )
    found = columns_of(tmp_path)
    impulse = float(found["force_x"] @ found["step"])
    assert impulse == pytest.approx(2.0 * math.pi * 0.5**2, rel=0.05)  # 2.06 of 2 when written


def test_the_force_on_the_fluid_displaced_is_that_of_its_mean_velocity() -> None:
    """In a shear that rises by one in unit time: area times the velocity at the centroid, couple -I_yy, exactly.

    The disc's I_yy is pi d^4/64; points half a cell of 1/48 apart leave less than 1% of it.
    """
    scene = loads(
        channel(kind="shear", gust="duration = 0.2, strength = 3.0") + DISC.format(middle=2.0)
    )
    setup = Setup(scene)
    force, couple = DisplacedFluid(Disc(1.0), setup.base_flow).load(Placement((2.0, 2.0)))
    rate = float(setup.base_flow.velocity(np.array([[2.0], [1.0]]), 0.0)[0, 0])
    assert force == pytest.approx([math.pi / 4.0 * 2.0 * rate, 0.0, 0.0], rel=1e-9)
    assert couple == pytest.approx([0.0, 0.0, -math.pi / 64.0 * rate], rel=1e-2)
    off = DisplacedFluid(Ellipse((0.5, 0.02)), setup.base_flow).load(
        Placement((2.0, 2.0), 0.5 * math.pi)
    )
    assert off[1, 2] == pytest.approx(-math.pi / 4.0 * 0.02 * 0.5**3 * rate, rel=1e-2)


def test_a_gust_lasts_as_long_as_it_is_to() -> None:
    """The integral of what a top-hat and half a cosine wave add to the factor."""
    times = np.linspace(0.0, 10.0, 20001)
    for gust, area in (("top-hat", 2.0), ("cosine", 1.0)):
        flow = loads(
            channel(gust=f'shape = "{gust}", start = 1.5, duration = 1.0, strength = 3.0')
        ).flow
        added = np.array([flow.gust.factor(t) - 1.0 for t in times])  # type: ignore[union-attr]
        assert added.mean() * 10.0 == pytest.approx(area, rel=1e-3)
        assert added[times < 1.5].max() == 0.0 and added[-1] == 0.0


def test_a_course_may_stand_in_a_file(tmp_path: Path) -> None:
    (tmp_path / "gust.csv").write_text("time,factor\n0,1\n0.1,2.5\n0.3,1\n")
    (tmp_path / "scene.toml").write_text(
        channel(gust='shape = "points", file = "gust.csv", start = 0.5')
    )
    flow = incipient.load(tmp_path / "scene.toml").flow
    assert [flow.gust.factor(t) for t in (0.0, 0.55, 0.6, 0.7, 5.0)] == pytest.approx(
        [1.0, 1.75, 2.5, 1.75, 1.0]
    )  # type: ignore[union-attr]


REFUSED = (
    ({"time": None}, "flow.gust: changes the flow in time"),
    (
        {"time": {"end": 1.0, "step": 0.2}},
        "flow.gust.duration: is 0.2, less than 2 time steps of 0.2",
    ),
    ({"effects": {"turbulence": True}}, "flow.gust: with turbulence is not simulated"),
    ({"flow": {"kind": "shear", "gust": {"shape": "points"}}}, "neither file nor points is given"),
    ({"flow": {"kind": "shear", "gust": {"rise": 3.0}}}, "rise: is 3, more than the duration"),
    (
        {"flow": {"kind": "shear", "gust": {"points": [[0, 1], [1, 2]]}}},
        'points: are not read with shape = "top-hat"',
    ),
    ({"time": {"end": 1.0, "step": 0.1, "until_steady": 1e-3}}, "flow.gust changes it"),
)


@pytest.mark.parametrize(("changes", "says"), REFUSED)
def test_what_a_gust_cannot_go_with_is_refused(changes: dict[str, object], says: str) -> None:
    plain = loads(channel(kind="shear")).model_dump(exclude_unset=True)
    with pytest.raises(SceneError) as refused:
        Scene(**{**plain, **changes})
    assert says in str(refused.value)
