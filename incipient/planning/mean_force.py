"""The force that keeps a given mean profile against its viscous stress (see `mean_profile`)."""

from typing import Any

import dolfinx
import ufl
from ufl.domain import extract_domains

from ..compat import PETSc
from .mean_profile import MeanProfile, gradient


def sustaining_force(profile: MeanProfile, datum: float, up: int) -> Any:
    """A force per unit mass for `FlowModel.body_force`, function of place and time, that keeps the profile.

    datum: height at which it starts, in the coordinate numbered `up`
    """
    return lambda place, time: ufl.as_vector(
        [_force(profile, place[up] - _constants(place, datum)[0]), *[0] * up]
    )


def _force(profile: MeanProfile, height: Any) -> Any:
    """-nu d2u/dy2 at a height above the datum as a UFL expression: what the viscous stress does not bring down.

    By it and the viscosity the profile is the exact flow; below the datum it is zero. Its numbers are constants,
    which recompile nothing. Not collective.
    """
    per_length = profile.per_length
    scale, per_length, shift = _constants(
        height, profile.shear_velocity**2 * per_length, per_length, profile.shift
    )
    y = ufl.variable(height * per_length)
    return ufl.conditional(ufl.gt(height, 0), -scale * ufl.diff(gradient(y, shift, ufl), y), 0)


def _constants(place: Any, *values: float) -> list[Any]:
    (domain,) = extract_domains(place)
    return [dolfinx.fem.Constant(domain, PETSc.ScalarType(value)) for value in values]
