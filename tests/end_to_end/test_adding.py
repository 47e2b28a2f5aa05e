"""Additions to the program, made as docs/contribute/adding.md says."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI
from pydantic import Field
from scenes import message, rows_of

import incipient
from incipient import compat, geometry
from incipient.arrays import Floats, planar_cross
from incipient.contact.friction import FrictionCone
from incipient.fluid import FlowModel
from incipient.geometry.plane.curves import Curve
from incipient.planning import effects, plan
from incipient.planning.effects import Decision
from incipient.planning.plan import Plan
from incipient.reporting import part
from incipient.reporting.page import Bounded, cell
from incipient.results import of_runs
from incipient.results.accuracy import Omission
from incipient.results.kinds import RUN
from incipient.results.quantity import OutputQuantity
from incipient.results.result import Result
from incipient.scene import (
    Contact,
    Disc,
    Domain,
    Fluid,
    Numerics,
    Output,
    Poiseuille,
    Scene,
    Time,
    dumps,
    loads,
    register,
)
from incipient.scene.beds import BedSection
from incipient.scene.flows import Profile
from incipient.scene.grains import GrainSection
from incipient.scene.section import NotNegative, Positive, Rule, key
from incipient.setup.setup import Setup
from incipient.simulation import build, omitted
from incipient.simulation.build import flow_model
from incipient.simulation.simulate import solved
from incipient.simulation.state import Run
from incipient.sweep import worker
from incipient.sweep.worker import quantities

# A grain, a bed, a base flow with a key, and a law of contact, added as docs/contribute/adding.md says, and then run.
#
# The grain is a stadium, a square with a half-disc on two sides; the bed is a sawtooth; the flow is driven by wind;
# the law is friction that differs with its direction. Numbers are exact lengths and areas, the equilibrium of a grain
# on two slopes, an exact solution of the Navier-Stokes equations, and Coulomb's law.


# -- the grain: its geometry, and its section -------------------------------------------------------


@dataclass(frozen=True)
class Capsule(geometry.Grain):
    """All points within a radius of the straight line from (-half, 0) to (half, 0)."""

    half: float
    radius: float

    @property
    def size(self) -> float:
        """From one end to the other."""
        return 2.0 * (self.half + self.radius)

    def outline(self) -> tuple[Curve, ...]:
        """Counter-clockwise from the lower left end of the lower side; arcs are shorter than half a turn."""
        a, r = self.half, self.radius
        right, left = (a, 0.0), (-a, 0.0)
        return (
            geometry.Line((-a, -r), (a, -r)),
            geometry.Arc((a, -r), right, (a + r, 0.0)),
            geometry.Arc((a + r, 0.0), right, (a, r)),
            geometry.Line((a, r), (-a, r)),
            geometry.Arc((-a, r), left, (-a - r, 0.0)),
            geometry.Arc((-a - r, 0.0), left, (-a, -r)),
        )


class Stadium(GrainSection):
    """A rectangle with half-discs on two sides."""

    shape: Literal["stadium"] = Field("stadium", description="Shape of the grain")
    straight: Positive = Field(description="Length of the straight sides [length]")
    diameter: Positive = Field(description="Distance of these sides [length]")

    def new_grain(self) -> Capsule:
        """The grain's shape in its body frame."""
        return Capsule(0.5 * self.straight, 0.5 * self.diameter)


# -- the bed: its geometry is a polyline over more than the domain -----------------------------------


class Sawtooth(BedSection):
    """Symmetric teeth of straight lines, with a valley at x = 0."""

    kind: Literal["sawtooth"] = Field("sawtooth", description="Kind of bed")
    tooth: Positive = Field(description="Length of a tooth [length]")
    height: Positive = Field(description="Height of a tooth [length]")

    def shape(self, base: float, corner: Sequence[float]) -> geometry.Bed:
        """The bed's shape above its base line, abscissae counted from a corner."""
        x = 0.5 * self.tooth * np.arange(-8, 9) - corner[0]
        return geometry.Polyline(np.column_stack([x, self.height * (np.arange(17) % 2)]), base)


# -- the flows: one of a profile, with a key and its rule, and one whose profile changes in time -----


class Wind(Profile):
    """Flow below a wind, against which the pressure rises downstream."""

    stresses_bed = True
    rules = (
        Rule("adverse", lambda s: s.adverse >= 1.0,
             "is {s.adverse:g}: the flow turns at the bed", "give less than 1"),
    )  # fmt: skip
    kind: Literal["wind"] = key("Kind of flow", "wind")
    velocity: Positive = key("Velocity V of the surface [length/time]", 1.0)
    adverse: NotNegative = key(
        "Pressure gradient over that at which the bed has no stress [-]", 0.0
    )

    def speed(self, z: Any, depth: float) -> Any:
        """A parabola through zero and V."""
        return self.velocity * z / depth * (1.0 - self.adverse * (1.0 - z / depth))


