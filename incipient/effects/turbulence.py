"""Turbulence of the flow, by a model of its means."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from ..planning.effects import Decision, EffectName
from ..planning.flow_setup import Setup
from ..planning.meshing_in_space import cut_at_inflow
from ..planning.numbers import Numbers
from ..planning.wall_cells import WALL_CELL, coarsening
from ..results.left_out import Omission
from ..results.quantity import OutputQuantity, at
from ..turbulence.wall_law import SMOOTH_TO
from .effect import Effect, SlowestFlow, Solved
from .run_part import RunPart, Stage
from .transition import REMEDY, transition, turbulent_from

if TYPE_CHECKING:
    from ..mesh.domain import Domain


def _of_shear_velocity(stored: Mapping[str, Any]) -> tuple[float, float] | None:
    """Ends of the error bar of u* at the outflow; None where it is not known."""
    error, u = at(stored, "error_bars.shear_velocity.0"), stored["turbulence"]["at_outflow"]
    return None if error is None or not u else (max(u - error, 0.0), u + error)


def _of_friction(stored: Mapping[str, Any]) -> tuple[float, float] | None:
    """The error bar of C_f, which goes as the square of u*."""
    ends, walls = _of_shear_velocity(stored), stored["turbulence"]
    if ends is None:
        return None
    low, high = (walls["friction"] * (end / walls["at_outflow"]) ** 2 for end in ends)
    return low, high


# Per unknown of a 3-D flow, of both quantities and what solves them together with the flow: 2.3 GB of 105,000
# unknowns past a grain of a random bed (docs/contribute/defaults.md).
BYTES = 17000.0
# What a threshold is of, beside its Shields number.
TURBULENT = (
    "in mean turbulent flow over one grain{plane}, tau_b of the inflow; gusts move it sooner, see "
    "incipient entrainment"
)
LAMINAR = "in steady laminar {flow} over one grain{plane}; for Shields numbers by probability see incipient entrainment"
# Name in the report of the walls, words, column, key of the error, ends of the error bar.
AT_WALLS = (
    ("least", "least y+ of the walls", "y_plus_min", "", None),
    ("largest", "largest y+ of the walls", "y_plus_max", "", None),
    (
        "shear_velocity",
        "shear velocity u* along the walls, mean",
        "",
        "error_bars.shear_velocity.1",
        None,
    ),
    (
        "at_outflow",
        "shear velocity u* at the outflow",
        "bed_shear_velocity",
        "",
        _of_shear_velocity,
    ),
    ("friction", "friction C_f at the outflow", "friction", "", _of_friction),
    (
        "separated.0",
        "x at which the flow along the bed separates",
        "separation",
        "error_bars.separated.0",
        None,
    ),
    ("separated.1", "x at which it reattaches", "reattachment", "error_bars.separated.1", None),
)


# Over a grain, from which on the distance of the walls from the mesh is reported: 50 nu/u* of one of u* d/nu = 1000.
THICK = 0.05
FEWEST_ACROSS = 6.0  # cells, of a 3-D grain, below which its loads are reported uncertain
SMALL = (
    0.2  # roughness over the smallest length of bedforms up to which it is small compared with them
)
HOLDS = 1e-3  # Shields number of a flow that a 3-D search begins with if it holds the grain
# As measured (docs/contribute/defaults.md).
EXPECTED = "a search takes four flows or more, of up to a minute and a half each; above u* d/nu = 100 of four and more"
SLOW = 20.0  # Reynolds number by depth and mean velocity of the slowest flow that a search looks at
# Where a slower flow than the slowest one moves the grain: a threshold cannot be searched below a mean profile.
BY_SWEEP = 'sweep fluid.reynolds below flow.kind = "log-law", without turbulence'


class TurbulenceEffect(Effect):
    """A model of the mean flow."""

    name = EffectName.TURBULENCE
    quantities = (
        *(
            OutputQuantity(f"turbulence.{key}", words, "", column, error, ends, "at the walls")
            for key, words, column, error, ends in AT_WALLS
        ),
        OutputQuantity("turbulence.spread", "spread of the loads", column="load_spread"),
    )

    def decide(self, setup: Setup, numbers: Numbers) -> Decision:
        """Present where the scene asks for it; else the plan says where the flow may be turbulent."""
        scene = setup.scene
        if scene.is_averaged:
            model = {"k-epsilon": "k-epsilon", "k-omega-sst": "k-omega SST"}[setup.turbulence.model]
            reason = f"effects.turbulence = true: {model} model; {setup.walls.text()}"
            return Decision(self.name, True, reason, True)
        off = scene.effects.turbulence is False
        reason = "effects.turbulence = false" if off else "only with effects.turbulence = true"
        if scene.flow.kind == "log-law":
            reason += f"; mean profile only, the bed is {setup.base_flow.mean_profile.regime()}"
            if numbers.flow_reynolds < (least := turbulent_from(scene.flow.kind)):
                reason += (
                    f"; flow Re {numbers.flow_reynolds:.3g}, but channels are laminar to {least:g}"
                )
        elif transitional := transition(setup, numbers):
            reason += f"; {transitional.text()}; {REMEDY}"
        return Decision(self.name, False, reason, off)

    def warnings(self, setup: Setup) -> Iterator[str]:
        """What makes the result less sure; raises SceneError where the model is not for the scene."""
        if setup.is_averaged:
            yield from _doubts(setup)

    def part_at_start(self, setup: Setup, domain: Domain, stage: Stage) -> RunPart | None:
        """Both quantities of the model."""
        if not setup.is_averaged:
            return None
        from .turbulent_flow import TurbulentFlow

        return TurbulentFlow(setup, domain, stage)

    def memory(self, setup: Setup, unknowns: int) -> float:
        """MiB of both quantities in 3-D, and of what solves them together with the flow."""
        in_space = setup.scene.gdim == 3 and setup.scene.is_averaged
        return BYTES * unknowns / 2**20 if in_space else 0.0

    def left_out(self, solved: Solved, decision: Decision) -> Iterator[Omission]:
        """Report absent fluctuations of a mean profile, or a laminar flow that may be turbulent."""
        numbers, scene = solved.run.plan.numbers, solved.run.scene
        if scene.flow.kind == "log-law":
            how = "gusts, and mixing in the wake; the base flow is the mean of a turbulent flow"
            remedy = "loads are those of the mean flow, gusts exceed them"
            yield Omission(self.name, None, how, True, remedy)
        elif numbers is not None and (transitional := transition(Setup(scene), numbers)):
            how = f"{transitional.number} {transitional.value:.4g} is above {transitional.least:g}"
            yield Omission(
                self.name, None, how, True, f"the flow computed is the laminar one; {REMEDY}"
            )


def slowest_flow(setup: Setup) -> SlowestFlow | None:
    """The slowest flow of a search, a laminar one; None without a model. Not collective.

    In 3-D, where flows take minutes, a search begins at a low Shields number.
    """
    if not setup.is_averaged:
        return None
    walls = setup.walls
    slowest = SLOW * walls.viscosity / (walls.mean * walls.depth)
    start, expected = 0.0, ""
    if setup.geometry.gdim == 3:
        start, expected = (HOLDS * setup.stress_unit / setup.bed_stress()) ** 0.5, EXPECTED
    return SlowestFlow(slowest, "looked at", BY_SWEEP, start, expected)


def threshold_needs(setup: Setup) -> Iterator[str]:
    """What the scene lacks for a search, whose meshes follow the speed of the flow. Not collective."""
    if setup.is_averaged and setup.scene.numerics.accuracy is not None:
        yield "numerics.accuracy left out with turbulence; see its error bars"


def threshold_notes(setup: Setup, factor: float) -> Iterator[str]:
    """What flow a threshold, so many times the scene's, is for, and whether that can be laminar. Not collective."""
    plane = " in 2-D" if setup.geometry.gdim == 2 else ""
    about = TURBULENT if setup.is_averaged else LAMINAR
    yield about.format(flow=f"{setup.scene.flow.kind} flow", plane=plane)
    if transitional := transition(setup, setup.numbers, factor):
        yield transitional.text(" at the threshold")


