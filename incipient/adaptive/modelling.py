"""The errors that no mesh makes smaller, of gap and domain, in a search for an accuracy.

With `numerics.accuracy_includes = "all"` gap and domain are changed until both errors are small beside the accuracy;
the mesh is sought after that. Otherwise they are as the scene says, and it is said what would make them small enough.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from ..accuracy.coarse_runs import changed, coarse, farther
from ..accuracy.goal import Computed, LoadsOnMesh, Quantity, relative
from ..accuracy.kept_runs import Solve
from ..accuracy.model_terms import DECAY, has_no_far_sides, not_there, of_domain, of_the_model
from ..arrays import spatial
from ..errors import IncipientError, SceneError
from ..results.errorbars import ErrorBars, Loads, Term
from ..results.loads import Couples, Forces
from ..scene import Domain, Scene
from ..scene.flows import Flow
from ..simulation.loads import weights

SHARE = 0.5  # of the accuracy, for gap and domain together
AIM = 0.7  # of a term's part of it, so that the gap or domain expected to have it does
MOST_STEPS = 6
SMALLEST_GAP = 1e-4  # of the grain's size
CLOSEST, FARTHEST = 1 / 32, 3.0  # how much smaller a gap and larger a domain become at once
# A stream that enters at another height than its bed calls for adapts more slowly: what the bed changes spreads to
# a height that grows as the cube root of the way (Leveque 1928), and the stress on the bed errs as its inverse.
SLOW_DECAY = 1.0 / 3.0
LEAST = 1e-3  # to which part a term is sought to be lessened, at most


@dataclass(frozen=True)
class Suited:
    """A scene with the gap and domain that an accuracy calls for.

    terms: their errors, as they are now; `error` is their sum, relative, infinite where they are not known
    unmet: why they are not small enough, or nothing; errors: what each term comes to by name, relative
    plain: the same without corrections
    """

    scene: Scene
    terms: tuple[Term, ...] = ()
    error: float = np.inf
    unmet: str = ""
    errors: dict[str, float] = field(default_factory=dict)
    plain: dict[str, float] = field(default_factory=dict)

    def changes(self, asked: Scene) -> tuple[str, ...]:
        """Differences from the scene that was requested, in words."""
        found, now, before = [], self.scene.contact, asked.contact
        if now is not None and before is not None and now != before:
            found.append(f"contact.gap = {now.gap:.3g} in place of {before.gap:.3g}")
        if self.scene.domain != asked.domain:
            found.append(f"{_words(self.scene.domain)} in place of {_words(asked.domain)}")
        return tuple(found)


def suited(
    scene: Scene, asked: float, goal: Quantity, solve: Solve, report: Callable[[str], None]
) -> Suited:
    """Choose gap and domain whose errors together are half of the relative error requested. Collective.

    What has been found so far is kept where a coarse run fails, or the budget is spent. The search ends where the
    domain's error does not fall as it is expected to: it is then larger than it seemed, and no larger domain helps.
    """
    found = Suited(scene)
    for _ in range(MOST_STEPS):
        try:
            before, found = found, _looked_at(scene, goal, solve)
            errors = found.errors
            if _hardly_falls(before, found):
                return _ended(before, found, goal, solve)
            if _is_noise(before, found):
                return replace(before, unmet="the error of the gap does not fall as the gap closes")
            if found.error <= SHARE * asked:
                return found
            parts = [f"error of the {name} {error:.1e}" for name, error in errors.items()]
            report("; ".join([_words(scene.domain), *parts]))
            scene = _improved(found, SHARE * asked / len(errors))
        except IncipientError as error:
            return replace(
                found, unmet=f"errors of gap and domain are not known beyond that: {error}"
            )
        if scene is found.scene:
            largest = max(errors, key=lambda name: errors[name])
            remedy = f"; {_of_datum(scene.flow)}" if largest == "datum" else ""
            unmet = (
                f"the error of the {largest}, {errors[largest]:.1e}, cannot be made smaller{remedy}"
            )
            return replace(found, unmet=unmet)
    return replace(found, unmet=f"gap and domain err too much after {MOST_STEPS} steps")


def _looked_at(scene: Scene, goal: Quantity, solve: Solve, decay: float | None = None) -> Suited:
    """A scene with its terms, the domain's error decaying with a power of its size. Collective."""
    estimates = of_the_model(scene)
    if not estimates:
        return Suited(scene, (), 0.0)
    if decay is not None:
        estimates["domain"] = partial(of_domain, scene, decay=decay)
    terms = tuple(estimate(solve) for estimate in estimates.values())
    found = _computed(scene, solve(coarse(scene)))
    both = terms, [term.uncorrected for term in terms]
    errors, plain = (
        {term.name: relative(goal, found, term) or 0.0 for term in which} for which in both
    )
    return Suited(scene, terms, sum(errors.values()), errors=errors, plain=plain)


def _hardly_falls(before: Suited, found: Suited) -> bool:
    """Whether a larger domain has less than half the power of its size in its error that the estimate supposes.

    The gap's power is measured anew with each gap, so that it needs no such question.
    """
    larger = found.scene.domain.length / before.scene.domain.length
    if larger <= 1.0 or "domain" not in before.plain or found.errors["domain"] <= 0.0:
        return False
    return found.plain["domain"] > before.plain["domain"] * larger ** (-0.5 * DECAY)


