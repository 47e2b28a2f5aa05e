"""Grains released from their rest."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from processes import result_of
from scenes import (
    SCENES,
    history_of,
    ran,
)

import incipient
from incipient.errors import SceneError
from incipient.scene import Scene, load, loads

# Whole runs of a grain that is released from its rest on the bed: it stays, rolls, slides, leaves its pocket.


POCKET = """
title = "A disc in a pocket of half-discs"
[domain]
length = 8.0
height = 4.0
[fluid]
reynolds = 20.0
scale = "grain"
[flow]
kind = "shear"
rate = 1.0
[bed]
kind = "half-discs"
radius = 0.5
spacing = 1.0
[body]
shape = "disc"
diameter = 1.0
x = 3.5
density = 1.5
[gravity]
acceleration = {gravity}
[contact]
friction = 0.6
[numerics]
error_bars = false
[output]
fields = false
"""
INCLINE = """
[domain]
kind = "box"
length = {length}
height = {height}
[fluid]
reynolds = 0.1
scale = "grain"
inertia = false
[flow]
kind = "still"
velocity = 1.0
[bed]
kind = "inclined"
slope = 30.0
[body]
shape = "disc"
diameter = 1.0
x = {middle}
motion = "released"
density = {density}
[gravity]
acceleration = {gravity}
[contact]
friction = {friction}
gap = 0.005
[time]
end = {end}
step = {step}
[numerics]
error_bars = false
[output]
fields = false
"""


def pocket(gravity: float, end: float = 0.3, until: str = "end", **changes: Any) -> Scene:
    """A released disc in a pocket."""
    plain = loads(POCKET.format(gravity=gravity)).model_dump(exclude_unset=True)
    plain["body"]["motion"] = "released"
    plain["time"] = {"end": end, "step": 0.1, "start": "steady", "until": until}
    for key, value in changes.items():
        section, name = key.split("__")
        plain.setdefault(section, {})[name] = value
    return Scene(**plain)


def incline(**given: float) -> Scene:
    """A disc on a slope of 30 degrees, in fluid at rest far around."""
    asked = {"length": 96.0, "height": 48.0, "density": 2.0, "gravity": 453.7, "friction": 0.6}
    asked |= {"end": 60.0, "step": 2.0} | given
    return loads(INCLINE.format(**asked, middle=0.5 * asked["length"]))


def weight_along(scene: Scene) -> float:
    """Weight less buoyancy along the slope of an incline."""
    return (scene.mass - scene.grain.volume) * float(scene.gravity_vector[0])


def test_a_disc_rolls_down_an_incline_as_fast_as_a_creeping_flow_lets_it(tmp_path: Path) -> None:
    """W' sin(alpha) = 4 pi mu U [1/acosh(s) + s/sqrt(s^2 - 1)] with s = h/a: Jeffery (1922), no slip at the contact.

    The exact velocity is 0.09984. The domain's walls are 48 diameters away; on cells of half the size it is 0.09978.
    """
    scene = incline()
    computed, s = ran(scene, tmp_path), 1.01
    exact = weight_along(scene) / (
        4 * math.pi * scene.viscosity * (1 / math.acosh(s) + s / math.sqrt(s * s - 1))
    )
    assert computed["velocity_x"][-1] == pytest.approx(exact, rel=5e-3)  # 3.8e-3 when written
    # What touches does not slip, though contact begins a gap away from the bed: the point on the grain stands still.
    assert computed["velocity_x"][-1] == pytest.approx(-0.5 * computed["spin"][-1], rel=1e-9)
    assert np.abs(computed["slip"]).max() < 1e-9 * exact
    # The contact holds half of what drives the disc, a dry one a third.
    assert -computed["contact_x"][-1] == pytest.approx(0.5 * weight_along(scene), rel=5e-3)


def test_a_wet_disc_slips_where_a_dry_one_still_rolls(tmp_path: Path) -> None:
    """Rolling takes friction of 1/2 tan(alpha) in creeping flow, 1/3 tan(alpha) without fluid."""
    modes = {}
    for share in (0.45, 0.55):
        scene = incline(
            length=24.0,
            height=10.0,
            friction=share * math.tan(math.radians(30.0)),
            end=0.5,
            step=0.05,
        )
        result = incipient.run(scene, tmp_path / f"{share}")
        modes[share] = result.trajectory["on_bed"]["mode"]  # type: ignore[index]
    assert modes == {0.45: "pivoting and sliding", 0.55: "rolling"}


@pytest.mark.parametrize(("mass", "inertia", "share"), [(1.5, 0.0, 0.0), (1e6, 1.25e5, 2 / 3)])
def test_contact_shortens_no_step_of_a_body_light_or_heavy(
    mass: float, inertia: float, share: float, tmp_path: Path
) -> None:
    """Nothing resists the turn of the first but fluid; the second goes as without any, by 2/3 g sin(alpha)."""
    plain = incline(length=24.0, height=10.0, end=0.1, step=0.01).model_dump(exclude_unset=True)
    del plain["body"]["density"]
    scene = Scene(**{**plain, "body": {**plain["body"], "mass": mass, "inertia": inertia}})
    computed = ran(scene, tmp_path)
    assert computed["step"] == pytest.approx(0.01)
    assert np.abs(computed["slip"]).max() < 1e-9 * abs(computed["velocity_x"][-1])
    if share:
        assert computed["velocity_x"][-1] == pytest.approx(
            share * scene.gravity_vector[0] * 0.1, rel=2e-3
        )


def test_a_grain_stays_where_the_judge_says_so_and_else_moves(tmp_path: Path) -> None:
    """On both sides of the threshold; contact acts a gap away from the bed, which changes the factor by 1%.

    The factor without that gap, told beside it, is that of the judge who lets the grain touch.
    """
    held = loads(POCKET.format(gravity=9.55))
    factor = incipient.run(held).verdict["safety_factor"]  # type: ignore[index]
    assert factor == pytest.approx(1.0126, rel=2e-3)
    stays, moves = (
        incipient.run(pocket(9.55 * change / factor), tmp_path / f"{change}")
        for change in (1.02, 0.98)
    )
    assert stays.trajectory["on_bed"]["mode"] == "rest"  # type: ignore[index]
    assert stays.verdict is not None and stays.verdict["safety_factor"] == pytest.approx(
        1.02, rel=0.015
    )
    assert stays.verdict["touching_factor"] == pytest.approx(1.02, rel=2e-3)
    assert moves.trajectory["on_bed"]["first_motion"] == 0.0  # type: ignore[index]
    assert moves.verdict is None and "rolling" in moves.trajectory["ended"]["without_verdict"]  # type: ignore[index]
    computed = history_of(tmp_path / "1.02")
    assert (
        np.abs(computed["x"] - computed["x"][0]).max() == 0.0 and computed["interface"].max() == 0.0
    )


def test_a_grain_that_no_flow_can_move_takes_no_iteration(tmp_path: Path) -> None:
    """Far below its threshold in a pocket: two contacts, both held, and nothing to solve in any step.

    Flow, contact, weight and buoyancy add up to nothing.
    """
    computed = ran(pocket(20.0), tmp_path)
    assert set(computed["mode"]) == {"rest"} and computed["contacts"][-1] == 2
    assert (
        np.abs(computed["y"] - computed["y"][0]).max() == 0.0 and computed["interface"].max() == 0.0
    )
    for axis in "xy":
        forces = [computed[f"{name}_{axis}"] for name in ("force", "contact", "weight", "buoyancy")]
        assert np.abs(np.sum(forces, axis=0)).max() < 1e-8 * 20.0
    rows = history_of(tmp_path, "contacts.csv")
    assert rows["time"] == pytest.approx(np.repeat(computed["time"], 2))
    for axis in "xy":
        each = rows[f"force_{axis}"].reshape(-1, 2)
        assert each.sum(axis=1) == pytest.approx(computed[f"contact_{axis}"], abs=1e-12)


def test_works_add_up_to_the_energy_of_the_grain(tmp_path: Path) -> None:
    """Kinetic energy is the work of flow, weight and contact, to what the iteration of fluid and grain leaves."""
    incipient.run(
        pocket(1.0, end=1.5, contact__friction=0.1, contact__kinetic_friction=0.05), tmp_path
    )
    computed = history_of(tmp_path)
    works = sum(computed[f"work_{name}"] for name in ("flow", "gravity", "friction", "impact"))
    assert np.abs(works - computed["energy_body"]).max() < 1e-3 * computed["energy_body"].max()
    assert (np.diff(computed["work_friction"]) <= 1e-12).all() and computed["work_friction"][
        -1
    ] < 0.0
    assert np.abs(computed["weight_y"] + 1.5 * math.pi / 4).max() < 1e-12
    assert np.abs(computed["buoyancy_y"] - math.pi / 4).max() < 1e-12


@pytest.mark.parametrize("cohesion", [30.7, 37.5])
def test_cohesion_holds_a_released_disc_as_the_judge_says(cohesion: float, tmp_path: Path) -> None:
    """Its safety factor is proportional to the cohesion, which outweighs it: 1.465 at 50, thus 1 at 34.1."""
    scene = pocket(2.0, flow__rate=4.0, time__step=0.1, contact__cohesion=cohesion)
    result = incipient.run(scene, tmp_path)
    if cohesion < 34.1:
        assert set(history_of(tmp_path)["mode"]) == {"rolling"} and result.verdict is None
    else:
        assert set(history_of(tmp_path)["mode"]) == {"rest"} and result.verdict is not None
        assert result.verdict["safety_factor"] == pytest.approx(1.465 * cohesion / 50.0, rel=5e-3)


def turbulent(gravity: float, end: float, step: float) -> Scene:
    """The stone of demos/scenes/large_grain.toml on a coarse mesh, released."""
    plain = load(SCENES / "large_grain.toml").model_dump(exclude_unset=True)
    plain["body"]["motion"] = "released"
    plain["gravity"]["acceleration"] = gravity
    plain["time"] = {"end": end, "step": step, "start": "steady"}
    plain["numerics"] = {"order": 2, "mesh_size": 4.0, "error_bars": False}
    return Scene(**{**plain, "output": {"fields": False}})


@pytest.mark.slow
def test_a_stone_in_a_turbulent_stream_rests_or_rolls_as_the_judge_says(tmp_path: Path) -> None:
    """Its safety factor with the gap that it keeps is 2.56 at a gravity of 10: it rolls at 3, where that is below 1."""
    rests = incipient.run(turbulent(10.0, 0.04, 0.02), tmp_path / "rests")
    assert rests.trajectory["on_bed"]["mode"] == "rest" and rests.verdict is not None  # type: ignore[index]
    assert 3.0 / 10.0 * rests.verdict["safety_factor"] < 0.9
    computed = ran(turbulent(3.0, 0.06, 0.02), tmp_path / "rolls")
    assert computed["mode"].tolist() == ["rolling"] * 3
    works = sum(computed[f"work_{name}"] for name in ("flow", "gravity", "friction", "impact"))
    assert works == pytest.approx(computed["energy_body"], rel=2e-3)
    assert (computed["y_plus_max"] > 30.0).all()


def test_a_disc_released_below_a_free_surface_rolls_and_the_surface_answers(tmp_path: Path) -> None:
    """On the crest of a half-disc of an open channel, coarse; its works add up, and the surface above it moves."""
    plain = pocket(4.0, end=0.2, body__density=1.2, body__x=4.0, time__step=0.05).model_dump(
        exclude_unset=True
    )
    plain["domain"] |= {"height": 3.0, "top": "free-surface"}
    plain["flow"] = {"kind": "open-channel", "velocity": 1.0, "datum": "crest"}
    plain["surface"] = {"sponge": 2.0, "stations": [4.0]}
    plain["numerics"]["mesh_size"] = 2.0
    result, computed = incipient.run(Scene(**plain), tmp_path), history_of(tmp_path)
    assert result.trajectory["on_bed"]["first_motion"] == 0.0  # type: ignore[index]
    works = sum(computed[f"work_{name}"] for name in ("flow", "gravity", "friction", "impact"))
    assert works == pytest.approx(computed["energy_body"], rel=2e-3)
    assert computed["x"][-1] > 4.005 and np.abs(computed["elevation_1"]).max() > 1e-4


@pytest.mark.slow
def test_a_run_that_its_grain_has_ended_goes_on_only_when_asked_for_more(tmp_path: Path) -> None:
    """A free disc sinks into the pocket below it and rests there; its run keeps a checkpoint."""
    free = {"motion": "free", "on_contact": "touch", "x": None, "centre": (3.5, 0.93)}
    scene = pocket(
        100.0, end=3.0, until="at-rest", **{f"body__{key}": value for key, value in free.items()}
    )
    result = incipient.run(scene, tmp_path)
    assert result.trajectory is not None and result.trajectory["ended"]["by"] == "at-rest"
    stored = result_of(tmp_path)["trajectory"]["on_bed"]
    with pytest.raises(SceneError, match=r'its grain has reached time\.until = "at-rest"'):
        incipient.resume(tmp_path)
    later = incipient.resume(tmp_path, ["time.until=end"])
    assert later.trajectory is not None and later.trajectory["ended"]["by"] == "time"
    assert later.trajectory["on_bed"]["works"] == pytest.approx(stored["works"], abs=1e-9)
    assert later.trajectory["on_bed"]["force"] == pytest.approx(-later.force.total[:2], rel=2e-3)
