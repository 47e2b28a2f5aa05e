"""The critical flow of a grain in a pocket, against plain runs of the scene at that flow."""

import numpy as np
import pytest
from mpi4py import MPI

import incipient
from incipient.scene import loads
from incipient.scene.example import commented, grain_on_bed
from incipient.threshold import Threshold, find_threshold

POCKET = (
    "bed.kind=half-discs",
    "bed.radius=0.5",
    "bed.spacing=1.2",
    "bed.offset=1.0",
    "numerics.mesh_size=2.0",
)


def pocket(*overrides: str) -> incipient.Scene:
    return loads(commented(grain_on_bed()), overrides=(*POCKET, *overrides))


def run_at(threshold: Threshold, *overrides: str) -> dict:
    """Both judges' verdict on a run of the scene with its flow at the threshold."""
    faster = (f"flow.rate={threshold.factor}", f"fluid.reynolds={threshold.reynolds}")
    verdict = incipient.run(pocket(*faster, *overrides)).verdict
    assert verdict is not None
    return verdict


def test_inertial_threshold_is_where_the_safety_factor_is_one() -> None:
    threshold = find_threshold(pocket(), MPI.COMM_WORLD)
    assert run_at(threshold)["safety_factor"] == pytest.approx(1.0, abs=2e-5)
    assert threshold.mode == "pivoting"
    assert 2 <= len(threshold.trials) <= 8


def test_stokes_threshold_needs_one_flow() -> None:
    threshold = find_threshold(pocket("fluid.inertia=false"), MPI.COMM_WORLD)
    assert len(threshold.trials) == 1
    assert run_at(threshold, "fluid.inertia=false")["safety_factor"] == pytest.approx(1.0, abs=1e-6)
    # Shields number of a shear flow: nu G / ((s - 1) g d) with nu = G d^2/Re, here G and d are one.
    assert threshold.shields == pytest.approx(threshold.factor / 20.0 / (1.65 * 10.0), rel=1e-9)


def test_contact_forces_balance_the_critical_load() -> None:
    """Forces sum to zero, and so do their moments about the centre of mass."""
    threshold = find_threshold(pocket("fluid.inertia=false"), MPI.COMM_WORLD)
    load, forces = threshold.load, threshold.contact_forces
    arms = threshold.contacts.points - load.centre
    assert np.allclose(forces.sum(axis=0) + load.flow_force + load.weight, 0.0, atol=1e-6 * 13)
    assert np.allclose(np.cross(arms, forces).sum(axis=0) + load.flow_couple, 0.0, atol=1e-6 * 13)


def shields(shift: float = 0.0, spacing: float = 1.2, *overrides: str) -> float:
    """Critical Shields number of the grain in a pocket; grain and bed are shifted along the channel together."""
    x = 4.0 + shift
    places = (f"body.x={x}", f"bed.spacing={spacing}", f"bed.offset={x - spacing / 2}")
    return find_threshold(pocket(*places, *overrides), MPI.COMM_WORLD).shields


def test_where_the_inflow_cuts_the_bed_does_not_matter() -> None:
    """What is left is how far the grain is from the inflow: 0.6% on this mesh."""
    found = [shields(shift, 1.2, "numerics.mesh_size=3.0") for shift in (0.0, 0.3, 0.8)]
    assert np.ptp(found) < 0.01 * min(found)


def test_shields_against_spacing_has_no_jumps() -> None:
    """The wider the pocket the safer the grain; a parabola fits the logarithm to 1%."""
    spacings = np.array([1.0, 1.12, 1.25, 1.37, 1.5])
    found = np.log([shields(0.0, s, "numerics.mesh_size=3.0", "fluid.inertia=false") for s in spacings])
    assert (np.diff(found) > 0.05).all()
    assert np.abs(np.polyval(np.polyfit(spacings, found, 2), spacings) - found).max() < 0.01


CHANNELS = {
    "shear": (),
    "open-channel": ("flow={kind='open-channel', velocity=3.0}", "fluid.reynolds=60"),
    "mean": ('flow.datum="mean"',),
}


@pytest.mark.slow
@pytest.mark.parametrize(("flow", "bound"), [("shear", 0.02), ("open-channel", 0.02), ("mean", 0.025)])
def test_where_the_inflow_cuts_the_bed_does_not_matter_over_a_spacing(flow: str, bound: float) -> None:
    """Most of it is the distance to the inflow, which on a flat bed matters more."""
    shifts = np.linspace(0.0, 1.2, 7)
    found = [shields(shift, 1.2, "numerics.mesh_size=1.5", *CHANNELS[flow]) for shift in shifts]
    assert np.ptp(found) < bound * min(found)


@pytest.mark.slow
def test_shields_against_many_spacings_has_no_jumps() -> None:
    spacings = np.linspace(1.0, 1.6, 25)
    found = np.log([shields(0.0, spacing) for spacing in spacings])
    assert (np.diff(found) > 0.0).all()
    assert np.abs(np.polyval(np.polyfit(spacings, found, 4), spacings) - found).max() < 0.003


def test_a_disc_on_a_plane_has_none() -> None:
    """Any couple about its only contact rolls a disc on a flat bed."""
    flat = loads(commented(grain_on_bed()), overrides=("numerics.mesh_size=2.0",))
    threshold = find_threshold(flat, MPI.COMM_WORLD)
    assert threshold.factor == 0.0
    assert "any flow moves the grain, rolling" in threshold.text()
