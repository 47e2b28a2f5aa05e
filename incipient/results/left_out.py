"""An effect that was left out and what it would have changed, as data."""

from dataclasses import asdict, dataclass
from typing import Any

from ..arrays import Floats
from ..planning.effects import percent


@dataclass(frozen=True)
class Omission:
    """An effect left out."""

    name: str
    relative: float | None  # change that it would have made, relative to the load; None: not known
    how: str
    exceeds: bool  # whether it may be more than the accuracy asked for
    remedy: str = ""
    force: Floats | None = (
        None  # change of the force (3,), and `couple` (3,) of the torque; None: not known
    )
    couple: Floats | None = None

    def to_dict(self) -> dict[str, Any]:
        """Plain data for result.json."""
        return asdict(self)

    def lines(self) -> list[str]:
        """One line for a reader, and a warning where one is due."""
        size = (
            "by an unknown amount"
            if self.relative is None
            else f"by about {percent(self.relative)}"
        )
        told = [f"left out            {self.name}: would change the result {size} ({self.how})"]
        if self.exceeds:
            told.append(
                f"WARNING             {self.name} may matter at the accuracy asked for: {self.remedy}"
            )
        return told
