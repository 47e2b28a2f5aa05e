"""Bodies that a small flow carries along, put together by hand: domain, fluid, body, coupling, time integration."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from mpi4py import MPI

from incipient.arrays import Floats
from incipient.body.rigidbody import RigidBody
from incipient.body.state import BodyState, Inertia
from incipient.coupled.coupling import Coupling
from incipient.coupled.rigid import RigidPart
from incipient.fluid import Carried, Condition, FlowModel, Fluid
from incipient.fluid.transient import TimeStep, Transient
from incipient.geometry.placement import Placement
from incipient.geometry.plane.curves import Line
from incipient.geometry.plane.grains import Disc, Grain
from incipient.mesh.domain import Domain, build
from incipient.mesh.motion import MeshMotion, RigidDisplacement
from incipient.meshes import Near, Region, Sizes
from incipient.meshes.model import meshed


def box_around(
    grain: Grain,
    placement: Placement,
    cell: float,
    far: float,
    low: tuple[float, float] = (0.0, 0.0),
    high: tuple[float, float] = (1.0, 1.0),
    order: int = 2,
    comm: MPI.Comm = MPI.COMM_WORLD,
    more: Sequence[Near] = (),
) -> Domain:
    """The box from `low` to `high` less a grain ("body"), of cells that grow from `cell` at it to `far` away.

    `more`: sizes elsewhere
    """
    holes = {"body": tuple(curve.moved(placement) for curve in grain.outline())}
    region = Region(
        (Line(low, (high[0], low[1])),), high[1], holes, sides=("bottom", "right", "top", "left")
    )
    sizes = Sizes(far, (Near(cell, 0.3, boundary="body"), *more))
    return build(comm, partial(meshed, region, sizes, order))


def lid(x: Floats, t: float) -> Floats:
    """The velocity of a unit cavity's lid that is set off at full speed, less at the corners."""
    return np.vstack([16 * x[0] ** 2 * (1 - x[0]) ** 2, 0 * x[0]])


@dataclass(frozen=True)
class Floating:
    """A body in its flow, and what it did: steps, and velocities (steps + 1, 3) at their ends."""

    fluid: Fluid
    coupling: Coupling
    part: RigidPart
    transient: Transient

    def march(self, end: float, step: float) -> tuple[list[TimeStep], Floats]:
        """Advance; the steps, and the body's velocities and place at the start and after each, (steps + 1, 6)."""
        result = [self.reading()]
        steps = []
        for taken in self.transient.march(end, step):
            steps.append(taken)
            result.append(self.reading())
        return steps, np.array(result)

    def reading(self) -> Floats:
        """Velocities, place and angle (6,) of the body."""
        state = self.part.state
        return np.concatenate([state.velocities, state.place, state.orientation])


@contextmanager
def floating(
    domain: Domain,
    grain: Grain,
    placement: Placement,
    conditions: Sequence[Condition],
    reynolds: float,
    mass: float = 0.0,
    inertia: float = 0.0,
    free: tuple[bool, bool, bool] = (True, True, True),
    velocities: Sequence[float] = (0.0, 0.0, 0.0),
    load: Callable[[BodyState], Any] = lambda state: np.zeros(3),
    motion: Callable[[float], Any] | None = None,
    boundary: str = "body",
    order: int = 2,
    with_inertia: bool = True,
) -> Iterator[Floating]:
    """A body of a mass and a moment of inertia in a flow that starts from rest."""
    model = FlowModel(unsteady=True, moving_mesh=True, inertia=with_inertia)
    with Fluid(domain, model, [Carried(boundary), *conditions], reynolds) as fluid:
        body = RigidBody(Inertia(mass, np.array([inertia])), free, motion)
        state = BodyState.at(placement, velocities, fluid.time)
        displacement = RigidDisplacement(
            domain, boundary, placement, turning=not isinstance(grain, Disc)
        )
        part = RigidPart(fluid, body, state, displacement, load)
        coupling = Coupling(fluid, [part], MeshMotion(domain))
        yield Floating(fluid, coupling, part, Transient(fluid, order, 1e-9, interface=coupling))
