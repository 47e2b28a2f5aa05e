"""The level plane that a bed acts as in shear, against exact and published heights."""

import numpy as np
import pytest
from scenes import CHANNEL, message, scene

from incipient.geometry.plane import beds
from incipient.geometry.plane.beds import effective_level
from incipient.planning.flow_setup import Setup
from incipient.scene import HalfDiscs, Poiseuille, Polyline, Shear, Sinusoidal, Uniform
from incipient.scene.example import grain_in_pocket

# Beds, Reynolds number of shear rate 1 on the length 1, and the effective height found in one period with P2-P1
# elements and inertia (cells of 1/20, on ripples 1/25 of the wavelength); how far that may be off.
MEASURED = [
    (HalfDiscs(radius=0.5, spacing=1.2), 1e-9, 0.44680, 1e-4),
    (HalfDiscs(radius=0.5, spacing=2.0), 1e-9, 0.39354, 1e-4),
    (HalfDiscs(radius=0.5, spacing=6.0), 1e-9, 0.19362, 6e-4),
    (HalfDiscs(radius=0.5, spacing=1.05), 20.0, 0.45678, None),
    (HalfDiscs(radius=0.5, spacing=1.2), 20.0, 0.44802, None),
    (HalfDiscs(radius=0.5, spacing=1.2), 60.0, 0.45065, None),
    (HalfDiscs(radius=0.5, spacing=1.2), 1000.0, 0.46464, None),
    (HalfDiscs(radius=0.5, spacing=3.0), 60.0, 0.37395, None),
    (HalfDiscs(radius=0.5, spacing=6.0), 20.0, 0.24613, None),
    (HalfDiscs(radius=0.5, spacing=6.0), 1000.0, 0.39328, None),
    (Sinusoidal(amplitude=0.5, wavelength=4.0), 20.0, 0.32522, None),
    (Sinusoidal(amplitude=0.5, wavelength=4.0), 1000.0, 0.41175, None),
]


@pytest.mark.parametrize("amplitude", [0.005, 0.01, 0.02])
def test_low_ripples(amplitude):
    """d = a^2 k + O(a^4 k^3): u = y - a sin(kx) (1 - ky) exp(-ky) + u_2, and the mean of u_2 on the bed is -a^2 k."""
    k = 2.0 * np.pi
    found = effective_level(beds.Sinusoidal(amplitude, 1.0, 0.3, 7.0))
    assert found == pytest.approx(amplitude**2 * k, rel=(amplitude * k) ** 2 + 1e-3)


def test_where_a_bed_begins_does_not_matter():
    rows = [
        beds.HalfDiscs(0.5, 1.2, offset, base) for offset, base in ((0, 0), (0.7, 0), (1e4, 1e3))
    ]
    assert len({effective_level(row) for row in rows}) == 1


@pytest.mark.parametrize("spacing", [1.0, 1.0001, 1.01, 1.2, 60.0])
def test_between_base_and_crests(spacing):
    """It falls with the distance of the half-discs, and touching ones leave little below the crests."""
    found = effective_level(beds.HalfDiscs(0.5, spacing))
    farther = effective_level(beds.HalfDiscs(0.5, 1.1 * spacing))
    assert 0.0 < farther < found < 0.4592


@pytest.mark.parametrize(("forms", "reynolds", "height", "error"), MEASURED)
def test_against_finite_elements(forms, reynolds, height, error):
    """With inertia within the uncertainty that is said; without the panels' error."""
    found = Setup(
        scene(bed=forms, fluid={"reynolds": reynolds, "scale": "grain"})
    ).base_flow.effective_height
    assert found.height == pytest.approx(height, abs=error or found.uncertainty)
    assert found.height >= found.creeping


def test_the_datum_is_the_effective_height_where_a_stream_shears_a_row_of_forms():
    row = HalfDiscs(radius=0.5, spacing=1.2)
    assert (
        Setup(scene(bed=row)).base_flow.datum
        == Setup(scene(bed=row)).base_flow.effective_height.height
    )
    slow = {"reynolds": 20, "scale": "grain", "inertia": False}
    assert Setup(scene(bed=row, fluid=slow)).base_flow.datum == pytest.approx(0.4468, abs=1e-4)
    between_walls = scene(bed=row, flow=Poiseuille(velocity=1.0))  # sheared at 6 V over the depth
    same = scene(
        bed=row, flow=Shear(rate=6 / 5.5), fluid={"reynolds": 20 * 6 / 5.5, "scale": "grain"}
    )
    assert Setup(between_walls).base_flow.datum == pytest.approx(
        Setup(same).base_flow.datum, rel=1e-12
    )
    for crests in (
        {"flow": Uniform()},
        {"bed": Sinusoidal(amplitude=0.5, wavelength=CHANNEL.length)},
    ):
        assert Setup(scene(**{"bed": row, **crests})).base_flow.datum == pytest.approx(0.5)
    points = [(0.6 * k, 0.5 * (k % 2)) for k in range(21)]
    assert Setup(scene(bed=Polyline(points=points))).base_flow.datum == 0.5
    flow = Shear(datum="effective")
    asked = message(lambda: Setup(scene(bed=Polyline(points=points), flow=flow)).base_flow.datum)
    assert asked.startswith('flow.datum: is "effective" over a Polyline bed')


def test_in_space_it_is_refused():
    assert Setup(grain_in_pocket()).base_flow.datum == grain_in_pocket().bed_shape.crest
    asked = {**grain_in_pocket().model_dump(), "flow": {"kind": "shear", "datum": "effective"}}
    found = message(lambda: type(grain_in_pocket())(**asked))
    assert 'flow.datum: is "effective" in space, where it is not computed; use "auto"' in found
