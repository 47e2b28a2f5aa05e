"""The reference description: x = X + d(X, t), and derivatives with respect to x taken on X.

Every function takes the map, or None for the identity. With None, neither F nor J enters the
expression, so a fixed domain does not pay for a moving one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import ufl


@dataclass(frozen=True)
class ReferenceMap:
    """The map x = X + d(X, t) of a reference domain, by its displacement and the mesh velocity dd/dt.

    Both are UFL vector expressions on the reference domain, in scene units. Source: Childs & Reddy
    (1999); F, J and v^mesh of equations (338) and (339).
    """

    displacement: Any
    velocity: Any

    @property
    def F(self) -> Any:
        """Deformation gradient I + grad d."""
        return ufl.Identity(len(self.displacement)) + ufl.grad(self.displacement)

    @property
    def J(self) -> Any:
        """Determinant of the deformation gradient."""
        return ufl.det(self.F)


def gradient(v: Any, reference_map: ReferenceMap | None) -> Any:
    """Spatial gradient: grad v, or grad(v) F^-1 on a reference domain."""
    if reference_map is None:
        return ufl.grad(v)
    return ufl.dot(ufl.grad(v), ufl.inv(reference_map.F))


def divergence(v: Any, reference_map: ReferenceMap | None) -> Any:
    """Spatial divergence: div v, or grad(v) : F^-T on a reference domain."""
    return ufl.div(v) if reference_map is None else ufl.tr(gradient(v, reference_map))


def laplacian(v: Any, reference_map: ReferenceMap | None) -> Any:
    """Spatial Laplacian of each component of v."""
    i, j = ufl.indices(2)
    return ufl.as_vector(gradient(gradient(v, reference_map), reference_map)[i, j, j], i)


def rate_of_strain(v: Any, reference_map: ReferenceMap | None) -> Any:
    """D = sym(grad(v) F^-1)."""
    return ufl.sym(gradient(v, reference_map))


def weighted(expression: Any, reference_map: ReferenceMap | None) -> Any:
    """The expression times J, the spatial volume of a unit of reference volume."""
    return expression if reference_map is None else reference_map.J * expression


def surface_vector(n: Any, reference_map: ReferenceMap | None) -> Any:
    """Spatial normal times the spatial area of a unit of reference area: n, or J F^-T N (Nanson)."""
    if reference_map is None:
        return n
    return reference_map.J * ufl.dot(ufl.inv(reference_map.F).T, n)


def rigid_velocity(velocity: Any, spin: Any, arm: Any) -> Any:
    """Velocity of a rigid body at an arm from its centre; the spin has one component in the plane, three in space."""
    if len(arm) == 2:
        return velocity + spin[0] * ufl.perp(arm)
    return velocity + ufl.cross(spin, arm)


def swept(shift: Any) -> Any:
    """Volume swept by the mesh per unit of its present surface while it moved by `shift` along straight lines.

    The mean of adj(I - s grad(shift)) . shift over s from 0 to 1, on the mesh after the motion. Its divergence
    is 1 - `volume_before` exactly: the geometric conservation law. adj is linear in its argument in two
    dimensions, where the midpoint is the mean, and quadratic in three, where Simpson's rule is.
    """
    G, identity = ufl.grad(shift), ufl.Identity(len(shift))
    middle = _adjugate(identity - G / 2)
    if len(shift) == 2:
        return ufl.dot(middle, shift)
    return ufl.dot(identity + 4 * middle + _adjugate(identity - G), shift) / 6


def volume_before(shift: Any) -> Any:
    """Volume that a unit of the mesh's present volume had before the mesh moved by `shift`: det(I - grad(shift))."""
    return ufl.det(ufl.Identity(len(shift)) - ufl.grad(shift))


def _adjugate(a: Any) -> Any:
    """det(a) a^-1 without a division, by the theorem of Cayley and Hamilton."""
    identity, trace = ufl.Identity(a.ufl_shape[0]), ufl.tr(a)
    if a.ufl_shape[0] == 2:
        return trace * identity - a
    square = ufl.dot(a, a)
    return square - trace * a + (trace**2 - ufl.tr(square)) / 2 * identity
