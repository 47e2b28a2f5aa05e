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


def test_a_disc_on_a_plane_has_none() -> None:
    """Any couple about its only contact rolls a disc on a flat bed."""
    flat = loads(commented(grain_on_bed()), overrides=("numerics.mesh_size=2.0",))
    threshold = find_threshold(flat, MPI.COMM_WORLD)
    assert threshold.factor == 0.0
    assert "any flow moves the grain, rolling" in threshold.text()