def findings(stored: dict[str, Any]) -> tuple[str, list[tuple[str, Any]]] | None:
    """What a run says of its turbulence, apart from its quantities: a sentence, and rows of words and value."""
    if (walls := stored.get("turbulence")) is None:
        return None
    from ..results.wall_report import MOST_COARSE, longest

    spans, others = longest(walls["backward"])
    rows: list[tuple[str, Any]] = [
        ("reverse flow next to the bed from x, to x", tuple(span)) for span in spans
    ]
    rows += [("further, shorter intervals", others)] if others else []
    sentence = f"y+ of the walls is {walls['least']:.3g} to {walls['largest']:.3g}."
    if walls.get("judged_along") and (walls["coarse_along"] or 0.0) > MOST_COARSE:
        sentence += " Warning: cells along the walls do not resolve their friction."
    if not walls.get("converged", True):
        sentence += (
            f" Warning: not converged; loads are means, within {100 * walls['spread']:.2g}%."
        )
    return sentence, rows


def _doubts(setup: Setup) -> Iterator[str]:
    """What is to be known of the model and of the walls in a scene. Not collective."""
    walls, geometry = setup.walls, setup.geometry
    grain, bed, thick = geometry.grain, geometry.bed, walls.distance("body")
    if not walls.is_resolved and grain is not None:
        if (share := thick / grain.size) > THICK:
            yield (
                f"the grain has u* d/nu = {grain.size / walls.unit:.3g}: the layer that the law of the wall stands for "
                f"is {100 * share:.0f}% of it; it is thin up to {100 * THICK:.0f}%"
            )
        yield from _narrow_gap(setup)
        if geometry.gdim == 3:
            yield from _coarse(setup)
    if setup.turbulence.model == "k-epsilon" and grain is not None:
        yield (
            "the k-epsilon model is far from measured loads on smooth round bodies, by more than error bars tell: drag "
            "on a sphere on a bed a third too small, on a hump a quarter to two fifths of it, lift there a quarter to "
            "a third too large; another program with this model has 1.1 to 1.6 times the drag, 0.5 to 0.9 of the lift"
        )
    if 0.0 < walls.roughness < SMOOTH_TO * walls.unit:
        yield (
            f"the walls are hydraulically smooth, u* k_s/nu about {walls.roughness / walls.unit:.2g}: their roughness "
            "changes nothing"
        )
    if bed is not None and walls.roughness > SMALL * bed.feature:
        yield (
            f"the roughness of the bed, {walls.roughness:.3g}, is {100 * walls.roughness / bed.feature:.0f}% of the "
            f"smallest length of its forms, {bed.feature:.3g}: the model assumes that it is small compared with them, "
            f"as it is up to {100 * SMALL:.0f}%"
        )
    if grain is not None and walls.roughness > (gap := geometry.stance.gap):
        yield (
            f"the roughness of the bed, {walls.roughness:.3g}, is higher than the gap below the grain, {gap:.3g}: flow "
            "in the gap is not resolved, since the model assumes a roughness smaller than all meshed lengths"
        )
    if walls.is_resolved and cut_at_inflow(setup):
        yield (
            "the inflow cuts bedforms, next to which k may diverge, since the inflow profile has developed over "
            "a planar bed: put the grain farther downstream of the inflow"
        )
    if walls.is_laminar:
        yield (
            f"the inflow is laminar by the k-omega model, u* h/nu = {walls.depth / walls.unit:.3g}: k decays to "
            "nothing there, and loads are those of laminar flow"
        )


