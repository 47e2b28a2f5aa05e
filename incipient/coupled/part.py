"""Interface of the moving parts that the coupling solves together with the flow: bodies and surfaces."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from ..arrays import Floats


class Part(Protocol):
    """One moving part of the fluid's boundary. It has a last state, and the trial end of a step.

    Every method is collective.

    met:    whether the part has met something at the end of the last attempt
    name:   what it is called in messages
    folded: what to say, with a remedy, where the mesh has folded over
    """

    met: bool
    name: str
    folded: str

    def join(self, follow: Callable[[], None]) -> None:
        """Enter a coupling; `follow` moves mesh and boundary values to the trial ends of all parts."""
        ...

    def predict(self, length: float, order: int) -> None:
        """Begin a step from the last state: extrapolate the trial end from the past states."""
        ...

    def displacement(self) -> Floats:
        """(n, 3) displacement of the mesh's nodes by the part at the trial end."""
        ...

    def place(self) -> None:
        """Set the velocity of the part's boundary at the trial end."""
        ...

    def residual(self, length: float, order: int) -> float:
        """The residual of the part's equation of motion under the flow's load, relative; also computes the update.

        Raises ConvergenceError where a shorter step may help.
        """
        ...

    def correct(self) -> None:
        """Try the updated end; the fluid's state responds linearly."""
        ...

    def allowed(self, length: float) -> float:
        """The length, or the shorter one after which the part meets something on its path."""
        ...

    def accept(self) -> None:
        """Make the trial end the last state."""
        ...

    def restore(self) -> None:
        """Go back to the last state."""
        ...

    def forget(self) -> None:
        """Discard the information of earlier steps on the iteration."""
        ...

    def velocities(self) -> Floats:
        """(k,) velocities at the trial end, whose error limits the steps."""
        ...
