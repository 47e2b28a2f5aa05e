"""Iteration of fluid and moving parts in each step, on the parts' velocities."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import ClassVar

import numpy as np

from ..arrays import Floats
from ..errors import ConvergenceError
from ..fluid import Fluid
from ..fluid.derived import dissipation, kinetic_energy
from ..fluid.newton import NewtonReport
from ..fluid.transient import Interface, Stepped, TimeStep
from ..mesh.motion import MeshMotion, MeshQuality

# Tolerance of the flow relative to the residual of the body's equation.
SHARE = 1e-3
SLOW = (
    "the iteration of fluid and {parts} did not converge in {number} iterations: use a smaller time.step or a larger "
    "numerics.interface_tolerance"
)
# Updates of the body's velocities in a step after which the fluid's LU factorisation is renewed.
PATIENCE = 3


class Part(Stepped, ABC):
    """Moving part of the fluid's boundary. Every method is collective.

    name, folded: in messages, the latter with a remedy. follow: of the coupling, moves mesh and boundary values to the
    trial ends of all parts.
    """

    follow: Callable[[], None]
    name: ClassVar[str]
    folded: ClassVar[str]

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


class Coupling(Interface):
    """Moving parts in a fluid with a moving mesh (see `fluid.transient.Interface`). Every method is collective.

    Args:
        motion: mesh motion, at the parts' last states.
        tolerance: of the parts' equations of motion, relative to their loads; None: the step's.
    """

    parts: Sequence[Part]
    max_iterations = 12  # in a step, each of which reduces the residual by two orders or more

    def __init__(
        self,
        fluid: Fluid,
        parts: Sequence[Part],
        motion: MeshMotion,
        tolerance: float | None = 1e-9,
    ):
        super().__init__(fluid)
        self.parts, self.motion = tuple(parts), motion
        self.tolerance = tolerance
        self._order, self._first_residual = 0, 0.0
        for part in self.parts:
            part.follow = self._follow
        # Node positions (n, 3) at the last state and, if any, the previous one.
        self.places = [self._places()]
        self.quality = motion.quality()

    def attempt(
        self, length: float, order: int, tolerance: float, before: NewtonReport | None = None
    ) -> NewtonReport:
        """Iterate on the velocities of the parts at the end of a step.

        `before`: report of the same step, whose iteration continues because the flow has changed otherwise.
        """
        earlier = before.residuals if before else ()
        if not earlier:
            if order != self._order:
                # The LU factorisation of the other backward difference is a poor preconditioner.
                self.fluid.renew_factors()
            self._order = order
            for part in self.parts:
                part.predict(length, order)
        accepted = self.tolerance or tolerance
        sizes: list[float] = []
        # The last earlier residual belongs to the same velocities as the next one.
        residuals = list(earlier[:-1])
        failure = SLOW.format(
            number=self.max_iterations, parts=" and ".join(part.name for part in self.parts)
        )
        for iteration in range(self.max_iterations):
            self._follow()
            # Only the first solve of a step contracts as earlier first solves did.
            first = not earlier and iteration == 0
            last = (residuals or earlier or (self._first_residual,))[-1]
            # Each iteration reduces the residual by two orders or more.
            inner = float(np.clip(SHARE * last, 0.1 * accepted, 1e-5))
            flow = self.fluid.solve(inner, remember=first)
            sizes.extend(flow.corrections)
            if not flow.converged:
                failure = flow.failure
                break
            try:
                residuals.append(max(part.residual(length, order) for part in self.parts))
            except ConvergenceError as error:
                failure = str(error)
                break
            if residuals[-1] <= accepted:
                if self._folded():
                    break
                self._first_residual = residuals[0]
                if len(residuals) > PATIENCE:
                    self.fluid.renew_factors()
                return NewtonReport(True, tuple(sizes), flow.error, residuals=tuple(residuals))
            if not np.isfinite(residuals[-1]):
                break
            for part in self.parts:
                part.correct()
        super().forget()
        failure = self._folded() or failure
        return NewtonReport(
            False, tuple(sizes), np.inf, failure=failure, residuals=tuple(residuals)
        )

    def _folded(self) -> str:
        """Reason and remedy if a cell is folded, or ""."""
        self.quality = self.motion.quality()
        return "" if self.quality.worst > 0.0 else " or ".join(part.folded for part in self.parts)

    def accept(self, step: TimeStep) -> None:
        super().accept(step)
        self.places = [self.fluid.domain.mesh.geometry.x.copy(), *self.places[:1]]

    def restore(self) -> None:
        """Undo the present step: parts and mesh return to its start."""
        super().restore()
        self.fluid.move_mesh(self.places[0])

    def forget(self) -> None:
        self._first_residual = 0.0
        super().forget()

    def columns(self, report: NewtonReport) -> dict[str, float]:
        return {
            "interface": report.corrected,
            "interface_residual": report.residuals[-1],
            "mesh_quality": self.quality.worst,
            "energy_fluid": kinetic_energy(self.fluid),
            "dissipation": dissipation(self.fluid),
        }

    def quality_ahead(self, length: float, order: int) -> MeshQuality:
        for part in self.parts:
            part.predict(length, order)
        return self.motion.quality(self._places())

    def _places(self) -> Floats:
        return self.motion.places(*(part.displacement() for part in self.parts))

    def _follow(self) -> None:
        with self.fluid.stage("mesh motion"):
            self.fluid.move_mesh(self._places(), self.places[0], self.places[-1])
            for part in self.parts:
                part.place()
