"""Moving grain of a run: coupling with the flow, loads, and history."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Self

import numpy as np

from ..arrays import Floats
from ..body.rigidbody import MeanLoad
from ..body.state import BodyState
from ..fluid import Fluid
from ..fluid.derived import power
from ..fluid.transient import TimeStep, Transient
from ..geometry.placement import Placement
from ..geometry.plane.grains import Disc
from ..geometry.space.grains import Solid, Sphere
from ..mesh.motion import MeshMotion, RigidDisplacement
from ..results.loads import columns_of_load, whole
from ..setup.geometry import Clearance, initial_state, rigid_body
from ..setup.setup import Setup
from .rigid import End, RigidPart

if TYPE_CHECKING:
    from ..restart import Checkpoint

# Positions (in grain sizes) and angles are rounded before meshing, and the mesh moved by the remainder: the mesh does
# not depend on round-off, the number of ranks, or resuming.
ROUNDING = 1e-6
# History columns of the orientation, by dimension.
ORIENTATION = {2: ("angle",), 3: ("quaternion_w", "quaternion_x", "quaternion_y", "quaternion_z")}


class MovingGrain(RigidPart):
    """Moving grain of a scene in a fluid on its original mesh. Every method is collective.

    Args:
        state: None: that of the scene.
        made_for: placement for which the mesh was built; None: that of the state.

    Attributes:
        turns_mesh: whether the mesh rotates with the grain: not with a round one.
    """

    effect = "free body"
    does = ""  # its motion on its bed, where it continues there

    def __init__(
        self,
        setup: Setup,
        fluid: Fluid,
        motion: MeshMotion,
        state: BodyState | None = None,
        made_for: Placement | None = None,
    ):
        scene = setup.scene
        assert scene.body is not None and scene.time is not None and scene.grain is not None
        self.setup, self.scene, self.grain, self.time = setup, scene, scene.grain, scene.time
        self.turns_mesh = not isinstance(self.grain, Disc | Sphere)
        self._ends_on_bed = not scene.body.touches
        if state is None:
            first = setup.stance.placement
            assert first is not None
            state = initial_state(scene.body, first, setup.symmetric)
        free = () if fluid.surface is None else (fluid.surface.condition.boundary,)
        made_at, axis = made_for or state.placement, None
        if isinstance(self.grain, Solid) and self.turns_mesh:
            axis = self.grain.axis_of_revolution()
        if axis is not None:
            axis = made_at.rotation @ axis
        displacement = RigidDisplacement(fluid.domain, "body", made_at, self.turns_mesh, free, axis)
        if made_for is not None:
            fluid.move_mesh(motion.places(displacement.at(state.placement)))
        body = rigid_body(scene.body, setup.symmetric)
        super().__init__(fluid, body, state, displacement, self.other_load, self.room)
        self.remeshings: list[dict[str, Any]] = []
        self.interface_iterations: list[int] = []

    # -- solution ---------------------------------------------------------------------------------

    def on(self, fluid: Fluid, motion: MeshMotion, made_for: Placement) -> Self:
        """The grain with its past, in a fluid on a mesh for a placement near its own."""
        new = type(self)(self.setup, fluid, motion, self.state, made_for)
        new.mean_load, new.end, new.past = self.mean_load, self.end, list(self.past)
        new.remeshings, new.interface_iterations = self.remeshings, self.interface_iterations
        return new

    def mesh_placements(self) -> list[Placement]:
        """Placements for which a new mesh is made: another one where the first fails."""
        return [self.rounded(self.state.placement)]

    def rounded(self, placement: Placement) -> Placement:
        """Round position and rotation since the first placement to `ROUNDING`."""
        first, unit = self.scene.placement, ROUNDING * self.grain.size
        assert first is not None
        way = np.subtract(placement.centre, first.centre)
        turn = placement.turn_since(first)
        return first.moved(unit * np.round(way / unit), ROUNDING * np.round(turn / ROUNDING))

    def last_step(self) -> float | None:
        times = [state.time for state in self.past]
        return None if len(times) == 1 else times[0] - times[1]

    def accept(self, step: TimeStep) -> None:
        super().accept(step)
        self.interface_iterations.append(step.report.corrected)

    def contact_rows(self, step: TimeStep) -> list[dict[str, Any]]:
        return []

    @property
    def ends(self) -> str:
        """Event that ends the run, as in `time.until`, or "contact"; or ""."""
        return "contact" if self.met else ""

    # -- output -----------------------------------------------------------------------------------

    def columns(self, step: TimeStep) -> dict[str, Any]:
        state, gdim = self.state, self.scene.gdim
        load = self.end.flow_load + self.displaced_load(state)
        return {
            **dict(zip("xyz", state.place.tolist(), strict=False)),
            **dict(zip(ORIENTATION[gdim], state.orientation.tolist(), strict=True)),
            **columns_of_load(whole(state.velocities), gdim, "velocity", "spin"),
            **columns_of_load(whole(load), gdim),
            "meshes": 1 + len(self.remeshings),
            "energy_body": self.body.kinetic_energy(state),
            "power": power(self.fluid),
        }

    @property
    def unknowns(self) -> int:
        return int(self.body.mask.sum())

    def reported(self) -> dict[str, Any]:
        state, near = self.state, self.clearance()
        iterations, in_space = self.interface_iterations or [0], self.scene.gdim == 3
        trajectory = {
            "ended": {
                "by": self.ends or "time",
                "time": self.fluid.time,
                "clearance": near.distance,
                "nearest": near.other,
                "without_verdict": "",
            },
            "place": state.place,
            **(
                {"quaternion": state.orientation}
                if in_space
                else {"angle": float(state.orientation[0])}
            ),
            "velocity": state.velocity,
            "spin": state.spin if in_space else float(state.spin[0]),
            "mass": self.body.inertia.mass,
            "inertia": self.body.inertia.moments
            if in_space
            else float(self.body.inertia.moments[0]),
            "interface_iterations": {"mean": float(np.mean(iterations)), "most": max(iterations)},
            "remeshings": self.remeshings,
        }
        return {"trajectory": trajectory}

    def clearance(self) -> Clearance:
        return self.setup.clearance(self.state.placement)

    def room(self, state: BodyState) -> float:
        gap = self.scene.contact_gap
        near = self.setup.clearance(state.placement, 2.0 * gap, from_bed=self._ends_on_bed)
        return near.distance - gap

    def _weight(self) -> Floats:
        return np.asarray((self.body.inertia.mass - self.grain.volume) * self.scene.gravity_vector)

    def other_load(self, state: BodyState) -> Floats:
        load = np.zeros(self.body.size)
        load[: self.body.gdim] = self._weight()
        return load + self.displaced_load(state)

    def displaced_load(self, state: BodyState) -> Floats:
        """Force and torque (k,) of a gust on the displaced fluid."""
        whole = self.fluid.load_on_displaced(state.placement)
        load = np.concatenate(whole)[self._components]
        if self.setup.symmetric:
            load[[1, 3, 5]] = 0.0
        return load

    # -- checkpoints ------------------------------------------------------------------------------

    def stored(self, transient: Transient) -> dict[str, Any]:
        from ..restart import numbered_nodes

        velocities = np.array([x.velocities for x in transient.past])
        body = {
            "weights": numbered_nodes(self.fluid.domain.mesh).joined(self.mesh.weights),
            "made_for": BodyState.at(self.mesh.placement).packed(),
            "states": np.array([state.packed() for state in self.past]),
            "times": np.array([state.time for state in self.past]),
            "mean_load": vars(self.mean_load),
            "load": self.end.load,
            "flow_load": self.end.flow_load,
            "length": self.end.length,
            "velocities": velocities.reshape(-1, self.body.size),
            "met": self.met,
            "remeshings": self.remeshings,
            "interface_iterations": self.interface_iterations,
        }
        return {"body": body}

    def resume(self, kept: Checkpoint) -> None:
        from ..restart import spread_nodes

        body = kept.body
        self.mesh.weights[:] = spread_nodes(self.fluid.domain.mesh, body["weights"])
        packed = zip(body["states"], body["times"].tolist(), strict=True)
        self.past = [BodyState.unpacked(*row) for row in packed]
        self.state, self.met = self.past[0], body["met"]
        self.end = End(self.state, body["load"], body["flow_load"], body["length"])
        # Before the first step, earlier programs stored null.
        known = {name: v for name, v in body["mean_load"].items() if v is not None}
        self.mean_load = MeanLoad(**known)
        self.remeshings = body["remeshings"]
        self.interface_iterations = body["interface_iterations"]
