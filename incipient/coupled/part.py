"""Interface of moving parts (bodies and surfaces) solved together with the flow."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any, ClassVar

import numpy as np

from ..arrays import Floats

Stage = Callable[[str], AbstractContextManager[Any]]


class Part(ABC):
    """Moving part of the fluid's boundary, here one that moves with the flow. Every method is collective.

    met: contact at the end of the last attempt. name, folded: in messages, the latter with a remedy.
    """

    met: bool = False
    name: ClassVar[str]
    folded: ClassVar[str]

    def join(self, follow: Callable[[], None]) -> None:
        """Enter a coupling; `follow` moves mesh and boundary values to the trial ends of all parts."""
        self._follow = follow

    @abstractmethod
    def predict(self, length: float, order: int) -> None:
        """Begin a step: extrapolate the trial end from past states."""

    @abstractmethod
    def displacement(self) -> Floats:
        """Displacement (n, 3) of the mesh's nodes at the trial end."""

    @abstractmethod
    def place(self) -> None: ...

    @abstractmethod
    def residual(self, length: float, order: int) -> float:
        """Relative residual of the equation of motion under the flow's load; also computes the update.

        Raises ConvergenceError where a shorter step may help.
        """

    @abstractmethod
    def correct(self) -> None:
        """Update the trial end, with the flow's linear response."""

    def allowed(self, length: float) -> float:
        """The length, or a shorter one after which the part makes contact."""
        return length

    @abstractmethod
    def accept(self) -> None: ...

    @abstractmethod
    def restore(self) -> None: ...

    def forget(self) -> None:  # noqa: B027 parts that reuse nothing
        """Discard what later steps reuse."""

    def velocities(self) -> Floats:
        """Velocities (k,) at the trial end, whose error limits the steps."""
        return np.empty(0)
