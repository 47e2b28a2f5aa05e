"""Whether a flow in time became steady, as a part of the result."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Steadied:
    """How a run ended that was to end when its flow is steady."""

    reached: bool  # whether it was
    time: float  # at the end of the run
    change: float  # of the flow in the last step, relative, per unit of time
    asked: float  # the change at which the flow counts as steady

    def line(self) -> str:
        """The line for a reader."""
        if self.reached:
            return f"steady              at t = {self.time:.6g}, changing by {self.change:.1e} per unit of time"
        return (
            f"NOT steady          at t = {self.time:.6g}: it changes by {self.change:.1e} per unit of time, "
            f"{self.asked:.1e} is asked for: use a later time.end"
        )
