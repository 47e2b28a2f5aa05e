"""An accuracy asked for with turbulence, and its error bars: what they call certain, by much finer runs."""

import numpy as np
import pytest
from test_large_grain import stone
from test_turbulent_channels import channel

import incipient
from incipient.cost.ladder import ladder
from incipient.cost.measurement import measure
from incipient.cost.study import run_ladder
from incipient.planning.flow_setup import Setup
from incipient.planning.wall_cells import coarsest
from incipient.scene import Numerics, Sinusoidal

FINE = Numerics(mesh_size=0.5, order=2, error_bars=False)


def asked(accuracy, **keys):
    return Numerics(order=2, accuracy=accuracy, **keys)


def test_a_level_channel_is_as_accurate_as_asked():
    """u* at the outflow by a run on cells half as large as the last; errors of C_f are twice as large."""
    found = incipient.run(channel(22000.0, 5.0, numerics=asked(0.02)))
    finer = incipient.run(channel(22000.0, 5.0, numerics=FINE)).turbulence
    adapted, walls = found.adaptation, found.turbulence
    assert adapted.met and adapted.of == "shear velocity" and adapted.reached <= 0.02
    sizes = [float(trial.note.removeprefix("mesh_size ")) for trial in adapted.trials]
    assert sizes == pytest.approx([4.0 * 2.0 ** (-k / 2) for k in range(len(sizes))], rel=1e-2)
    told = [trial.estimate is not None for trial in adapted.trials]
    assert told == [
        2**0.5 * size < coarsest(Setup(channel(22000.0, 5.0))) for size in sizes
    ] and any(told)
    assert found.error_bars.total.shear[0] == pytest.approx(adapted.reached * walls.at_outflow)
    assert abs(walls.at_outflow - finer.at_outflow) < found.error_bars.total.shear[0]
    assert abs(walls.friction - finer.friction) < 2.0 * adapted.reached * walls.friction
    assert found.scene["numerics"]["mesh_size"] == 1.0
    assert (
        "within" in found.text()
        and "accuracy            error of the shear velocity" in found.text()
    )


def test_an_accuracy_that_is_not_reached_is_said_so():
    """Where the budget is spent after the first mesh no error is known at all."""
    found = incipient.run(channel(22000.0, 4.0, numerics=asked(0.001, budget_seconds=1e-3)))
    assert not found.adaptation.met and found.adaptation.reached is None
    assert "accuracy            error of the shear velocity unknown" in found.text()
    assert "stopped at numerics.budget_seconds = 0.001" in found.text()


@pytest.mark.slow
@pytest.mark.parametrize("mesh_size", [2.0, 2.0**0.5])
def test_error_bars_of_shear_velocities_cover_what_finer_cells_change(mesh_size):
    """Over a level bed and a wavy one, whose mean u* is compared.

    Over forms the bar may be twice as wide: what the coarser two meshes differ by is not taken to fall there.
    """
    bed = Sinusoidal(amplitude=0.025, wavelength=1.0)
    for scene, widest in ((channel(22000.0, 20.0), 0.03), (channel(22000.0, 8.0, bed=bed), 0.06)):
        numerics = Numerics(mesh_size=mesh_size, order=2)
        found = incipient.run(scene.model_copy(update={"numerics": numerics}))
        finer = incipient.run(scene.model_copy(update={"numerics": FINE})).turbulence
        which = finer.leading
        change = abs(found.turbulence.shear_velocities - finer.shear_velocities)[which]
        assert 0.0 < change < found.error_bars.total.shear[which] < widest * finer.shear_velocity


@pytest.mark.slow
def test_a_stone_is_as_accurate_as_asked():
    """Force and safety factor by a run on cells half as large as the last."""
    found = incipient.run(stone(numerics=asked(0.1)))
    assert found.adaptation.met and found.adaptation.of == "force"
    finer = incipient.run(stone(mesh_size=1.0))
    change = np.abs(found.force.flow - finer.force.flow)
    term = found.error_bars.terms[0]
    assert term.name == "discretisation"
    assert (change[:2] < term.force[:2]).all()
    assert np.linalg.norm(change) < 0.1 * np.linalg.norm(finer.force.flow)


@pytest.mark.slow
def test_what_accuracy_costs_in_a_turbulent_channel(tmp_path):
    """A ladder of real runs: finer cells err less."""
    scene = channel(22000.0, 5.0, mesh_size=1.0)
    rungs = ladder(scene, quick=True)
    made = run_ladder(scene, rungs, tmp_path / "study", measure, lambda line: None)
    assert not made.failed and set(made.reference.quantities) == {"shear velocity"}
    by_size = sorted(made.judged, key=lambda one: one.run.rung.mesh_size)
    errors = [one.errors["shear velocity"] for one in by_size]
    # The first is the reference. Of the coarsest two it is chance which errs less.
    assert errors[0] < errors[1] < min(errors[2:]) and max(errors) < 0.02
    # That the number is u* and no other. Its error is judged above.
    assert by_size[-1].run.numbers["shear_velocity"] == pytest.approx(0.05, rel=0.1)
