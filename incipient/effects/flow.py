"""Effects of the fluid: flow, inertia, unsteadiness, third dimension, moving mesh."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from ..planning.clearance import near_inflow
from ..planning.effects import SHARE, Decision, EffectName, accuracy_asked, percent
from ..planning.flow_setup import Setup
from ..planning.numbers import Numbers, time_of_change, wall_distance
from ..planning.plan import Plan
from ..results.left_out import Omission
from ..results.of_runs import FLOW
from ..results.quantity import OutputQuantity
from ..scene.symmetry import differences
from .effect import Effect, Solved
from .run_part import Solving

if TYPE_CHECKING:
    from ..fluid import FlowModel

# Critical Reynolds number of vortex shedding from a cylinder in a uniform flow (Heil, Rosso, Hazel & Brøns 2017, J.
# Fluid Mech. 812, 199; experiments: 47, Provansal, Mathis & Boyer 1987, J. Fluid Mech. 182, 1), and distance from a
# wall, in diameters, within which shedding is suppressed (Bearman & Zdravkovich 1978, J. Fluid Mech. 89, 33; square
# cylinder: 0.35, Bosch, Kappler & Rodi 1996, Exp. Therm. Fluid Sci. 13).
SHEDDING, SHEDDING_CLEARANCE = 46.0, 0.3
SHEDDING_OF_SPHERE = 270.0  # Johnson & Patel 1999, J. Fluid Mech. 378, 19


class FlowEffect(Effect):
    """The motion of the fluid."""

    name = EffectName.FLOW
    quantities = FLOW

    def decide(self, setup: Setup, numbers: Numbers) -> Decision:
        """Present unless the fluid remains at rest."""
        scene = setup.scene
        return Decision(
            self.name, scene.flow.kind != "still" or scene.has_surface, _reason_of_flow(setup)
        )

    def terms(self, model: FlowModel, setup: Setup, plan: Plan, unsteady: bool) -> FlowModel:
        """Force of the turbulent fluctuations on the mean profile."""
        if setup.scene.flow.kind != "log-law":
            return model
        from ..planning.mean_force import sustaining_force

        base_flow = setup.base_flow
        force = sustaining_force(base_flow.mean_profile, base_flow.datum, base_flow.domain.up)
        return replace(model, body_force=force)

    def warnings(self, setup: Setup) -> Iterator[str]:
        """A grain close to the inflow."""
        yield from filter(None, (near_inflow(setup.geometry, setup.scene.flow.kind == "still"),))


def _reason_of_flow(setup: Setup) -> str:
    scene = setup.scene
    if scene.flow.kind == "log-law":
        return "mean profile of a turbulent flow, kept by a force instead of its turbulent stress"
    if scene.flow.kind != "still":
        mean = "; without [gusts], which incipient entrainment adds" if scene.gusts else ""
        return f"{scene.flow.kind} flow{mean}"
    return "the fluid starts from rest" if scene.has_surface else "the fluid is at rest"


def _largest_of_cells(run: Solving) -> float:
    from ..fluid.derived import measured_cell_reynolds

    return measured_cell_reynolds(run.fluid)


class InertiaEffect(Effect):
    """Convection of momentum."""

    name = EffectName.INERTIA
    quantities = (
        OutputQuantity(
            "measured_cell_reynolds",
            "largest Reynolds number of a cell",
            heading="other numbers",
            measure=_largest_of_cells,
        ),
    )

    def decide(self, setup: Setup, numbers: Numbers) -> Decision:
        """Decision of the setup, on which the elements depend."""
        return setup.inertia

    def terms(self, model: FlowModel, setup: Setup, plan: Plan, unsteady: bool) -> FlowModel:
        """Convection with stabilisation; the steady start of unsteady flow is upwinded for its solver."""
        start = plan.has(EffectName.UNSTEADINESS) and not unsteady
        upwind = plan.stabilisation.upwind or (start and plan.solver.name == "block")
        stabilised = plan.stabilisation.present and not upwind
        return replace(model, inertia=True, stabilisation=stabilised, upwind=upwind)

    def left_out(self, solved: Solved, decision: Decision) -> Iterator[Omission]:
        """Dual-weighted convection, or Oseen's term without error bars."""
        if decision.expected == 0.0:
            return
        remedy = "set fluid.inertia = true and effects.inertia = true"
        if not solved.run.scene.numerics.error_bars:
            how = "by Oseen's term, at most"
            yield Omission(self.name, decision.expected, how, False, remedy)
            return
        from ..forms.terms import convection
        from .missing_term import weighted

        where = solved.run.fluid.reference_map
        yield weighted(solved, self.name, lambda v, w: convection(v, v, w, where), remedy)


