"""An omitted effect and its estimated change."""

from dataclasses import dataclass

from ..arrays import Floats
from ..planning.effects import percent


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
        size = "by an unknown amount"
        if self.relative is not None:
            size = f"by about {percent(self.relative)}"
        lines = [f"left out            {self.name}: would change the result {size} ({self.how})"]
        if self.exceeds:
            lines.append(
                f"WARNING             {self.name} may matter at the requested accuracy: {self.remedy}"
            )
        return lines
