"""One scene in other units and far from the origin: the same mesh, the same loads."""

import numpy as np
import pytest
from numpy.typing import NDArray

import incipient
from incipient.results.result import Result
from incipient.scene import Scene
from incipient.scene.file import loads


def scene(
    unit: float = 1.0, left: float = 0.0, low: float = 0.0, body: str = "angle = 0.0"
) -> Scene:
    """An ellipse on a wavy bed; `unit` is the length that one was, `left` and `low` where the domain's corner is."""
    u = unit
    return loads(
        f"""
        domain = {{length = {8 * u!r}, height = {4 * u!r}, origin = [{left * u!r}, {low * u!r}]}}
        fluid = {{reynolds = 20.0, scale = "grain"}}
        flow = {{kind = "shear"}}
        bed = {{kind = "sinusoidal", amplitude = {0.05 * u!r}, wavelength = {2 * u!r}, phase = 40.0}}
        gravity = {{acceleration = {u!r}}}
        contact = {{friction = 0.5}}
        numerics = {{error_bars = false, mesh_size = 4.0}}
        [body]
        shape = "ellipse"
        semi_axes = [{0.6 * u!r}, {0.4 * u!r}]
        x = {(left + 3.3) * u!r}
        density = 2.65
        {body}
        """
    )


def loads_of(found: Result, unit: float) -> NDArray[np.float64]:
    """Force and couple over V^2 L and V^2 L^2, V and L being the unit."""
    assert found.force is not None and found.torque is not None
    return np.array([*found.force.flow[:2] / unit**3, found.torque.flow[2] / unit**4])


@pytest.fixture(scope="module")
def usual() -> NDArray[np.float64]:
    return loads_of(incipient.run(scene()), 1.0)


@pytest.mark.parametrize(
    ("unit", "left", "low", "error"),
    [(1e-6, 0, 0, 1e-9), (7e5, 0, 0, 1e-9), (1.0, 4.0, -2.0, 1e-10), (1.0, 4e5, 5.4e6, 1e-6)],
)
def test_neither_unit_nor_place_changes_the_loads(
    usual: NDArray[np.float64], unit: float, left: float, low: float, error: float
) -> None:
    found = loads_of(incipient.run(scene(unit, left, low)), unit)
    assert found == pytest.approx(usual, rel=error)


def test_a_grain_settles_far_from_the_origin_as_it_does_there() -> None:
    near, far = (
        scene(1.0, left, low, "angle = 50.0\nsettle = true")
        for left, low in ((0.0, 0.0), (4e5, 5.4e6))
    )
    assert near.placement is not None and far.placement is not None
    shift = np.subtract(far.placement.centre, near.placement.centre)
    assert shift == pytest.approx([4e5, 5.4e6], abs=2e-9)
    assert far.placement.angle == pytest.approx(near.placement.angle, abs=1e-9)


@pytest.mark.parametrize(("left", "low"), [(1e12, 0.0), (0.0, -1e15)])
def test_a_place_where_numbers_are_too_far_apart_is_refused(left: float, low: float) -> None:
    with pytest.raises(
        incipient.SceneError, match=r"domain.origin: is so large that numbers .*; move the scene"
    ):
        scene(1.0, left, low)