WIND = """\
[domain]
length = 4.0
height = 3.0
[fluid]
reynolds = 6.0
scale = "flow"
[flow]
kind = "wind"
[bed]
kind = "flat"
[numerics]
order = 2
error_bars = false
[output]
fields = false
"""


# -- the law: friction along scales or bedding planes, smaller against the first tangent ------------


@dataclass(frozen=True, eq=False)
class Scales(FrictionCone):
    """A law of the plane with two coefficients, of which `against` is that of forces against the first tangent."""

    against: Floats = field(default_factory=lambda: np.zeros(()))

    def generators(self, planar: bool) -> Floats:
        """The two edges."""
        assert planar
        edges = [
            np.stack([np.ones_like(one), sign * one, 0.0 * one], axis=-1)
            for one, sign in ((self.coefficient, 1.0), (self.against, -1.0))
        ]
        return np.stack([edge / np.linalg.norm(edge) for edge in edges], axis=-2)

    def margin(self, local: Floats) -> Floats:
        """The distance from the nearer edge."""
        angle = self._angle(local[..., 1])
        return np.asarray(np.sin(angle) * local[..., 0] - np.cos(angle) * np.abs(local[..., 1]))

    def edge(self, shear: Floats) -> Floats:
        """The edge of the direction."""
        angle, sign = self._angle(shear[..., 0]), np.sign(shear[..., 0])
        return np.stack([np.cos(angle), sign * np.sin(angle), 0.0 * angle], axis=-1)

    def _angle(self, shear: Floats) -> Floats:
        return np.arctan(np.where(shear >= 0.0, self.coefficient, self.against))


class ScaledContact(Contact):
    """The section with the law's key."""

    friction_against: NotNegative = key("Coefficient against the first tangent [-]", 0.0)

    @property
    def law(self) -> Scales:
        """The law of both coefficients."""
        return Scales(np.asarray(self.friction), np.asarray(0.0), np.asarray(self.friction_against))


ADDED = """\
[domain]
length = 3.5
height = 4.0
origin = [-1.5, 0.0]
[fluid]
reynolds = 1.0
scale = "grain"
[flow]
kind = "shear"
[body]
shape = "stadium"
straight = 0.5
diameter = 0.6
x = 0.0
density = 2.0
[bed]
kind = "sawtooth"
tooth = 1.0
height = 0.2
[gravity]
acceleration = 500.0
[contact]
friction = 0.5
[numerics]
mesh_size = 4.0
order = 2
error_bars = false
[output]
fields = false
"""


@pytest.fixture
def added() -> Iterator[None]:
    """The kinds, for one test."""
    fields = [Scene.model_fields[name] for name in ("body", "bed", "flow", "contact")]
    before = [one.annotation for one in fields]
    for section in (Stadium, Sawtooth, Wind):
        register(section)
    yield
    for one, annotation in zip(fields, before, strict=True):
        one.annotation = annotation
    Scene.model_rebuild(force=True)


@pytest.mark.usefixtures("added")
def test_a_grain_and_a_bed_that_are_registered_are_planned_meshed_solved_and_judged() -> None:
    scene = loads(ADDED)
    assert loads(dumps(scene)) == scene
    slope = math.atan2(0.2, 0.5)
    # It lies across the valley, its round ends on two slopes.
    placement = scene.placement
    assert placement.centre == pytest.approx(
        (0.0, 0.3 / math.cos(slope) + 0.25 * math.tan(slope)), abs=1e-9
    )
    result = incipient.run(scene)
    assert result.status == "complete"
    flow, couple = result.force.flow[:2], result.torque.flow[2]
    weight = (result.force.weight + result.force.buoyancy)[:2]
    assert flow[0] > 0.0
    assert weight[1] == pytest.approx(-(2.0 - 1.0) * 500.0 * scene.grain.volume)
    # The flow is stronger by the safety factor when the moment about the contact downstream vanishes.
    away = 0.3 * np.array([-math.sin(slope), math.cos(slope)]) - [0.25, 0.0]
    pivots = -float(planar_cross(away, weight)) / (float(planar_cross(away, flow)) + couple)
    assert result.verdict["mode"] == "rest"
    assert result.verdict["safety_factor"] == pytest.approx(pivots, rel=1e-9)