class UnsteadinessEffect(Effect):
    """The rate of change of the flow."""

    name = EffectName.UNSTEADINESS

    def decide(self, setup: Setup, numbers: Numbers) -> Decision:
        """Present with [time], unless the scene requires a quasi-steady flow."""
        scene = setup.scene
        time = scene.time
        if time is None:
            risk = shedding(setup, numbers)
            return Decision(self.name, False, "no [time] section" + (f"; {risk}" if risk else ""))
        change = expected_of_changes(setup)
        if scene.effects.unsteadiness is False:
            reason = "effects.unsteadiness = false: quasi-steady flow"
            return Decision(self.name, False, reason, True, change)
        ends = (
            ""
            if time.until_steady is None
            else f", or until it changes by {time.until_steady:g} per unit of time"
        )
        reason, small = f"until t = {time.end:g}{ends}", SHARE * accuracy_asked(scene.numerics)
        if change is not None and change < small and not scene.moves:
            reason += f"; effects.unsteadiness = false would change the drag by {percent(change)}"
        return Decision(self.name, True, reason, scene.effects.unsteadiness is True, change)

    def terms(self, model: FlowModel, setup: Setup, plan: Plan, unsteady: bool) -> FlowModel:
        """The time derivative, and the form of unsteady convection."""
        if not unsteady:
            return model
        base_flow = setup.base_flow
        model = replace(model, unsteady=True, convection=plan.convection)
        if base_flow.gust is None:
            return model
        from ..planning.driving_force import driven

        return replace(model, driven=driven(base_flow, setup.geometry.grain))

    def left_out(self, solved: Solved, decision: Decision) -> Iterator[Omission]:
        """Risk of vortex shedding, or the dual-weighted time derivative of quasi-steady flow."""
        run = solved.run
        if run.scene.time is None:
            _, _, risk = decision.reason.partition("; ")
            if risk:
                yield Omission(self.name, None, risk, True, "add a section [time]")
            return
        remedy, transient = 'set effects.unsteadiness = "auto"', run.time_stepper
        if not run.scene.numerics.error_bars or transient is None or not transient.past:
            how = "history force, pressure gradient and added mass, leading terms"
            yield Omission(self.name, decision.expected, how, False, remedy)
            return
        from ..forms.terms import inertia
        from .missing_term import weighted

        before, rate, fluid = transient.past[0], run.fluid.velocity, run.fluid
        values, length = fluid.state.x.array - before.state, fluid.time - before.time
        rate.x.array[:] = values[fluid.space.velocity_map] / length
        yield weighted(
            solved, self.name, lambda v, w: inertia(rate, w, fluid.reference_map), remedy
        )


def shedding(setup: Setup, numbers: Numbers) -> str:
    """Warn of probable vortex shedding in a steady flow; "" otherwise."""
    reynolds, scene = numbers.grain_reynolds, setup.scene
    inert = scene.fluid.inertia and scene.effects.inertia is not False
    least, shape = (SHEDDING, "cylinder") if scene.gdim == 2 else (SHEDDING_OF_SPHERE, "sphere")
    if (
        reynolds is None
        or reynolds <= least
        or not inert
        or wall_distance(setup) < SHEDDING_CLEARANCE
    ):
        return ""
    return f"grain Re {reynolds:.3g}: a {shape} in a uniform flow sheds vortices from {least:g} on"


def expected_of_changes(setup: Setup) -> float | None:
    """Relative change of the drag on a fixed grain in an unsteady base flow, at most one; None if steady.

    Force on a fixed sphere over Stokes drag: history force a/sqrt(nu T), and pressure gradient with
    added mass, a^2/(3 nu T), for radius a and time scale T (Maxey & Riley 1983, Phys. Fluids 26,
    883; history force of oscillating flow, 2/sqrt(pi) times as large for steady growth).
    """
    base_flow, grain = setup.base_flow, setup.geometry.grain
    period = time_of_change(base_flow, setup.scene.time)
    if period is None or grain is None:
        return None
    diffusion = (0.5 * grain.size) ** 2 / (base_flow.viscosity * period)
    return min(math.sqrt(diffusion) + diffusion / 3.0, 1.0)


class MovingMeshEffect(Effect):
    """The motion of the mesh with grain or surface."""

    name = EffectName.MOVING_MESH

    def decide(self, setup: Setup, numbers: Numbers) -> Decision:
        """Present with a moving grain or a free surface."""
        scene = setup.scene
        there, forced = scene.moves or scene.has_surface, scene.effects.moving_mesh != "auto"
        return Decision(self.name, there, _reason_of_mesh(setup), forced)

    def terms(self, model: FlowModel, setup: Setup, plan: Plan, unsteady: bool) -> FlowModel:
        """The mesh velocity in convection."""
        return replace(model, moving_mesh=unsteady)


def _reason_of_mesh(setup: Setup) -> str:
    scene = setup.scene
    if scene.has_surface and not scene.moves:
        return "the mesh rises and falls with the free surface"
    if not scene.moves:
        return "nothing moves"
    if scene.body is not None and scene.body.shape in ("disc", "sphere"):
        return f"the mesh follows the grain; it need not turn with a {scene.body.shape}"
    return "the mesh follows the grain"


class ThirdDimensionEffect(Effect):
    """3-D flow, in half of the domain if mirror-symmetric."""

    name = EffectName.THIRD_DIMENSION

    def decide(self, setup: Setup, numbers: Numbers) -> Decision:
        """Present with domain.width."""
        scene = setup.scene
        reason = f"the scene is {'two' if scene.gdim == 2 else 'three'}-dimensional"
        if scene.gdim == 2:
            return Decision(self.name, False, reason)

        if setup.symmetric:
            reason += f"; half of it is computed: it is its own mirror image in y = {scene.domain.middle:g}"
        elif scene.domain.symmetric is False:
            reason += "; the whole of it is computed: domain.symmetric = false"
        else:
            reason += f"; the whole of it is computed: {next(differences(scene), '')}"
        return Decision(self.name, True, reason, scene.effects.third_dimension is True)
