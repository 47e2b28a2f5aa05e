"""Turbulence of the flow, by a model of its means."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from ...planning.effects import Decision, EffectName
from ...planning.flow_setup import Setup
from ...planning.numbers import Numbers
from ...results.left_out import Omission
from ...results.quantity import OutputQuantity, at
from ..effect import Effect, SlowestFlow, Solved
from ..run_part import RunPart, Stage
from .transition import REMEDY, transition, turbulent_from

if TYPE_CHECKING:
    from ...mesh.domain import Domain


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
    "in mean turbulent flow over one grain{plane}, tau_b {stress}; gusts move it sooner, see "
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


# That walls are as the model asks, and that they are not.
BY_LAW = "the law of the wall holds", "the law of the wall does NOT hold"
RESOLVED = "the walls are resolved", "the walls are NOT resolved"


def _model_of(setup: Setup) -> Any:
    """The model that a scene asks for, a `models.TurbulenceModel`."""
    from .models import MODELS

    return MODELS[setup.turbulence.model]


class TurbulenceEffect(Effect):
    """A model of the mean flow."""

    name = EffectName.TURBULENCE
    quantities = (
        *(
            OutputQuantity(f"turbulence.{key}", words, "", column, error, ends, "at the walls")
            for key, words, column, error, ends in AT_WALLS
        ),
        OutputQuantity(
            "turbulence.applicable", "the walls are as the model asks", column="applicable"
        ),
        OutputQuantity("turbulence.spread", "spread of the loads", column="load_spread"),
    )

    def decide(self, setup: Setup, numbers: Numbers) -> Decision:
        """Present where the scene asks for it; else the plan says where the flow may be turbulent."""
        scene = setup.scene
        if scene.is_averaged:
            told = _model_of(setup).text(setup)
            return Decision(self.name, True, f"effects.turbulence = true: {told}", True)
        off = scene.effects.turbulence is False
        reason = "effects.turbulence = false" if off else "only with effects.turbulence = true"
        if scene.flow.kind == "log-law":
            reason += f"; mean profile only, the bed is {setup.base_flow.mean_profile.regime()}"
            if numbers.flow_reynolds < (least := turbulent_from(scene.flow.kind)):
                reason += (
                    f"; flow Re {numbers.flow_reynolds:.3g}, but channels are laminar to {least:g}"
                )
        elif found := transition(setup, numbers):
            reason += f"; {found.text()}; {REMEDY}"
        return Decision(self.name, False, reason, off)

    def warnings(self, setup: Setup) -> Iterator[str]:
        """What the model says; where it is not for the scene it raises."""
        if setup.is_averaged:
            yield from _model_of(setup).warnings(setup)

    def part_at_start(self, setup: Setup, domain: Domain, stage: Stage) -> RunPart | None:
        """Both quantities of the model."""
        return _model_of(setup).flow()(setup, domain, stage) if setup.is_averaged else None

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
        elif numbers is not None and (found := transition(Setup(scene), numbers)):
            how = f"{found.number} {found.value:.4g} is above {found.least:g}"
            yield Omission(
                self.name, None, how, True, f"the flow computed is the laminar one; {REMEDY}"
            )


def slowest_flow(setup: Setup) -> SlowestFlow | None:
    """The slowest flow that the model of a scene is for; None: the flow is laminar. Not collective."""
    return _model_of(setup).slowest_flow(setup) if setup.is_averaged else None


def threshold_needs(setup: Setup) -> Iterator[str]:
    """What the scene lacks for its critical flow to be sought with the model, in words. Not collective."""
    if setup.is_averaged:
        yield from _model_of(setup).threshold_needs(setup)


def threshold_notes(setup: Setup, factor: float) -> Iterator[str]:
    """What flow a threshold, so many times the scene's, is for, and whether that can be laminar. Not collective."""
    plane = " in 2-D" if setup.geometry.gdim == 2 else ""
    about = TURBULENT if setup.is_averaged else LAMINAR
    stress = "of the inflow" if setup.resolves_walls else "by the law of the wall"
    yield about.format(stress=stress, flow=f"{setup.scene.flow.kind} flow", plane=plane)
    if found := transition(setup, setup.numbers, factor):
        yield found.text(" at the threshold")


def findings(stored: dict[str, Any]) -> tuple[str, list[tuple[str, Any]]] | None:
    """What a run says of its turbulence, apart from its quantities: a sentence, and rows of words and value."""
    if (found := stored.get("turbulence")) is None:
        return None
    from ...results.wall_report import longest

    # Results of earlier versions have no remedy.
    remedy = found.get(
        "remedy", f"give turbulence.wall_distance = {found['suitable_distance']:.3g}"
    )
    # Results of earlier versions have no model.
    resolved = found.get("model") == "k-omega-sst"
    holds, fails = RESOLVED if resolved else BY_LAW
    doubt = f"Warning: {fails}; {remedy}."
    told, others = longest(found["backward"])
    upstream = "reverse flow next to the bed from x, to x"
    rows: list[tuple[str, Any]] = [(upstream, tuple(one)) for one in told]
    if not found["plane"]:
        rows.insert(
            0,
            (f"fraction of the walls at which {fails.replace('NOT', 'not')}", found["outside"]),
        )
    rows += [("further, shorter intervals", others)] if others else []
    sentence = f"{holds[0].upper()}{holds[1:]}." if found["applicable"] else doubt
    if not found.get("converged", True):
        sentence += (
            f" Warning: not converged; loads are means, within {100 * found['spread']:.2g}%."
        )
    return sentence, rows