def _is_noise(before: Suited, found: Suited) -> bool:
    """Whether a smaller gap in the same domain has no less of an error: that of the coarse runs' meshes is left."""
    gaps = [one.errors.get("gap", 0.0) for one in (before, found)]
    alike = found.scene.domain == before.scene.domain and found.scene is not before.scene
    return alike and gaps[1] >= gaps[0] > 0.0


def _ended(before: Suited, found: Suited, goal: Quantity, solve: Solve) -> Suited:
    """The better of the last two scenes, with the domain's error by the law of one that hardly falls. Collective."""
    slowly = [_looked_at(one.scene, goal, solve, SLOW_DECAY) for one in (before, found)]
    best = min(slowly, key=lambda one: one.error)
    unmet = (
        f"the error of the domain, {best.errors['domain']:.1e}, hardly falls as the domain grows"
    )
    return replace(best, unmet=unmet)


def _improved(found: Suited, part: float) -> Scene:
    """The scene with less of each term that is more than its part of the accuracy; the same where none can be less."""
    scene = found.scene
    for term in found.terms:
        if (error := found.errors[term.name]) > part:
            scene = _lessened(scene, term, AIM * part / error) or scene
    return scene


def not_estimated(scene: Scene) -> str:
    """Reason why the error of gap or domain cannot be estimated, or "". Not collective."""
    for name, reason in not_there(scene).items():
        if reason.startswith("not estimated"):
            return f"that of the {name} is {reason}"
    return ""


def remedies(
    scene: Scene, asked: float, goal: Quantity, found: Computed, bars: ErrorBars
) -> tuple[str, ...]:
    """Remedies for errors of gap and domain that exceed the accuracy requested, in words. Not collective."""
    said = []
    for term in bars.terms:
        error = relative(goal, found, term)
        if term.name == "discretisation" or error is None or error <= asked:
            continue
        remedy = _remedy(scene, term, asked / error)
        said.append(f"beside it the error of the {term.name}, {error:.1e}; {remedy}")
    if said:
        said.append('numerics.accuracy_includes = "all" lets the run change gap and domain')
    return tuple(said)


def _remedy(scene: Scene, term: Term, relative: float) -> str:
    """Remedy that reduces a term to a share `relative` of it, in words."""
    if term.name == "datum":
        return _of_datum(scene.flow)
    better = None
    with suppress(SceneError):
        better = _lessened(scene, term, AIM * relative, at_once=False)
    if better is None:
        return "it cannot be made small enough"
    if term.name == "gap" and better.contact is not None:
        return f"contact.gap = {better.contact.gap:.2g} would do"
    domain = better.domain
    origin = f"domain.origin = [{domain.left:.4g}, {domain.bottom:.4g}]"
    keys = [origin, f"domain.length = {domain.length:.4g}"]
    if domain.height != scene.domain.height:
        keys.append(f"domain.height = {domain.height:.4g}")
    if better.surface is not None and better.surface != scene.surface:
        keys.append(f"surface.sponge = {better.surface.sponge:.4g}")
    return f"{', '.join(keys)} would do"


def _of_datum(flow: Flow) -> str:
    if getattr(flow, "datum", "auto") in ("auto", "effective"):
        return "with inertia the effective height of the bed is not known better"
    return 'flow.datum = "auto" has less of it'


def _lessened(scene: Scene, term: Term, relative: float, at_once: bool = True) -> Scene | None:
    """The scene in which a term is expected to be `relative` times what it is; None where that cannot be had.

    at_once: not all the way where that is far, since what is expected is then not worth much
    """
    relative = max(relative, LEAST)
    if term.name == "gap" and scene.contact is not None:
        smaller = relative ** (1.0 / term.power)
        before = scene.contact.gap
        gap = before * (max(smaller, CLOSEST) if at_once else smaller)
        if before <= SMALLEST_GAP or (gap < SMALLEST_GAP and not at_once):
            return None
        return changed(scene, contact={"gap": float(f"{max(gap, SMALLEST_GAP):.2g}")})
    if term.name == "gap":  # a section [contact] of its own would call for a verdict
        return None
    if term.name == "datum" or has_no_far_sides(scene):
        return None
    factor = float(np.ceil(10.0 * relative ** (-1.0 / DECAY))) / 10.0
    return farther(scene, min(factor, FARTHEST) if at_once else factor)


def _computed(scene: Scene, loads: Loads) -> LoadsOnMesh:
    """What a coarse run has computed, with the weight of the grain if there is one."""
    if scene.placement is None:
        return LoadsOnMesh(None, None, loads.elevations)
    force = Forces(loads.force, loads.force, *weights(scene))
    couple = Couples(loads.couple, loads.couple, spatial(scene.placement.centre))
    return LoadsOnMesh(force, couple, loads.elevations)


def _words(domain: Domain) -> str:
    extents = " x ".join(f"{one:.4g}" for one in domain.extents)
    return f"domain {extents} from ({', '.join(f'{one:.4g}' for one in domain.origin)})"
