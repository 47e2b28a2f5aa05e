"""Preparation of a run: plan, mesh and fluid."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

from ..installed import required
from ..parallel import Comm, collectively
from ..planning import meshing
from ..planning.meshing import Layout
from ..planning.plan import Plan, plan_of
from ..progress import Silent
from ..scene import Scene
from ..setup.geometry import CLOSED
from ..setup.setup import Setup
from .state import Accounts, Recorder, Run

if TYPE_CHECKING:
    from ..coupled.tractions import TractionProbe
    from ..coupled.turbulent_flow import TurbulentFlow
    from ..fluid import Condition, FlowModel, Fluid
    from ..mesh.domain import Domain
    from ..restart import Checkpoint


@contextmanager
def prepared(
    scene: Scene,
    comm: Comm,
    accounts: Accounts | None = None,
    recorder: Recorder | None = None,
    voice: Silent | None = None,
    checkpoint: Checkpoint | None = None,
    sizing: Callable[[Layout], Layout] = lambda layout: layout,
    speed: float = 1.0,
) -> Iterator[Run]:
    """Prepare the run of a scene with mesh and fluid, freed at the end. Collective.

    Args:
        accounts: of the search that includes the run.
        recorder: notified of the mesh.
        checkpoint: of an earlier session, which provides mesh and costs.
        sizing: changes the planned cell sizes.
        speed: of the flow, relative to the scene's.

    Raises IncipientError on all ranks if planning or meshing fails.
    """
    accounts, voice = accounts or Accounts(), voice or Silent()
    voice.begin("plan")
    with accounts.ledger.stage("plan"):
        setup = Setup(scene)
        plan = plan_of(setup)
        # The distance of the law of the wall depends on the speed.
        meshed = setup.faster(speed) if scene.is_averaged and speed != 1.0 else setup
        layout = sizing(meshing.lay_out(meshed, plan))
    voice.begin("import")
    with accounts.ledger.stage("import"), required():
        _load_libraries(comm, draws=checkpoint is None)
        from ..mesh.domain import build
        from ..planning.conditions import conditions
    voice.begin("mesh")
    with accounts.ledger.stage("mesh"):
        contacts = None
        if plan.has("contact"):
            with accounts.ledger.stage("contact"):
                contacts = setup.contacts
        if checkpoint is None:
            domain = build(comm, layout.mesh)
        else:
            from ..restart import domain_of

            domain = domain_of(checkpoint, comm)
    (recorder or Recorder()).begin(scene, domain)
    with ExitStack() as stack:
        voice.begin("forms")
        with accounts.ledger.stage("forms"):
            model = flow_model(setup, plan, unsteady=plan.has("unsteadiness"))
            turbulence = None
            if scene.is_averaged:
                from ..coupled.turbulent_flow import TurbulentFlow

                turbulence = TurbulentFlow(setup, domain)
            fluid = fluid_of(setup, domain, model, conditions(meshed), plan.reynolds, turbulence)
            stack.push(fluid)
            probe = probe_of(fluid, layout)
            run = Run(setup, plan, layout, contacts, fluid, probe, accounts, voice, turbulence)
            # Another fluid may replace the first, which is then freed.
            stack.push(lambda *exception: run.fluid.__exit__(*exception))
        if checkpoint is not None:
            kept = checkpoint.progress  # of earlier sessions
            run.first_motion = kept["first_motion"]
            accounts.iterations.update(kept["iterations"])
            accounts.ledger.count(kept["wall_time"], kept["total"])
        yield run


def _load_libraries(comm: Comm, draws: bool) -> None:
    """Load the large libraries, gmsh before dolfinx, after which it loads three times as slowly. Collective."""
    with collectively(comm), required():
        if draws and comm.rank == 0:
            from ..meshes import model  # noqa: F401
    from .. import compat  # noqa: F401


def flow_model(setup: Setup, plan: Plan, unsteady: bool, inertia: bool = True) -> FlowModel:
    """Flow model with the terms of a plan's effects, of its unsteady flow or of the steady one at its start."""
    from ..fluid import FlowModel
    from ..setup.driving_force import driven

    inert, starts = plan.has("inertia"), plan.has("unsteadiness") and not unsteady
    upwind = plan.stabilisation.upwind or (inert and starts and plan.solver.name == "block")
    return FlowModel(
        order=plan.order,
        inertia=inert and inertia,
        unsteady=unsteady,
        convection=plan.convection if unsteady else "implicit",
        body_force=setup.base_flow.body_force,
        driven=driven(setup.base_flow, setup.scene.grain) if unsteady else None,
        moving_mesh=unsteady and plan.has("moving mesh"),
        stabilisation=plan.stabilisation.present and not upwind,
        upwind=upwind,
        solver=plan.solver.name,
        mirrored=setup.mirrored,
    )


def fluid_of(
    setup: Setup,
    domain: Domain,
    model: FlowModel,
    conditions: Sequence[Condition],
    reynolds: float,
    turbulence: TurbulentFlow | None,
) -> Fluid:
    """The fluid of a run on a mesh, with its turbulence, if any. Collective.

    Steady flow through open ends begins with the base flow: from rest the first Newton update is linearised about a
    jump at the inflow.
    """
    from ..fluid import Fluid

    if turbulence is not None:
        return turbulence.fluid(model, conditions, reynolds)
    fluid = Fluid(domain, model, conditions, reynolds)
    if fluid.constraints.open and not model.unsteady:
        fluid.begin(setup.base_flow.velocity)
    return fluid


def probe_of(fluid: Fluid, layout: Layout) -> TractionProbe | None:
    """Traction probe of the grain, or None. Collective."""
    if layout.placement is None:
        return None
    from ..coupled import tractions

    closing = layout.closing
    pressure = None if closing is None else tractions.EnclosedPressure(fluid, closing, CLOSED)
    return tractions.TractionProbe(fluid, "body", layout.placement.centre, pressure)
