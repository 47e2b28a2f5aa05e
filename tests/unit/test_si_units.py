"""Scenes in SI units: the dimensionless scene that follows and the way back, against numbers worked out by hand."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scenes import message

from incipient.planning.plan import make_plan
from incipient.results.si import in_si, si_lines, with_loads
from incipient.scene import (
    Disc,
    Domain,
    Flat,
    Rectangle,
    Scene,
    Shear,
    Sphere,
    Units,
    dumps,
    loads,
    grains,
)
from incipient.scene.units import nominal_diameter

# A grain of quartz of 1 mm in water, in the units of the scene of diameter 2 and shear rate 0.5.
QUARTZ = """
[domain]
length = 24.0
width = 16.0
height = 12.0
[fluid]
scale = "grain"
[flow]
kind = "shear"
rate = 0.5
[body]
shape = "sphere"
diameter = 2.0
x = 10.0
[bed]
kind = "flat"
[contact]
friction = 0.5
[units]
diameter = 1e-3
viscosity = 1e-6
fluid_density = 1000.0
grain_density = 2650.0
gravity = 9.81
shear_rate = 100.0
"""


def test_a_grain_of_quartz_in_water() -> None:
    """L0 = 1e-3/2 m, T0 = 0.5/100 s; Re = 100 (1e-3)^2/1e-6 = 100; g T0^2/L0 = 9.81 x 25e-6/5e-4."""
    scene = loads(QUARTZ)
    scales = scene.scales
    assert scales is not None and scene.gravity is not None and scene.body is not None
    assert scene.fluid.reynolds == pytest.approx(100.0, rel=1e-14)
    assert scene.gravity.acceleration == pytest.approx(0.4905, rel=1e-14)
    assert scene.body.density == pytest.approx(2.65, rel=1e-14)
    assert (scales.length, scales.time, scales.velocity) == pytest.approx((5e-4, 5e-3, 0.1))
    assert scales.force == pytest.approx(
        1000.0 * 0.1**2 * 5e-4**2
    ) and scales.torque == pytest.approx(1.25e-9)


def test_the_flow_and_loads_in_si() -> None:
    """tau = rho nu times the shear rate = 0.1 Pa, u* = sqrt(tau/rho) = 0.01 m/s; both grow with the flow."""
    scene = loads(QUARTZ)
    acting = {"force": [2.0, 0.0, 1.0], "torque": [0.0, 4.0, 0.0]}
    found = with_loads(in_si(scene, 4.0), acting)
    assert found is not None
    assert (found["shear_rate"], found["bed_stress"]) == pytest.approx((400.0, 0.4), rel=1e-6)
    assert found["shear_velocity"] == pytest.approx(0.02, rel=1e-6)
    assert found["force"] == pytest.approx([5e-6, 0.0, 2.5e-6]) and found[
        "torque"
    ] == pytest.approx([0.0, 5e-9, 0.0])
    said = "\n".join(si_lines(found))
    assert (
        "nominal diameter [m] 0.001   shear rate [1/s] 400" in said
        and "force (5e-06, 0, 2.5e-06) N" in said
    )
    assert in_si(loads(QUARTZ.partition("[units]")[0], overrides=["fluid.reynolds=1"])) is None


def test_a_small_grain_settles_as_stokes_says() -> None:
    """10 micrometres of quartz: (s - 1) g d^2/(18 nu) = 1.65 x 9.81 x 1e-10/18e-6 = 8.9925e-5 m/s."""
    scene = loads(QUARTZ, overrides=["units.diameter=1e-5", "units.shear_rate=3"])
    assert scene.density is not None and scene.gravity is not None and scene.scales is not None
    speed = (scene.density - 1.0) * scene.gravity.acceleration * 2.0**2 / (18.0 * scene.viscosity)
    assert speed * scene.scales.velocity == pytest.approx(8.9925e-5, rel=1e-12)


def test_a_stream_has_a_velocity_and_the_plane_a_disc_of_equal_area() -> None:
    """A rectangle of area 1 has the diameter sqrt(4/pi); Re by the height of the domain, 0.02 m/s x 6 L0/1e-6."""
    changes = [
        'fluid.scale="flow"',
        "flow={kind='open-channel', velocity=2.0}",
        "units.velocity=0.02",
    ]
    plane = QUARTZ.replace("width = 16.0\n", "").replace(
        '"sphere"\ndiameter = 2.0', '"rectangle"\nwidth = 2.0\nheight = 0.5'
    )
    scene = loads(
        plane.replace("shear_rate = 100.0\n", "").replace("height = 12.0", "height = 6.0"),
        overrides=changes,
    )
    length = 1e-3 / np.sqrt(4.0 / np.pi)
    assert scene.scales is not None and scene.gravity is not None
    assert scene.scales.length == pytest.approx(length) and scene.scales.velocity == pytest.approx(
        0.01
    )
    assert scene.scales.force == pytest.approx(1000.0 * 1e-4 * length)  # per metre of depth
    assert scene.fluid.reynolds == pytest.approx(0.02 * 6.0 * length / 1e-6)
    assert scene.gravity.acceleration == pytest.approx(9.81 * (length / 0.01) ** 2 / length)


def test_the_resolved_scene_is_the_same_scene() -> None:
    scene = loads(QUARTZ)
    again = loads(dumps(scene))
    assert (
        again == scene and tomllib.loads(dumps(scene))["fluid"]["reynolds"] == scene.fluid.reynolds
    )


def test_scenes_of_python_have_units_too() -> None:
    given: dict[str, Any] = {"domain": Domain(length=24, height=12), "flow": Shear(), "bed": Flat()}
    units = Units(diameter=2e-3, shear_rate=10.0)
    scene = Scene(**given, fluid={"scale": "grain"}, body=Disc(diameter=1.0, x=8.0), units=units)
    assert scene.fluid.reynolds == pytest.approx(
        10.0 * 4e-6 / 1e-6
    ) and scene.density == pytest.approx(2.65)


@pytest.mark.parametrize(
    ("grain", "diameter"),
    [
        (Sphere(diameter=3.0, x=1.0), 3.0),
        (Disc(diameter=3.0, x=1.0), 3.0),
        (Rectangle(width=np.pi, height=1.0, x=1.0), 2.0),
    ],
)
def test_nominal_diameters(grain: Any, diameter: float) -> None:
    assert nominal_diameter(grain.grain) == pytest.approx(diameter)


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("fluid.reynolds=3", "fluid.reynolds: is 3, but [units] makes it 100; leave it out"),
        (
            "gravity.acceleration=9.81",
            "gravity.acceleration: is 9.81, but [units] makes it 0.4905; leave it out",
        ),
        ("body.mass=2", "body.mass: is given with [units]; leave one of them out"),
        ("units.velocity=1", 'units.velocity: is not of the flow "shear"; give shear_rate only'),
        (
            "flow={kind='uniform'}",
            'units.velocity: is missing, which the flow "uniform" needs; add it',
        ),
        ("units.diameter=-1", "units.diameter: is -1; give a number greater than 0"),
        ("units.length=mm", "units.length: is given with diameter; give one of them"),
        ("units.length=inch", 'units.length: is "inch"; give metres above zero, or "um", "mm"'),
        ("units.length=-1", "units.length: is -1; give metres above zero"),
        ("units.grain=1", "units.grain: unknown key"),
        ("domain.length=-1", "domain.length: is -1; give a number greater than 0"),
    ],
)
def test_wrong_units_are_refused(override: str, said: str) -> None:
    found = message(lambda: loads(QUARTZ, overrides=[override]))
    assert said in found and "\n" not in found


def test_units_need_a_grain() -> None:
    text = QUARTZ.replace('"grain"', '"flow"')
    empty = text.partition("[body]")[0] + "[units]" + text.partition("[units]")[2]
    assert "units: are those of a scene with a grain, and there is none; add" in message(
        lambda: loads(empty)
    )


@pytest.mark.parametrize(("length", "metres"), [("mm", 1e-3), ("0.002", 2e-3)])
def test_a_unit_of_length_makes_files_in_millimetres_what_they_are(
    length: str, metres: float, tmp_path: Path
) -> None:
    """A box of 2 x 1 x 1 in the file: nominal diameter (6 x 2/pi)^(1/3); T0 = 0.5/100 s, gravity g T0^2/L0."""
    trimesh.creation.box((2.0, 1.0, 1.0)).export(tmp_path / "stone.stl")
    text = QUARTZ.replace('"sphere"\ndiameter = 2.0', '"mesh"\nfile = "stone.stl"')
    scene = loads(text.replace("diameter = 1e-3\n", ""), tmp_path, [f"units.length={length}"])
    found, nominal = in_si(scene), (12.0 / np.pi) ** (1.0 / 3.0)
    assert scene.scales is not None and found is not None and scene.gravity is not None
    assert scene.scales.length == pytest.approx(metres)
    assert found["nominal_diameter"] == pytest.approx(metres * nominal, rel=1e-6)
    assert scene.gravity.acceleration == pytest.approx(9.81 * 0.005**2 / metres)
    assert loads(dumps(scene)) == scene
    said = f"grain: largest diameter 2.44949, nominal {nominal:.6g}; one unit of length is {metres:g} m"
    assert said in make_plan(scene).text()


def test_a_scanned_grain_in_units_settles_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Settling takes most of the time of a scan's plan; the scene without its units needs no place."""
    trimesh.creation.box((2.0, 1.0, 1.0)).export(tmp_path / "stone.stl")
    calls, once = [], grains.settle
    monkeypatch.setattr(grains, "settle", lambda *a: calls.append(a) or once(*a))
    text = QUARTZ.replace('"sphere"\ndiameter = 2.0', '"mesh"\nfile = "stone.stl"')
    scene = loads(text, tmp_path, ["body.settle=true"])
    assert scene.placement is not None and len(calls) == 1


def test_the_plan_says_what_size_the_file_of_a_grain_has(tmp_path: Path) -> None:
    trimesh.creation.box((2.0, 1.0, 1.0)).export(tmp_path / "stone.stl")
    text = QUARTZ.replace('"sphere"\ndiameter = 2.0', '"mesh"\nsize = 22.0\nfile = "stone.stl"')
    said = make_plan(loads(text, tmp_path)).text()
    nominal = 22.0 / np.sqrt(6.0) * (12.0 / np.pi) ** (1.0 / 3.0)
    assert f"largest diameter 22, nominal {nominal:.6g}; by its file 2.44949" in said
