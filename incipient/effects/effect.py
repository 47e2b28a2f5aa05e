"""The face of a physical effect: all that planning, runs and results ask of one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..planning.effects import Decision, EffectName
from ..planning.flow_setup import Setup
from ..planning.linear import Method
from ..planning.numbers import Numbers
from ..planning.plan import Plan
from ..results.left_out import Omission
from ..results.loads import Couples, Forces
from ..results.quantity import OutputQuantity
from .run_part import RunPart, Solving, Stage

if TYPE_CHECKING:
    from ..fluid import FlowModel
    from ..mesh.domain import Domain
    from ..restart.checkpoint import Checkpoint


@dataclass(frozen=True, eq=False)
class Solved:
    """A computed flow of which effects were left out: loads and verdict are None where there are none."""

    run: Solving
    force: Forces | None
    couple: Couples | None
    verdict: dict[str, Any] | None


@dataclass(frozen=True)
class SlowestFlow:
    """The slowest flow in which an effect can be simulated in a scene.

    factor: of the scene's flow; why: what makes it the slowest, after its name; remedy: where a slower one is needed
    start: factor of the flow that a search begins with where it holds the grain; 0: with the slowest one
    expected: what a search takes, said before it
    """

    factor: float
    why: str
    remedy: str
    start: float = 0.0
    expected: str = ""


@dataclass(frozen=True)
class Findings:
    """What a run says of an effect on a page: a title, a sentence, and a table under a heading.

    The table has the quantities with that heading, then rows of words and value.
    """

    title: str
    sentence: str
    heading: str
    rows: tuple[tuple[str, Any], ...]


class Effect:
    """One physical effect. The methods here are those of an effect that needs none of them.

    Everything else walks `known.EFFECTS` and asks. What one effect alone needs is imported where it is present.

    Attributes:
        quantities: numbers that a run's outcome has where the effect is present; history, result, text, page and tables
            walk them.
    """

    name: EffectName
    quantities: tuple[OutputQuantity, ...] = ()

    def decide(self, setup: Setup, numbers: Numbers) -> Decision:
        """Whether the scene calls for the effect, and the reason. Not collective."""
        raise NotImplementedError

    def terms(self, model: FlowModel, setup: Setup, plan: Plan, unsteady: bool) -> FlowModel:
        """The model of the flow with the effect's terms, for a plan that has the effect. Not collective.

        `unsteady` tells a flow in time from the steady one that it may start from.
        """
        return model

    def linear_method(self, setup: Setup, unsteady: bool) -> Method | None:
        """The method for the linear systems of a flow with the effect; None: the one without it. Not collective."""
        return None

    def warnings(self, setup: Setup) -> Iterator[str]:
        """What in the scene makes the result less sure where the effect is present, in words. Not collective.

        Raises:
            SceneError: the effect cannot be simulated in the scene.
        """
        return iter(())

    def as_fast(self, setup: Setup, speed: float) -> Setup:
        """The setup that a mesh is made for if the flow is faster by a factor. Not collective."""
        return setup

    def slowest_flow(self, setup: Setup) -> SlowestFlow | None:
        """The slowest flow in which the effect, if it is present, can be simulated; None: any. Not collective."""
        return None

    def threshold_needs(self, setup: Setup) -> Iterator[str]:
        """What the scene lacks for its critical flow to be sought with the effect, in words. Not collective."""
        return iter(())

    def threshold_notes(self, setup: Setup, factor: float) -> Iterator[str]:
        """What is to be known of the critical flow, so many times the scene's, in words. Not collective."""
        return iter(())

    def part_at_start(self, setup: Setup, domain: Domain, stage: Stage) -> RunPart | None:
        """Unknowns that a steady flow, too, is solved together with, before its fluid is made. Collective."""
        return None

    def part_in_time(self, setup: Setup, stage: Stage, kept: Checkpoint | None) -> RunPart | None:
        """Unknowns that a flow in time moves its mesh with, at the start or as a checkpoint has them. Collective."""
        return None

    def memory(self, setup: Setup, unknowns: int) -> float:
        """MiB that the effect adds to a flow with so many unknowns. Not collective."""
        return 0.0

    def findings(self, stored: dict[str, Any]) -> Findings | None:
        """The entry of result.json for the effect, apart from its quantities; None: none. Not collective."""
        return None

    def left_out(self, solved: Solved, decision: Decision) -> Iterator[Omission]:
        """What the effect, which the plan has decided to leave out, would have changed. Collective."""
        return iter(())
