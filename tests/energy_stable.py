"""The form of convection and rate that cannot make kinetic energy: runs take the printed one, which is cheaper.

With it energies of coupled problems never grow, whatever the step; that shows that all else makes none either.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import ufl

from incipient.fluid import Fluid


class EnergyStable(Fluid):
    """A flow in the energy-stable form, on a mesh that is itself moved or stays."""

    def quadrature(self, cells: np.ndarray | None = None) -> Any:
        """With all orders of curvature: on moved meshes the integrands are no polynomials of the flow's degree."""
        return self.space.quadrature(cells)

    def carrier(self, v: Any) -> Any:
        """The velocity that convects less the volume swept by the mesh in unit time, at the rate of the difference."""
        carrier = super().carrier(v)
        pairs = zip(self.rate[1:], self._shifts, strict=False)
        return sum((a * (swept(shift) - shift) for a, shift in pairs), start=carrier)

    def _convection(self, v: Any, carrier: Any, w: Any) -> Any:
        """(1/2) [(c . grad v) . w - (c . grad w) . v]."""
        forth = ufl.inner(ufl.dot(ufl.grad(v), carrier), w)
        return (forth - ufl.inner(ufl.dot(ufl.grad(w), carrier), v)) / 2

    def residual_form(self, w: Any, q: Any, dx: Any = None, upwind: bool = True) -> Any:
        """Adds (1/2) (c . n) v . w where fluid, or its boundary values, cross the boundary: not on a free surface."""
        (v, _), n = ufl.split(self.state), ufl.FacetNormal(self.domain.mesh)
        surface = self.constraints.surface
        tags = [
            tag
            for name, tag in self.domain.names.items()
            if surface is None or name != surface.boundary
        ]
        ds = self.space.boundary_quadrature(self.domain.facets)(tuple(tags))
        through = ufl.dot(self.carrier(v), n) * ufl.inner(v, w) / 2 * ds
        return super().residual_form(w, q, dx, upwind) + through

    def _rate_of_change(self, v: Any) -> Any:
        """J dv/dt + (1/2) dJ/dt v: sum a_k J_k v_k - (1/2) (sum a_k J_k) v, J_k the volumes of past states."""
        velocities = [v, *(ufl.split(state)[0] for state in self.history)]
        volumes = [1, *map(volume_before, self._shifts)] if self._shifts else [1] * len(velocities)
        weights = [a * volume for a, volume in zip(self.rate, volumes, strict=True)]
        whole = sum(weight * u for weight, u in zip(weights, velocities, strict=True))
        return whole - sum(weights) / 2 * v


def volume_before(shift: Any) -> Any:
    """Volume that a unit of the mesh's present volume had before the mesh moved by `shift`: det(I - grad(shift))."""
    return ufl.det(ufl.Identity(len(shift)) - ufl.grad(shift))


def swept(shift: Any) -> Any:
    """Volume swept by the mesh per unit of its present surface while it moved by `shift` along straight lines.

    The mean of adj(I - s grad(shift)) . shift over s from 0 to 1, whose divergence is 1 - `volume_before`: adj is
    linear in two dimensions, where the midpoint is the mean, and quadratic in three, where Simpson's rule is.
    """
    G, identity = ufl.grad(shift), ufl.Identity(len(shift))
    middle = _adjugate(identity - G / 2)
    if len(shift) == 2:
        return ufl.dot(middle, shift)
    return ufl.dot(identity + 4 * middle + _adjugate(identity - G), shift) / 6


def _adjugate(a: Any) -> Any:
    """det(a) a^-1 without a division, by the theorem of Cayley and Hamilton."""
    identity, trace = ufl.Identity(a.ufl_shape[0]), ufl.tr(a)
    if a.ufl_shape[0] == 2:
        return trace * identity - a
    square = ufl.dot(a, a)
    return square - trace * a + (trace**2 - ufl.tr(square)) / 2 * identity
