"""The weakest gusts that move a grain out of its pocket, by their duration.

The critical strength, not lower for a shorter gust, is bracketed and bisected. The discretisation error is the
difference from the same search with coarser cells and longer steps.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from ..accuracy.coarse_runs import changed, on_coarser_mesh
from ..accuracy.run import run_scene
from ..errors import SceneError, refuse_broken
from ..parallel import Comm
from ..progress import Silent
from ..scene import Scene
from ..scene.flows import Gust
from .critical import find_threshold
from .outcome import Threshold

WITHIN = 0.02  # relative width of the bracket
STRONGER = 1.4  # factor by which a strength grows until the grain leaves
STRONGEST = 1e3
# Longest run after a gust, in `time.end`: close to the critical strength a grain leaves or sinks back slowly.
LONGEST = 16.0
QUIET: dict[str, dict[str, Any]] = {
    "numerics": {"error_bars": False},
    "output": {"fields": False, "pictures": False},
}
# Keys that only a motion in time reads, by section.
OF_MOTION = {
    "flow": ("gust",),
    "contact": ("kinetic_friction", "restitution", "rolling_resistance"),
    "effects": ("unsteadiness",),
    "numerics": ("convection", "interface_tolerance", "remesh_below"),
    "output": ("every", "checkpoint"),
}


@dataclass(frozen=True)
class CriticalGust:
    """The critical strength for one duration.

    held, leaves: bounds of the critical strength: the grain stays, and leaves
    error: of the strength, from bracket and discretisation; None: not estimated
    runs: number of simulations
    """

    duration: float
    shape: str
    held: float
    leaves: float
    error: float | None
    runs: int

    @property
    def strength(self) -> float:
        return math.sqrt(self.held * self.leaves)

    def line(self) -> str:
        error = "not known" if self.error is None else f"{self.error:.2g}"
        return f"gust of {self.duration:<10.4g} strength {self.strength:.4g} +- {error} in {self.runs} runs"

    def to_dict(self) -> dict[str, Any]:
        impulse = (self.strength - 1.0) * self.duration * (1.0 if self.shape == "top-hat" else 0.5)
        return {**asdict(self), "strength": self.strength, "impulse": impulse}


# Whether the grain leaves, by the time steps over those of the scene, the strength and the duration.
Trials = dict[tuple[float, float, float], bool]


@dataclass
class GustSearch:
    """Search for the weakest gusts, with shape and start of the scene's [flow.gust].

    longer: time steps over those of the scene; runs: simulations so far
    held: largest strength at which the grain stays, so far
    trials: finished runs, which are not repeated; keep: called after each further one

    Raises SceneError without a released grain in a pocket or without a gust.
    """

    scene: Scene
    comm: Comm
    voice: Silent = field(default_factory=Silent)
    longer: float = 1.0
    runs: int = 0
    held: float = 1.0
    trials: Trials = field(default_factory=dict)
    keep: Callable[[], object] = lambda: None

    def __post_init__(self) -> None:
        body, flow = self.scene.body, self.scene.flow
        self.gust = gust = getattr(flow, "gust", None)
        refuse_broken(
            (
                self.scene.is_averaged,
                "effects.turbulence: gusts are computed in laminar flow only; leave it out",
            ),
            (
                body is None or body.motion != "released",
                'body.motion: gusts are computed for a grain that rests on its bed; use "released"',
            ),
            (
                not self.scene.has_forms,
                "bed.kind: a flat bed has no pocket to leave; use a bed with bedforms",
            ),
            (
                not hasattr(flow, "gust"),
                f'flow.kind: "{flow.kind}" has no gusts; use "shear" or another profile',
            ),
            (
                self.scene.numerics.accuracy is not None,
                f"numerics.accuracy: gusts are searched to {WITHIN:.0%}; leave it out, and see their errors",
            ),
            (
                gust is not None and gust.shape == "points",
                'flow.gust.shape: "points" has no duration to vary; use "top-hat" or "cosine"',
            ),
        )

    def steady_threshold(self) -> Threshold:
        """The threshold of the steady flow. Collective; raises as `find_threshold`."""
        plain = {**self.scene.model_dump(exclude_unset=True), "time": None}
        plain["body"]["motion"] = "fixed"
        for section, keys in OF_MOTION.items():
            for key in keys:
                plain.get(section, {}).pop(key, None)
        scene = changed(Scene(**plain), **QUIET)
        return find_threshold(scene, self.comm, self.voice)

    def critical(self, durations: Sequence[float]) -> Iterator[CriticalGust]:
        """Find the critical strength for each duration, the longest first. Collective.

        Raises SceneError if the grain leaves without a gust or never, IncipientError if a run fails.
        """
        if self.leaves(1.0, min(durations)):
            raise SceneError(
                "body.motion: the grain leaves its pocket without a gust; use a slower flow"
            )
        scene, longer = on_coarser_mesh(self.scene), 2.0 * self.longer
        coarser = replace(self, scene=scene, longer=longer, runs=0, held=1.0)
        for duration in sorted(durations, reverse=True):
            gust = self.bracketed(duration, self.held, STRONGER * self.held)
            if self.scene.numerics.error_bars:
                other = coarser.bracketed(duration, gust.held, gust.leaves)
                brackets = 0.5 * (gust.leaves - gust.held + other.leaves - other.held)
                error = brackets + abs(other.strength - gust.strength)
                gust = replace(gust, error=error, runs=gust.runs + other.runs)
            self.voice.say(gust.line())
            yield gust

    def of_scene(self) -> CriticalGust:
        """The critical strength for the duration of the scene's gust. Collective; raises as `critical`."""
        if self.gust is None:
            raise SceneError(
                "flow.gust: is missing; give the duration for which a strength is searched"
            )
        return next(self.critical([self.gust.duration]))

    def bracketed(self, duration: float, held: float, leaves: float) -> CriticalGust:
        """The critical strength for a duration, expected between `held` and `leaves`."""
        began = self.runs
        while not self.leaves(leaves, duration):
            wider = min((leaves / held) ** 2, STRONGER)
            self.held = held = leaves
            leaves *= wider
            if leaves > STRONGEST:
                why = f"up to {STRONGEST:g} times the flow moves the grain out of its pocket"
                raise SceneError(
                    f"no gust of duration {duration:g} {why}; use longer ones or a lighter grain"
                )
        while held > self.held and self.leaves(held, duration):
            wider = min((leaves / held) ** 2, STRONGER)
            held, leaves = max(held / wider, self.held), held
        while leaves > (1.0 + WITHIN) * held:
            middle = math.sqrt(held * leaves)
            held, leaves = (held, middle) if self.leaves(middle, duration) else (middle, leaves)
        self.held, shape = held, (self.gust or Gust()).shape
        return CriticalGust(duration, shape, held, leaves, None, self.runs - began)

    def leaves(self, strength: float, duration: float) -> bool:
        """Whether the grain leaves its pocket, in a run until it has left or sunk back.

        Raises SceneError if it meets the end of the domain before, or does neither within the `LONGEST` run.
        """
        self.runs += 1
        trial = self.longer, strength, duration
        if trial not in self.trials:
            self.trials[trial] = self._run_until_decided(strength, duration)
            self.keep()
        return self.trials[trial]

    def _run_until_decided(self, strength: float, duration: float) -> bool:
        result = run_scene(self.in_gust(strength, duration), self.comm)
        assert result.trajectory is not None
        ended, gust = result.trajectory["ended"], f"of {duration:g} and strength {strength:.4g}"
        refuse_broken(
            (
                ended["by"] == "contact",
                f"domain: in a gust {gust} the grain meets the {ended['nearest']} before it leaves its pocket or sinks "
                "back; enlarge the domain",
            ),
            (
                ended["by"] == "time",
                f"time.end: in a gust {gust} the grain neither leaves its pocket nor sinks back until "
                f"t = {ended['time']:.4g}; use a later end",
            ),
        )
        left = ended["by"] == "out-of-pocket"
        does = "leaves" if left else "stays"
        self.voice.say(f"gust {gust}: {does}")
        return left

    def in_gust(self, strength: float, duration: float) -> Scene:
        time, own = self.scene.time, self.gust or Gust()
        assert time is not None
        rise = {} if own.rise is None else {"rise": own.rise / own.duration * duration}
        course: dict[str, Any] = {"shape": own.shape, "start": own.start, **rise}
        gust = Gust(**course, duration=duration, strength=strength)
        end, step = float(gust.knots().max()) + LONGEST * time.end, min(time.step, duration / 20)
        times = {"until": "out-of-pocket", "end": end, "step": self.longer * step}
        flow = {"gust": gust.model_dump(exclude_unset=True)}
        return changed(self.scene, flow=flow, time=times, **QUIET)
