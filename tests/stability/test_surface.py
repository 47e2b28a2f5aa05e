"""What a free surface must never do: make energy or volume, move still water, or need short steps."""

import numpy as np
import pytest
from domains import curved_box
from energy_stable import EnergyStable
from waves import Mode, tank

# An explicit surface is stable for steps up to about sqrt(h/(pi g)), h the smallest width of its cells.
CELLS = 8
EXPLICIT = np.sqrt(1.0 / CELLS / np.pi)


def stirred(a):
    """A velocity without divergence, at rest on the walls, made of waves with factors a (3, 3)."""

    def velocity(x):
        s, c = (np.array([f(k * np.pi * x[:, :2]) for k in (1, 2, 3)]) for f in (np.sin, np.cos))
        u = sum(a[i, j] * (j + 1) * s[i, :, 0] * c[j, :, 1] for i in range(3) for j in range(3))
        v = sum(-a[i, j] * (i + 1) * c[i, :, 0] * s[j, :, 1] for i in range(3) for j in range(3))
        return np.column_stack([u, v])

    return velocity


def energies(seed, steps, length, pinned):
    """Energies at the start and after each step from a random start with waves a tenth high."""
    generator = np.random.default_rng(seed)
    heights = generator.standard_normal(4)

    def surface(x):
        waves = sum(h * np.cos((k + 1) * np.pi * x[:, 0]) / (k + 1) for k, h in enumerate(heights))
        return 0.1 * waves / np.abs(heights).sum()

    options = {"scheme": 1, "kind": EnergyStable, "tolerance": 1e-9}
    with tank(curved_box(2, 4, 2), 1e-3, surface, pinned=pinned, **options) as made:
        made.flow(stirred(0.05 * generator.standard_normal((3, 3))))
        made.surface.place()
        result, first, volume = [made.energy()], made.elevation(), made.surface.volume()
        for _ in range(steps):
            made.transient.advance(length)
            result.append(made.energy())
        assert made.surface.volume() == pytest.approx(volume, abs=1e-14)
        assert not pinned or at_ends(made, made.elevation()) == pytest.approx(
            at_ends(made, first), abs=1e-15
        )
        return np.array(result)


def at_ends(made, elevation):
    return elevation[np.abs(made.points[:, 0] - 0.5) > 0.499]


@pytest.mark.parametrize("pinned", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_energy_never_grows(seed, pinned):
    """Of first order in time, in the form that cannot make energy, whatever the step.

    Pinned at ends to which the fluid sticks, at any elevations there, which stay to round-off as the volume does.
    """
    length = 10.0 ** np.random.default_rng(100 * (1 + pinned) + seed).uniform(-2, 1)
    result = energies(seed, 4, length, pinned)
    # The first step makes the start free of divergence, and energy can only be lost by that, too.
    assert (np.diff(result) <= 1e-7 * result[0]).all()


def test_what_a_pinned_surface_does_not_feel():
    """An elevation less that is zero at the ends, has no volume, and is the nearest of those that are and have not."""
    generator = np.random.default_rng(1)
    with tank(curved_box(2, 4, 2), 1.0, lambda x: 0.0 * x[:, 0], pinned=True) as made:
        rising, ends = made.surface.mesh, np.abs(made.points[:, 0] - 0.5) > 0.499
        one, other = np.zeros((2, len(made.surface.past[0])))
        one[made.nodes], other[made.nodes] = generator.standard_normal((2, len(made.nodes)))
        felt, trial = (
            elevation - rising.remove_pinned_projection(elevation, closed=True)
            for elevation in (one, other)
        )
        for elevation in (felt, trial):
            assert np.abs(elevation[made.nodes][ends]).max() == 0.0 < np.abs(elevation).max()
            assert rising.mean(elevation) == pytest.approx(0.0, abs=1e-14)
        assert rising.mean(one - felt, trial) == pytest.approx(0.0, abs=1e-14)


@pytest.mark.parametrize("scheme", [1, 2])
def test_steps_fifty_times_the_limit_of_an_explicit_surface(scheme):
    mode, amplitude = Mode(0.01, np.pi), 0.01
    with tank(
        curved_box(2, CELLS, 2),
        mode.nu,
        lambda x: amplitude * np.cos(np.pi * x[:, 0]),
        scheme=scheme,
        tolerance=1e-8,
    ) as made:
        before = made.energy()
        for _ in range(6):
            step = made.transient.advance(50.0 * EXPLICIT)
            assert step.rejected == 0 and step.report.corrected <= 3
            assert made.energy() <= before
            before = made.energy()
        assert np.abs(made.elevation()).max() < amplitude


@pytest.mark.parametrize("pinned", [False, True])
def test_still_water_below_a_surface_that_is_not_level(pinned):
    """Gravity turned as on a slope of one tenth: the surface at rest is the plane of that slope, and stays."""
    slope = 0.1
    with tank(
        curved_box(2, 5, 2),
        1e-3,
        lambda x: slope * (x[:, 0] - 0.5),
        gravity=(np.sin(np.arctan(slope)), -np.cos(np.arctan(slope))),
        pinned=pinned,
    ) as made:
        for _ in range(20):
            made.transient.advance(0.1)
        assert made.fluid.speed() < 1e-13
        assert made.elevation() == pytest.approx(slope * (made.points[:, 0] - 0.5), abs=1e-14)


def test_an_accelerated_tank_comes_to_rest_in_the_plane_of_its_acceleration():
    """Started level: the plane's slope is the acceleration over gravity."""
    slope = 0.1
    with tank(
        curved_box(2, 4, 2),
        0.03,
        lambda x: 0.0 * x[:, 0],
        scheme=1,
        gravity=(slope, -1.0),
        tolerance=1e-8,
    ) as made:
        for _ in range(40):
            made.transient.advance(5.0)
        assert made.elevation() == pytest.approx(slope * (made.points[:, 0] - 0.5), abs=1e-8)
        assert abs(made.surface.volume()) < 1e-15