WRONG = [
    (ADDED.replace("diameter = 0.6", "diameter = -1"), "body.diameter: is -1; give a number greater than 0"),
    (ADDED.replace('"sawtooth"', '"sawtoth"'), 'did you mean "sawtooth"'),
    (WIND.replace('"wind"', '"wind"\nadvers = 0.1'), 'did you mean "adverse"'),
    *(
        (WIND.replace('"wind"', f'"wind"\nadverse = {value}'), f"flow.adverse: {why}")
        for value, why in (
            ("-1.0", "is -1.0; give a number of at least 0"),
            ("1.5", "is 1.5: the flow turns at the bed; give less than 1"),
            ('"much"', 'is "much"; give a number'),
        )
    ),
]  # fmt: skip


@pytest.mark.parametrize(("text", "why"), WRONG)
@pytest.mark.usefixtures("added")
def test_what_is_wrong_in_them_is_said_like_of_all_others(text: str, why: str) -> None:
    assert why in message(lambda: loads(text))


def test_a_kind_is_registered_once_and_is_unknown_without(request: pytest.FixtureRequest) -> None:
    assert '"stadium" is not known' in message(lambda: loads(ADDED))
    request.getfixturevalue("added")
    used = "Stadium: shape or kind is missing, or used by another section; give a key as in"
    assert message(lambda: register(Stadium)).startswith(used)


@pytest.mark.usefixtures("added")
def test_a_base_flow_of_a_profile_passes_through_unchanged() -> None:
    """It is an exact solution, quadratic in the height, and so are the elements; its stress is nu V (1 - adverse)/h."""
    scene = loads(WIND, overrides=["flow.adverse=0.4"])
    assert loads(dumps(scene)) == scene
    setup = Setup(scene)
    assert setup.bed_stress() == pytest.approx(scene.viscosity * 0.6 / 3.0, rel=1e-6)
    assert "wind flow" in incipient.make_plan(scene).text()
    with solved(scene, MPI.COMM_SELF) as run:
        computed, exact = run.fluid.velocity, run.fluid.velocity
        exact.interpolate(lambda x: setup.base_flow.velocity(x, 0.0))
        assert np.abs(computed.x.array - exact.x.array).max() < 1e-7


BLOCK = ADDED.replace(
    'shape = "stadium"\nstraight = 0.5\ndiameter = 0.6',
    'shape = "rectangle"\nwidth = 2.0\nheight = 0.3',
).replace('kind = "sawtooth"\ntooth = 1.0\nheight = 0.2', 'kind = "flat"')


@pytest.mark.usefixtures("added")
@pytest.mark.parametrize(("along", "against"), [(0.5, 0.2), (0.2, 0.5)])
def test_a_law_of_contact_is_what_the_criterion_applies(along: float, against: float) -> None:
    """A block on a plane slides once the drag exceeds friction against it times the weight less the lift."""
    Scene.model_fields["contact"].annotation = ScaledContact | None  # type: ignore[assignment]
    Scene.model_rebuild(force=True)
    scene = loads(
        BLOCK, overrides=[f"contact.friction={along}", f"contact.friction_against={against}"]
    )
    result = incipient.run(scene)
    drag, lift = result.force.flow[:2]
    weight = -(result.force.weight + result.force.buoyancy)[1]
    # The contacts push upstream, along their first tangents, which are to the left seen from the grain.
    slides = along * weight / (drag + along * lift)
    assert result.verdict["safety_factor"] == pytest.approx(slides, rel=1e-9)
    assert result.verdict["mode"] == "rest" and slides > 1.0


# An effect added as docs/contribute/adding.md says: a decision in the table, its term, and what it would change.
#
# The effect is a force per unit mass f along x, as gravity has in an inclined channel that is not resolved
# otherwise. With velocities given all around but at the outflow it only adds f (x - x_outflow) to the pressure: the
# velocity stays, and the load on a grain of area A changes by -f A along x (Archimedes' law for f), exactly.


FORCE = 0.3
SCENE = Scene(
    domain=Domain(length=6, height=3),
    fluid=Fluid(reynolds=0.001, scale="grain"),
    flow=Poiseuille(),
    body=Disc(diameter=1, centre=(2, 1.2)),
    numerics=Numerics(mesh_size=3, error_bars=False),
    output=Output(fields=False),
)


NAME: Any = "driving force"


def decisions(setup: Setup) -> tuple[Decision, ...]:
    """The effect is present where the title says so."""
    there = "driven" in setup.scene.title
    reason = f"f = {FORCE:g}" if there else "the title does not ask for it"
    return (*effects.decisions(setup), Decision(NAME, there, reason))


def warnings(setup: Setup) -> tuple[str, ...]:
    """A warning that a reader can look for."""
    return ("the driving force is the same everywhere",) if "driven" in setup.scene.title else ()


def with_force(setup: Setup, plan: Plan, **which: bool) -> FlowModel:
    """A uniform force along x in the equation of momentum, where the plan has it."""
    force = (lambda x, t: ufl.as_vector([FORCE, 0.0])) if plan.has(NAME) else None
    return replace(flow_model(setup, plan, **which), body_force=force)


