"""Requested and estimated accuracy of a run, the meshes tried, and omitted effects."""

from dataclasses import dataclass

from ..arrays import Floats
from ..planning.effects import percent
from .quantity import labelled


@dataclass(frozen=True)
class Trial:
    """One mesh tried.

    estimate: relative error of the quantity; None: not converged, or not compared yet
    step: None for steady flow; of_step, of_mesh: contributions to the estimate
    note: changes besides the mesh, or the reason for a missing estimate
    """

    order: int
    cells: int
    unknowns: int
    estimate: float | None
    seconds: float
    step: float | None = None
    note: str = ""
    of_step: float | None = None
    of_mesh: float | None = None

    def line(self) -> str:
        error = "            " if self.estimate is None else f"error {self.estimate:.1e}"
        step = "" if self.step is None else f"   step {self.step:.3g}"
        parts = ""
        if self.of_step is not None and self.of_mesh is not None:
            parts = f"of the step {self.of_step:.1e}, of the mesh {self.of_mesh:.1e}"
        notes = "   ".join(filter(None, (parts, self.note)))
        size = f"  P{self.order:<17d}{self.cells:6d} cells {self.unknowns:7d} unknowns"
        return f"{size}   {error}   {self.seconds:5.1f} s{step}   {notes}".rstrip()


@dataclass(frozen=True)
class Adaptation:
    """Requested accuracy, its estimate, and the meshes tried.

    asked: relative error, or "verdict"; reached: its estimate, or None
    includes: the errors included; changes: of the scene
    """

    asked: float | str
    of: str
    reached: float | None
    met: bool
    reason: str
    trials: tuple[Trial, ...]
    includes: tuple[str, ...] = ("discretisation",)
    changes: tuple[str, ...] = ()

    def lines(self) -> list[str]:
        reached = "unknown" if self.reached is None else f"{self.reached:.1e}"
        *others, last = self.includes
        of = f"{', '.join(others)} and {last}" if others else last
        said = f"error of the {self.of} {reached} (of {of}), requested {self.asked}: {self.reason}"
        lines = labelled("accuracy", said, *self.changes)
        return lines + [trial.line() for trial in self.trials]


@dataclass(frozen=True)
class Omission:
    """An omitted effect.

    relative: change relative to the load, or None; force, torque: change (3,), or None
    exceeds: whether the change may exceed the requested accuracy
    """

    name: str
    relative: float | None
    how: str
    exceeds: bool
    remedy: str = ""
    force: Floats | None = None
    torque: Floats | None = None

    def lines(self) -> list[str]:
        """The omission as a line of text, and a warning if it exceeds the accuracy."""
        about = "an unknown amount" if self.relative is None else f"about {percent(self.relative)}"
        lines = labelled(
            "left out", f"{self.name}: would change the result by {about} ({self.how})"
        )
        if not self.exceeds:
            return lines
        warning = f"{self.name} may matter at the requested accuracy: {self.remedy}"
        return lines + labelled("WARNING", warning)
