"""The accuracy that a run was to reach, what was reached, and the meshes tried, as data."""

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Trial:
    """One mesh tried."""

    order: int
    cells: int
    unknowns: int
    # Relative error of the quantity asked for; None where the flow could not be solved, or not compared yet
    estimate: float | None
    seconds: float  # wall time, mesh, solution and estimate together
    step: float | None = None  # the time step, None for steady flow
    note: str = ""  # what was changed besides the mesh, or why there is no solution or no estimate
    of_step: float | None = (
        None  # what the time step contributes to the estimate; None for steady flow
    )
    of_mesh: float | None = None  # what the mesh contributes to it

    @property
    def parts(self) -> str:
        """What step and mesh contribute, in words; nothing for steady flow."""
        if self.of_step is None or self.of_mesh is None:
            return ""
        return f"of the step {self.of_step:.1e}, of the mesh {self.of_mesh:.1e}"


@dataclass(frozen=True)
class Adaptation:
    """The accuracy to reach, what has been reached, and the meshes tried on the way."""

    asked: float | str  # the relative error, or "verdict"
    of: str
    reached: float | None  # its estimate, None if there is none
    met: bool
    reason: str
    trials: tuple[Trial, ...]
    includes: tuple[str, ...] = ("discretisation",)  # the errors that are in it
    changes: tuple[str, ...] = ()  # what has been changed of the scene for it, in words
    # What is to be known of errors that are not in it, and what would make them smaller
    beside: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Plain data for result.json."""
        return asdict(self)

    def lines(self) -> list[str]:
        """The outcome and the trials, a line each."""
        reached = "unknown" if self.reached is None else f"{self.reached:.1e}"
        *others, last = self.includes
        of = f"{', '.join(others)} and {last}" if others else last
        lines = [
            f"accuracy            error of the {self.of} {reached} (of {of}), asked for {self.asked}: {self.reason}"
        ]
        lines += [f"{'':<20}{line}" for line in (*self.changes, *self.beside)]
        for trial in self.trials:
            error = "            " if trial.estimate is None else f"error {trial.estimate:.1e}"
            step = "" if trial.step is None else f"   step {trial.step:.3g}"
            beside = "   ".join(said for said in (trial.parts, trial.note) if said)
            lines.append(
                f"  P{trial.order:<17d}{trial.cells:6d} cells {trial.unknowns:7d} unknowns   {error}   "
                f"{trial.seconds:5.1f} s{step}   {beside}".rstrip()
            )
        return lines