def without_force(run: Run, result: Result, decision: Decision) -> Omission:
    """What it would change: known."""
    return Omission(decision.name, 0.5, "by Archimedes' law", False, "name the scene so")


@pytest.fixture
def added_effect(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plan, "decisions", decisions)
    monkeypatch.setattr(plan, "warnings", warnings)
    monkeypatch.setattr(build, "flow_model", with_force)
    monkeypatch.setitem(omitted.LEFT_OUT, NAME, without_force)


@pytest.mark.usefixtures("added_effect")
def test_an_effect_in_the_list_is_planned_computed_and_reported(tmp_path: Path) -> None:
    without = incipient.run(SCENE, tmp_path)
    assert "about 50%" in part(tmp_path / "result.json")[0]
    driven = incipient.run(SCENE.model_copy(update={"title": "A disc in a driven channel"}))
    change = driven.force.flow - without.force.flow
    assert change[0] == pytest.approx(
        -FORCE * SCENE.grain.volume, rel=2e-3
    )  # of the polygon that cells make of it
    assert change[1] == pytest.approx(0.0, abs=1e-6 * FORCE)
    assert "yes  driving force: f = 0.3" in driven.plan.text()
    assert "warning: the driving force is the same everywhere" in driven.plan.text()
    assert [one.name for one in without.omitted if one.exceeds] == ["driving force"]
    assert not [one for one in driven.omitted if one.name == "driving force"]


# An output quantity added as docs/contribute/adding.md says: one entry, which history, result, text and table have.
#
# The quantity is the flux of volume along the channel, the integral of v . grad x over the fluid. By the divergence
# theorem that is the discharge times the length, whatever stands in the channel: V H L with the mean velocity V.


LENGTH, HEIGHT, SHARE = 6.0, 3.0, 0.01
SCENE_QUANTITY = Scene(
    domain=Domain(length=LENGTH, height=HEIGHT),
    fluid=Fluid(reynolds=1.0, scale="grain"),
    flow=Poiseuille(),
    body=Disc(diameter=1, centre=(2, 1.2)),
    time=Time(end=0.2, step=0.1, start="stokes"),
    numerics=Numerics(mesh_size=3, error_bars=False),
    output=Output(fields=False),
)


def _flux(run: Any) -> float:
    velocity, comm = run.fluid.velocity, run.comm
    return float(comm.allreduce(fem.assemble_scalar(compat.form(velocity[0] * ufl.dx))))


def _within_a_share(stored: Any) -> tuple[float, float]:
    return (1.0 - SHARE) * stored["flux"], (1.0 + SHARE) * stored["flux"]


FLUX = OutputQuantity(
    "flux",
    "flux of volume",
    unit="velocity area length",
    column="flux",
    ends=_within_a_share,
    heading="other numbers",
    measure=_flux,
    at_steps=True,
    line="flux of volume",
)


@pytest.fixture
def added_quantity(monkeypatch: pytest.MonkeyPatch) -> None:
    """The flux among the quantities of runs."""
    more = (*of_runs.QUANTITIES, FLUX)
    monkeypatch.setattr(of_runs, "QUANTITIES", more)
    monkeypatch.setitem(worker.KINDS, "run", replace(RUN, quantities=more))


@pytest.mark.usefixtures("added_quantity")
def test_a_quantity_in_the_list_is_in_all_that_a_run_leaves(tmp_path: Path) -> None:
    result = incipient.run(SCENE_QUANTITY, tmp_path)
    flux = Setup(SCENE_QUANTITY).base_flow.mean_speed * HEIGHT * LENGTH
    stored = json.loads((tmp_path / "result.json").read_text())
    assert stored["flux"] == pytest.approx(
        flux, rel=1e-3
    )  # by the velocities at the nodes of the inflow
    rows = rows_of(tmp_path / "history.csv")
    assert len(rows) > 1 and float(rows[-1]["flux"]) == stored["flux"]
    assert f"flux of volume [velocity area length] {stored['flux']:.6g}" in result.text()
    assert "pressure part" in result.text(details=True) and "pressure part" not in result.text()
    row = quantities("run", stored)
    ends = pytest.approx((0.99 * flux, 1.01 * flux), rel=1e-3)
    assert row["flux"] == stored["flux"] and (row["flux_low"], row["flux_high"]) == ends
    page, _ = part(tmp_path / "result.json")
    shown = cell(Bounded(row["flux"], row["flux_low"], row["flux_high"]))
    assert f'<tr><th scope="row">{FLUX.label}</th><td class="number">{shown}</td></tr>' in page
