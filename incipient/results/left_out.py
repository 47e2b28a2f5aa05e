"""An omitted effect and its estimated change."""

from dataclasses import dataclass

from ..arrays import Floats
from ..planning.effects import percent
from .quantity import labelled


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
