"""Finding the critical flow: the root finder on exact functions, and what a threshold needs."""

import numpy as np
import pytest

from incipient.errors import ConvergenceError, SceneError
from incipient.scene import loads
from incipient.scene.example import commented, grain_on_bed
from incipient.threshold import bed_stress, find_root, find_threshold

POCKET = ("bed.kind=half-discs", "bed.radius=0.5", "bed.spacing=1.2", "bed.offset=1.0")


def scene(*overrides: str):
    return loads(commented(grain_on_bed()), overrides=overrides)


@pytest.mark.parametrize("power", [1.0, 1.5, 2.0, 4.0])
def test_root_of_a_power(power: float) -> None:
    """S = 3 factor^-p is one at 3^(1/p); a secant in the logarithms finds the root of a power in two steps."""
    calls = []

    def excess(factor: float) -> float:
        calls.append(factor)
        return np.log(3.0) - power * np.log(factor)

    assert find_root(excess, 1.0, np.log(3.0)) == pytest.approx(3.0 ** (1 / power), rel=1e-6)
    assert len(calls) <= 3


def test_root_between_stokes_and_inertia() -> None:
    """Load a f + b f^2, from linear to quadratic in the speed f: the root of a quadratic equation."""
    a, b = 0.05, 0.002
    exact = (-a + np.sqrt(a**2 + 4 * b)) / (2 * b)

    def excess(factor: float) -> float:
        return -np.log(a * factor + b * factor**2)

    assert find_root(excess, 1.0, excess(1.0)) == pytest.approx(exact, rel=1e-6)


def test_root_with_a_jump() -> None:
    """Where S falls from 2 to 0 at once the bracket closes on the jump."""
    jump = 7.25
    assert find_root(lambda f: np.log(2.0) if f < jump else -np.inf, 1.0, np.log(2.0)) == pytest.approx(
        jump, rel=1e-4
    )


def test_no_root_is_an_error() -> None:
    with pytest.raises(ConvergenceError, match="no threshold found within"):
        find_root(lambda f: 1.0, 1.0, 1.0)


def test_bed_stress_of_exact_profiles() -> None:
    """Shear: nu rate; parabola of mean V over H: 6 nu V/H; half a parabola: 3 nu V/H."""
    shear = scene()
    assert bed_stress(shear) == pytest.approx(shear.viscosity * 1.0, rel=1e-9)
    for kind, factor in (("poiseuille", 6.0), ("open-channel", 3.0)):
        channel = scene(f"flow={{kind = '{kind}', velocity = 2.0}}")
        assert bed_stress(channel) == pytest.approx(factor * channel.viscosity * 2.0 / 6.0, rel=1e-5)


@pytest.mark.parametrize(
    ("override", "need"),
    [
        ("body.density=0.9", "a grain denser than the fluid"),
        ("gravity.acceleration=0.0", "gravity"),
        ("flow={kind = 'still'}", "a flow"),
        ("time={end = 1.0, step = 0.1}", "a steady flow"),
    ],
)
def test_what_a_threshold_needs(override: str, need: str) -> None:
    from mpi4py import MPI

    with pytest.raises(SceneError, match=f"a threshold needs {need}"):
        find_threshold(scene(override), MPI.COMM_WORLD)
