"""Interface of the moving parts that the coupling solves together with the flow: bodies and surfaces."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from ..arrays import Floats


class Part(Protocol):
    """One moving part of the fluid's boundary. It has a last state, and the end of a step that is being tried.

    Every method is collective.

    met:    whether the part has met something at the end of the last attempt
    name:   what it is called in messages
    folded: what to say, with a remedy, where the mesh has folded over
    """

    met: bool
    name: str
    folded: str

    def join(self, follow: Callable[[], None]) -> None:
        """Enter a coupling; `follow` brings mesh and boundary values to where all parts are at the end tried."""
        ...

    def predict(self, length: float, order: int) -> None:
        """Begin a step from the last state: try the end that the states before suggest."""
        ...

    def displacement(self) -> Floats:
        """(n, 3) what the part adds to the places of the mesh's nodes at the end tried."""
        ...

    def place(self) -> None:
        """Give the part's boundary its velocity at the end tried."""
        ...

    def residual(self, length: float, order: int) -> float:
        """The residual of the part's equation of motion under the flow's load, relative; also finds the correction.

        Raises ConvergenceError where a shorter step may help.
        """
        ...

    def correct(self) -> None:
        """Try the corrected end; the fluid's state answers linearly."""
        ...

    def allowed(self, length: float) -> float:
        """The length, or the shorter one after which the part meets something on the way it has taken."""
        ...

    def accept(self) -> None:
        """The end tried is the last state now."""
        ...

    def restore(self) -> None:
        """Go back to the last state."""
        ...

    def forget(self) -> None:
        """Discard the information of earlier steps on the iteration."""
        ...

    def velocities(self) -> Floats:
        """(k,) velocities at the end tried, whose error limits the steps."""
        ...
