"""An omitted effect and the change that it would make, as data."""

from dataclasses import dataclass

from ..arrays import Floats
from ..planning.effects import percent


@dataclass(frozen=True)
class Omission:
    """An omitted effect.

    relative: change that it would make, relative to the load; None: not known
    exceeds: whether the change may exceed the requested accuracy
    force, torque: change of the force and the torque (3,); None: not known
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
