"""Two parts that move in one flow and on one mesh: the inner and the outer disc of a ring."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from domains import ring

from incipient.body.rigidbody import RigidBody
from incipient.body.state import BodyState, Freedom, Inertia
from incipient.coupled.coupling import Coupling
from incipient.coupled.rigid import RigidPart
from incipient.fluid import Carried, FlowModel, Fluid
from incipient.fluid.transient import Transient
from incipient.geometry.placement import Placement
from incipient.mesh.domain import Domain
from incipient.mesh.motion import MeshMotion, RigidDisplacement

INNER, OUTER = 0.5, 1.0
CENTRE = Placement((0.0, 0.0))
STEP, STEPS = 0.05, 4


def rate(t: float) -> float:
    """Spin of the outer disc, begun smoothly."""
    return float(np.sin(np.pi * min(t, 0.5)) ** 2)


def nodes_at(domain: Domain, radius: float) -> np.ndarray:
    """Numbers of the mesh's nodes on a circle, where the mesh was made."""
    return np.flatnonzero(np.abs(np.linalg.norm(domain.mesh.geometry.x, axis=1) - radius) < 1e-9)


def test_each_part_moves_its_own_boundary() -> None:
    domain = ring(INNER, OUTER, 16, 2)
    motion, made = MeshMotion(domain), domain.mesh.geometry.x.copy()
    inner, outer = (
        RigidDisplacement(domain, name, CENTRE, turning=True) for name in ("inner", "outer")
    )
    at = {radius: nodes_at(domain, radius) for radius in (INNER, OUTER)}
    motion.move(inner.at(Placement((0.05, 0.0))), outer.at(Placement((0.0, -0.03), 0.1)))
    moved = domain.mesh.geometry.x
    turned = np.array([[np.cos(0.1), -np.sin(0.1)], [np.sin(0.1), np.cos(0.1)]])
    assert moved[at[INNER]] == pytest.approx(made[at[INNER]] + [0.05, 0.0, 0.0], abs=1e-12)
    expected = made[at[OUTER], :2] @ turned.T + [0.0, -0.03]
    assert moved[at[OUTER], :2] == pytest.approx(expected, abs=1e-12)
    assert 0.0 < motion.quality().worst < 1.0


@pytest.fixture
def pair() -> Iterator[tuple[RigidPart, RigidPart, Transient]]:
    """The outer disc turns as it is told, the inner one as the flow lets it; neither has mass."""
    model = FlowModel(unsteady=True, moving_mesh=True)
    domain = ring(INNER, OUTER, 24, 2)
    with Fluid(domain, model, [Carried("inner"), Carried("outer")], 0.1) as fluid:
        freedoms = {
            "inner": Freedom((False, False, True)),
            "outer": Freedom.none(2, lambda t: [0.0, 0.0, rate(t)]),
        }
        parts = [
            RigidPart(
                fluid,
                RigidBody(Inertia(0.0, np.zeros(1)), freedom),
                BodyState.at(CENTRE),
                RigidDisplacement(domain, name, CENTRE, turning=True),
                lambda state: np.zeros(3),
            )
            for name, freedom in freedoms.items()
        ]
        coupling = Coupling(fluid, parts, MeshMotion(domain))
        yield parts[0], parts[1], Transient(fluid, 2, 1e-9, interface=coupling)


def test_two_parts_turn_in_one_flow(pair: tuple[RigidPart, RigidPart, Transient]) -> None:
    """Viscous fluid drags the inner disc along, all but at once; it has no mass, so that no couple is left on it."""
    inner, outer, transient = pair
    for _ in range(STEPS):
        report = transient.advance(STEP).report
        assert report.residuals[-1] <= 1e-9 and report.corrected <= 3  # type: ignore[attr-defined]
    assert outer.state.spin[0] == pytest.approx(rate(STEP * STEPS), rel=1e-12)
    assert 0.7 * outer.state.spin[0] < inner.state.spin[0] < outer.state.spin[0]
    couples = [abs(part.end.flow_load[2]) for part in (inner, outer)]
    assert couples[0] < 1e-6 * couples[1]
    assert inner.state.place == pytest.approx([0.0, 0.0], abs=1e-12)
