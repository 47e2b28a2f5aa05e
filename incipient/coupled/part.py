"""Interface of moving parts (bodies and surfaces) solved together with the flow."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any, Protocol

from ..arrays import Floats

Stage = Callable[[str], AbstractContextManager[Any]]


class Part(Protocol):
    """Moving part of the fluid's boundary. Every method is collective.

    met: contact at the end of the last attempt. name, folded: in messages, the latter with a remedy.
    """

    met: bool
    name: str
    folded: str

    def join(self, follow: Callable[[], None]) -> None:
        """Enter a coupling; `follow` moves mesh and boundary values to the trial ends of all parts."""
        ...

    def predict(self, length: float, order: int) -> None:
        """Begin a step: extrapolate the trial end from past states."""
        ...

    def displacement(self) -> Floats:
        """Displacement (n, 3) of the mesh's nodes at the trial end."""
        ...

    def place(self) -> None: ...

    def residual(self, length: float, order: int) -> float:
        """Relative residual of the equation of motion under the flow's load; also computes the update.

        Raises ConvergenceError where a shorter step may help.
        """
        ...

    def correct(self) -> None:
        """Update the trial end, with the flow's linear response."""
        ...

    def allowed(self, length: float) -> float:
        """The length, or a shorter one after which the part makes contact."""
        ...

    def accept(self) -> None: ...

    def restore(self) -> None: ...

    def forget(self) -> None: ...

    def velocities(self) -> Floats:
        """Velocities (k,) at the trial end, whose error limits the steps."""
        ...
