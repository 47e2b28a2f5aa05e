"""An effect that was left out and what it would have changed, as data."""

from dataclasses import dataclass

from ..arrays import Floats
from ..planning.effects import percent


@dataclass(frozen=True)
class Omission:
    """An effect left out.

    relative: change that it would have made, relative to the load; None: not known
    exceeds: whether it may be more than the accuracy asked for
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
        """One line for a reader, and a warning where one is due."""
        size = "by an unknown amount"
        if self.relative is not None:
            size = f"by about {percent(self.relative)}"
        told = [f"left out            {self.name}: would change the result {size} ({self.how})"]
        if self.exceeds:
            told.append(
                f"WARNING             {self.name} may matter at the accuracy asked for: {self.remedy}"
            )
        return told
