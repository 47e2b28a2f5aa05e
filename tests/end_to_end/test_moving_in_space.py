"""Moving grains in 3-D."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from environment import environment, finished
from numpy.typing import NDArray
from scenes import (
    ROOT,
    ran,
)

import incipient
from incipient.geometry.placement import Placement
from incipient.geometry.space.grains import Box as BoxSolid
from incipient.scene import (
    Box,
    Contact,
    Domain,
    Ellipsoid,
    ExpressionFlow,
    Flat,
    Fluid,
    Gravity,
    Numerics,
    Output,
    Scene,
    Shear,
    Sphere,
    Still,
    Time,
)
from incipient.scene.grains import orientation_of
from incipient.setup.geometry import rigid_body
from incipient.setup.setup import Setup

# Grains that move in space, from scene to end of path: exact orbits and drags, contact.


SLOW = Fluid(reynolds=0.01, scale="grain", inertia=False)
RATIO = 2.0  # of the spheroid's axes


def in_shear(size: float, **sections: Any) -> Scene:
    """A spheroid of the fluid's density in a shear of rate one, its long axis across the stream at first."""
    wide = 0.75 * size
    domain = Domain(
        length=size, width=wide, height=wide, origin=(-0.5 * size, -0.5 * wide, -0.5 * wide),
        top="stream", sides="stream",
    )  # fmt: skip
    body = Ellipsoid(
        semi_axes=(1.0, 1.0 / RATIO, 1.0 / RATIO), centre=(0, 0, 0), orientation=(0, -90, 0), density=1.0,
        motion="free",
    )  # fmt: skip
    flow = ExpressionFlow(components=("z", "0", "0"), velocity=2.0)
    return Scene(**{"domain": domain, "fluid": SLOW, "flow": flow, "body": body, **sections})


def through_a_new_mesh() -> Scene:
    """In a box three long axes wide, on 400 cells; solved so well that runs can be compared."""
    exactly = {"error_bars": False, "tolerance": 1e-12, "interface_tolerance": 1e-12}
    return in_shear(
        8.0,
        time=Time(end=1.0, step=0.25, start="stokes"),
        numerics=Numerics(mesh_size=2.2, remesh_below=0.5, **exactly),
        output=Output(fields=False),
    )


def angles(history: NDArray[Any]) -> NDArray[np.float64]:
    """Of the spheroid's axis, its first, from the height towards the stream."""
    quaternions = np.column_stack([history[f"quaternion_{part}"] for part in "wxyz"])
    axes = np.array([Placement((0, 0, 0), quaternion=tuple(q)).rotation[:, 0] for q in quaternions])
    return np.unwrap(2.0 * np.arctan2(axes[:, 0], axes[:, 2])) / 2.0