def _coarse(setup: Setup) -> Iterator[str]:
    """How few cells a 3-D grain has."""
    asked, walls = setup.scene.numerics.mesh_size, setup.walls
    size = WALL_CELL * coarsening(walls, setup.order.number) * walls.nearest * asked
    if (across := setup.geometry.grain.size / size) < FEWEST_ACROSS:
        yield (
            f"the grain is {across:.2g} cells across: with 3 of them drag was a fifth too large and a safety factor a "
            f"quarter off; use numerics.mesh_size = {asked * across / FEWEST_ACROSS:.2g} or less"
        )


def _narrow_gap(setup: Setup) -> Iterator[str]:
    """Warn of narrow gaps: the law of each wall ignores the other, and friction in the gap is too small."""
    body, placement = setup.scene.body, setup.geometry.placement
    if body is None or body.centre is None or body.moves or placement is None:
        return
    nearest, least = setup.surroundings.clearance(placement), 2.0 * setup.walls.distance("body")
    lid = setup.sides.top if setup.base_flow.flow.kind == "open-channel" else ""
    open_sides = (setup.sides.right, setup.sides.left, lid, *setup.sides.across)
    if nearest.other in open_sides or nearest.distance >= least:
        return
    yield (
        f"the grain is held {nearest.distance:.3g} from the {nearest.other}, twice the distance of the law of the wall "
        f"is {least:.3g}: flow in the gap is not resolved; hold it farther away, or let it touch by body.x"
    )
