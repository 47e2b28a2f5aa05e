"""The weakest gusts that move a grain out of its pocket, by their duration.

A gust of given duration is made stronger until the grain, released, leaves its pocket; then the strength is bisected.
A shorter gust has to be at least as strong as a longer one, so strengths that a grain withstood carry over. What cells
and steps change is the difference to the same search on coarser cells with longer steps.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from ..errors import SceneError
from ..parallel import Comm
from ..progress import Silent
from ..scene import Scene
from ..scene.flows import Flow
from ..scene.gust import Gust
from ..scene.kinds import Bed, Body
from ..simulation.recorder import Recorder
from ..simulation.simulate import simulate
from .gust_bracket import STRONGER, WITHIN
from .threshold import find_threshold

STRONGEST = 1e3
STEPS_IN_GUST = 20  # at least
COARSER_CELLS, LONGER_STEPS = math.sqrt(2.0), 2.0


@dataclass(frozen=True)
class CriticalGust:
    """The critical strength for one duration.

    duration: of the gust [time]; shape: of its course
    held, leaves: strengths between which the critical one lies: the grain stays, the grain leaves
    strength: their geometric mean; error: of it, the bracket and what coarser cells and longer steps change; None:
        the latter was not found
    runs: simulations that it took
    """

    duration: float
    shape: str
    held: float
    leaves: float
    error: float | None
    runs: int

    @property
    def strength(self) -> float:
        """The critical strength."""
        return math.sqrt(self.held * self.leaves)

    def line(self) -> str:
        """Duration and strength for a reader."""
        error = "not known" if self.error is None else f"{self.error:.2g}"
        return f"gust of {self.duration:<10.4g} strength {self.strength:.4g} +- {error} in {self.runs} runs"

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        impulse = (self.strength - 1.0) * self.duration * (1.0 if self.shape == "top-hat" else 0.5)
        return {
            "duration": self.duration,
            "strength": self.strength,
            **asdict(self),
            "impulse": impulse,
        }


@dataclass
class GustSearch:
    """The weakest gusts that move a scene's released grain out of its pocket.

    scene: shape and start of the gusts are those of its [flow.gust]
    voice: told of every run
    longer: time steps over those of the scene
    runs: simulations so far

    Raises SceneError for a scene without a released grain in a pocket, or without gusts of a duration.
    """

    scene: Scene
    comm: Comm
    voice: Silent = field(default_factory=Silent)
    longer: float = 1.0
    runs: int = 0

    def __post_init__(self) -> None:
        missing = _missing(self.scene.body, self.scene.bed, self.scene.flow)
        for why in (*filter(None, [self.scene.no_gusts]), *missing):
            raise SceneError(why)

    def static_strength(self) -> float:
        """How many times faster the flow is when, steady, it begins to move the grain. Collective."""
        plain = self._plain()
        motion = ("kinetic_friction", "restitution", "rolling_resistance")
        plain["body"]["motion"] = "fixed"
        plain["contact"] = {
            key: value for key, value in plain["contact"].items() if key not in motion
        }
        plain["flow"].pop("gust", None)
        return find_threshold(Scene(**{**plain, "time": None}), self.comm, self.voice).factor

    def critical(
        self,
        durations: Sequence[float],
        keep: Callable[[CriticalGust], object] = lambda found: None,
    ) -> list[CriticalGust]:
        """Find the critical strength for each duration, the longest first. Collective.

        `keep` is given each as soon as it is found. Raises SceneError where the grain leaves without a gust or
        withstands all, and IncipientError where a run fails.
        """
        require_durations(durations)
        if self.leaves(1.0, min(durations)):
            raise SceneError(
                "body.motion: the grain leaves its pocket without a gust; use a slower flow"
            )
        coarse = self._coarser() if self.scene.numerics.error_bars else None
        found, held, nearby = [], 1.0, 1.0
        for duration in sorted(durations, reverse=True):
            before = self._runs_with(coarse)
            held, leaves = self.bracket(duration, held, STRONGER * held)
            error = None
            if coarse is not None:
                nearby, high = coarse.bracket(duration, nearby, STRONGER * max(nearby, held))
                change = abs(math.sqrt(nearby * high) - math.sqrt(held * leaves))
                error = 0.5 * (leaves - held) + change
            runs = self._runs_with(coarse) - before
            found.append(
                CriticalGust(duration, self._course(duration)["shape"], held, leaves, error, runs)
            )
            keep(found[-1])
        return found

    def of_scene(self) -> CriticalGust:
        """The critical strength for the duration of the scene's own gust. Collective; raises as `critical`."""
        gust = getattr(self.scene.flow, "gust", None)
        if gust is None:
            raise SceneError(
                "flow.gust: is missing; give the duration for which a strength is searched"
            )
        return self.critical([gust.duration])[0]

    def bracket(self, duration: float, held: float, leaves: float) -> tuple[float, float]:
        """Strengths, close to each other, of which the grain withstands the first. Collective."""
        while not self.leaves(leaves, duration):
            held, leaves = leaves, STRONGER * leaves
            if leaves > STRONGEST:
                why = f"up to {STRONGEST:g} times the flow moves the grain out of its pocket"
                remedy = "use longer ones or a lighter grain"
                raise SceneError(f"no gust of duration {duration:g} {why}; {remedy}")
        while leaves > (1.0 + WITHIN) * held:
            middle = math.sqrt(held * leaves)
            held, leaves = (held, middle) if self.leaves(middle, duration) else (middle, leaves)
        return held, leaves

    def leaves(self, strength: float, duration: float) -> bool:
        """Whether the grain leaves its pocket in a gust. Collective."""
        self.runs += 1
        result = simulate(self._in_gust(strength, duration), self.comm, Recorder())
        assert result.trajectory is not None
        left = result.trajectory["on_bed"]["left_pocket"] is not None
        self.voice.say(
            f"gust of {duration:g} and strength {strength:.4g}: {'leaves' if left else 'stays'}"
        )
        return left

    def _plain(self) -> dict[str, Any]:
        """The scene in plain data, without error bars and output."""
        plain = self.scene.model_dump(exclude_unset=True)
        plain["numerics"] = {**plain.get("numerics", {}), "error_bars": False}
        return {**plain, "output": {"fields": False, "pictures": False}}

    def _course(self, duration: float) -> dict[str, Any]:
        """Shape, start and rise of the gusts; the rise is the share of the duration that it is in the scene."""
        gust = getattr(self.scene.flow, "gust", None) or Gust()
        found = {"shape": gust.shape, "start": gust.start}
        return (
            found if gust.rise is None else found | {"rise": gust.rise / gust.duration * duration}
        )

    def _in_gust(self, strength: float, duration: float) -> Scene:
        plain, time = self._plain(), self.scene.time
        assert time is not None
        gust = Gust(**self._course(duration), duration=duration, strength=strength)
        plain["flow"]["gust"] = gust.model_dump(exclude_unset=True)
        end, step = float(gust.knots().max()) + time.end, min(time.step, duration / STEPS_IN_GUST)
        plain["time"] |= {"until": "out-of-pocket", "end": end, "step": self.longer * step}
        return Scene(**plain)

    def _coarser(self) -> GustSearch:
        """The search on coarser cells with longer steps."""
        plain = self._plain()
        plain["numerics"]["mesh_size"] = COARSER_CELLS * self.scene.numerics.mesh_size
        return GustSearch(Scene(**plain), self.comm, self.voice, LONGER_STEPS * self.longer)

    def _runs_with(self, coarse: GustSearch | None) -> int:
        return self.runs + (0 if coarse is None else coarse.runs)


def require_durations(durations: Sequence[float]) -> None:
    """Raise SceneError unless there are durations, all of them positive numbers."""
    if not durations or not all(0.0 < one < math.inf for one in durations):
        raise SceneError("durations: give one or more, each a number above zero")


def _missing(body: Body | None, bed: Bed | None, flow: Flow) -> Iterator[str]:
    """What keeps gusts from being found."""
    if body is None or body.motion != "released":
        yield 'body.motion: gusts are found for a grain that rests on its bed; use "released"'
    if bed is None or bed.kind == "flat":
        yield "bed.kind: a flat bed has no pocket to leave; use a bed with forms"
    if not hasattr(flow, "gust"):
        yield f'flow.kind: "{flow.kind}" has no gusts; use "shear" or another profile'
    elif flow.gust is not None and flow.gust.shape == "points":
        yield 'flow.gust.shape: "points" has no duration to vary; use "top-hat" or "cosine"'