def jeffery(angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Spin about y of a spheroid whose axis turns in the plane of the shear (Jeffery 1922)."""
    return (RATIO**2 * np.cos(angle) ** 2 + np.sin(angle) ** 2) / (RATIO**2 + 1.0)


@pytest.mark.slow
def test_a_sphere_sinks_in_a_square_duct(tmp_path: Path) -> None:
    """Ten diameters wide, without inertia: Stokes's velocity times 1 - 1.903266/10 (Happel & Bart 1974, Appl. Sci.
    Res. 29, 241), which leaves out about 0.002. Measured 1.0% less on this coarse mesh."""
    body = Sphere(diameter=1.0, centre=(5, 5, 10), density=2.0, motion="free")
    scene = Scene(
        domain=Domain(kind="box", length=10, width=10, height=20), fluid=SLOW, flow=Still(velocity=1.0), body=body,
        gravity=Gravity(acceleration=18.0), time=Time(end=20.0, step=10.0),
        numerics=Numerics(mesh_size=2.0, error_bars=False), output=Output(fields=False),
    )  # fmt: skip
    path = incipient.run(scene, tmp_path).trajectory
    stokes = 18.0 / (18.0 * scene.viscosity)
    assert path["velocity"][2] == pytest.approx(-stokes * (1.0 - 0.1903266), rel=0.02)
    assert path["velocity"][1] == 0.0 and len(path["quaternion"]) == 4


def test_distances_from_sides_and_bed() -> None:
    """A turned box of sides 0.8, 0.6, 0.4: its support function in closed form."""
    sides = np.array([0.8, 0.6, 0.4])
    body = Box(sides=tuple(sides), centre=(2, 2, 2), density=1, motion="free")
    scene = Scene(
        domain=Domain(kind="box", length=4, width=5, height=6), fluid=SLOW, flow=Still(velocity=1.0), body=body,
        time=Time(end=1, step=1),
    )  # fmt: skip
    around = Setup(scene)
    assert isinstance(scene.grain, BoxSolid) and not Setup(scene).symmetric
    walls = {
        "upstream": (0, 0, 1), "downstream": (0, 4, -1), "right": (1, 0, 1), "left": (1, 5, -1),
        "bottom": (2, 0, 1), "top": (2, 6, -1),
    }  # fmt: skip
    for name, (axis, place, inwards) in walls.items():
        centre = np.array([2.0, 2.5, 3.0])
        centre[axis] = place + 0.7 * inwards
        placement = Placement(tuple(centre)).moved((0.0, 0.0, 0.0), [0.3, -0.8, 0.5])
        result = around.clearance(placement)
        expected = 0.7 - 0.5 * sides @ np.abs(placement.rotation[axis])
        assert result.other == name and result.distance == pytest.approx(expected, abs=1e-9)
        assert result.on_other[axis] == pytest.approx(place, abs=1e-12)
        between = np.subtract(result.on_grain, result.on_other)
        assert between == pytest.approx(expected * inwards * np.eye(3)[axis], abs=1e-9)


def test_mass_and_moments_follow_the_grain() -> None:
    def in_box(**keys: Any) -> Scene:
        body = Ellipsoid(semi_axes=(0.5, 0.3, 0.2), density=3, motion="free", **keys)
        box = Domain(kind="box", length=4, width=4, height=4)
        return Scene(
            domain=box, fluid=SLOW, flow=Still(velocity=1.0), body=body, time=Time(end=1, step=1)
        )

    result = rigid_body(in_box(centre=(2, 2.1, 2), locked=("x", "ry")).body)
    mass = 3 * 4 / 3 * np.pi * 0.5 * 0.3 * 0.2
    assert result.inertia.mass == pytest.approx(mass)
    assert result.inertia.moments == pytest.approx(mass / 5 * np.array([0.13, 0.29, 0.34]))
    assert result.mask.tolist() == [False, True, True, True, False, True]
    halved = in_box(centre=(2, 2, 2))
    assert Setup(halved).symmetric
    assert rigid_body(halved.body, symmetric=True).mask.tolist() == [
        True,
        False,
        True,
        False,
        True,
        False,
    ]


def test_orientation_is_told_as_it_is_given() -> None:
    body = Box(sides=(0.8, 0.6, 0.4), centre=(2, 2, 2), orientation=(20, -35, 70))
    assert orientation_of(body.placed((2, 2, 2))) == pytest.approx((20, -35, 70))


@pytest.mark.slow
def test_a_quarter_of_a_turn_in_a_wide_shear(tmp_path: Path) -> None:
    """Twelve short axes wide, 1400 cells: measured 2.3% of the fastest rate at most, through a new mesh.

    There were four while sides within a turning mesh did not stay straight, which wore it.
    """
    scene = in_shear(
        16.0,
        time=Time(end=4.25, step=0.25, start="stokes"),
        numerics=Numerics(mesh_size=1.5, error_bars=False),
    )
    result = ran(scene, tmp_path)
    assert angles(result)[-1] > 0.5 * np.pi and result["meshes"].max() > 1
    assert np.abs(result["spin_y"] - jeffery(angles(result))).max() < 0.03 * 0.8
    assert Setup(scene).symmetric
    across = (*("y", "velocity_y", "spin_x", "spin_z"), *("force_y", "torque_x", "torque_z"))
    assert all(np.abs(result[name]).max() == 0.0 for name in (*across, "quaternion_x"))


@pytest.mark.slow
def test_a_sphere_falls_on_a_plane_and_is_judged(tmp_path: Path) -> None:
    """It stops where its gap is `contact.gap`, is judged there, and the result tells how to let it rest."""
    scene = Scene(
        domain=Domain(length=4, width=3, height=2.5), fluid=Fluid(reynolds=1, scale="grain"), flow=Shear(rate=0.2),
        body=Sphere(diameter=1, centre=(2, 1.5, 0.65), density=1.5, motion="free"), bed=Flat(),
        gravity=Gravity(acceleration=20), contact=Contact(friction=0.5, gap=0.03), time=Time(end=20, step=0.1),
        numerics=Numerics(mesh_size=3, error_bars=False), output=Output(fields=False),
    )  # fmt: skip
    incipient.run(scene, tmp_path)
    stored = json.loads((tmp_path / "result.json").read_text())
    ended, place = stored["trajectory"]["ended"], stored["trajectory"]["place"]
    assert ended["by"] == "contact" and ended["nearest"] == "bed"
    assert ended["clearance"] == pytest.approx(0.03, abs=1e-5) and place[2] == pytest.approx(
        0.53, abs=1e-5
    )
    assert len(stored["contacts"]) == 1 and "body.orientation = [" in stored["verdict"]["note"]


# The sphere of ten Cate et al. (2002), settling in a box: demos/settling_sphere.py.


@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "computed", "difference"), [("1", 0.894, 0.01), ("4", 0.947, 0.03)]
)
def test_the_largest_velocity(tmp_path, case, computed, difference):
    """Ten Cate et al. computed 0.894 and 0.947 (and measured 0.947 and 0.955); on such coarse cells 0.892 and 0.932.

    Finer cells give 0.905 and 0.946 (docs/validation/laminar.md): in the first case the cells' error hides that
    difference of 1.2%.
    """
    settings = (case, "output.fields=false", "numerics.mesh_size=2")
    command = [sys.executable, ROOT / "demos/settling_sphere.py", *settings]
    said = finished(command, 900, env=environment(), cwd=tmp_path).stdout
    when, end = re.search(r"at t = ([\d.]+) s of ([\d.]+)", said).groups()
    assert float(when) < round(float(end), 2)  # up to the end it gains no velocity
    peak = re.search(r"^fastest +([\d.]+) of it", said, re.M).group(
        1
    )  # over that in an endless fluid
    assert float(peak) == pytest.approx(computed, rel=difference)
    assert re.search(rf"^computed by them +{computed} ", said, re.M)
