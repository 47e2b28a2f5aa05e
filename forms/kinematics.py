"""The reference description: x = X + d(X, t), and derivatives with respect to x taken on X.

Where the reference is renewed at each step, F and J drop out when a form is compiled.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import ufl


@dataclass(frozen=True)
class ReferenceMap:
    """The map x = X + d(X, t) of a reference domain, in scene units.

    displacement, velocity: d and the mesh velocity dd/dt, vectors
    F, inverse, J:          deformation gradient I + grad d, its inverse and its determinant

    Source: Childs & Reddy (1999); F, J and v^mesh of equations (338) and (339).
    """

    displacement: Any
    velocity: Any
    F: Any
    inverse: Any
    J: Any

    @classmethod
    def of(cls, displacement: Any, velocity: Any) -> ReferenceMap:
        F = ufl.Identity(len(displacement)) + ufl.grad(displacement)
        return cls(displacement, velocity, F, ufl.inv(F), ufl.det(F))

    @classmethod
    def renewed(cls, gdim: int) -> ReferenceMap:
        """The reference renewed at each step: X is the present position."""
        still, identity = ufl.zero(gdim), ufl.Identity(gdim)
        return cls(still, still, identity, identity, ufl.as_ufl(1))


def gradient(v: Any, reference_map: ReferenceMap) -> Any:
    """Spatial gradient grad(v) F^-1."""
    return ufl.dot(ufl.grad(v), reference_map.inverse)


def divergence(v: Any, reference_map: ReferenceMap) -> Any:
    """Spatial divergence grad(v) : F^-T."""
    return ufl.tr(gradient(v, reference_map))


def laplacian(v: Any, reference_map: ReferenceMap) -> Any:
    """Spatial Laplacian of each component of v."""
    i, j = ufl.indices(2)
    return ufl.as_vector(gradient(gradient(v, reference_map), reference_map)[i, j, j], i)


def rate_of_strain(v: Any, reference_map: ReferenceMap) -> Any:
    """D = sym(grad(v) F^-1)."""
    return ufl.sym(gradient(v, reference_map))


def weighted(expression: Any, reference_map: ReferenceMap) -> Any:
    """The expression times J."""
    return reference_map.J * expression


def surface_vector(n: Any, reference_map: ReferenceMap) -> Any:
    """Spatial normal times spatial area per unit of reference area, J F^-T N (Nanson)."""
    return reference_map.J * ufl.dot(reference_map.inverse.T, n)


def rigid_velocity(velocity: Any, spin: Any, arm: Any) -> Any:
    """Velocity of a rigid body at an arm; the spin has one component in 2-D, three in 3-D."""
    if len(arm) == 2:
        return velocity + spin[0] * ufl.perp(arm)
    return velocity + ufl.cross(spin, arm)
