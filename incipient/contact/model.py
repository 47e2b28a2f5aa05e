"""What a judge of incipient motion is given: where the grain is touched, and what acts on it.

Everything is three-dimensional; a plane case has third components of zero and couples along the third axis.
Units are the caller's, as long as they are consistent.
"""

from dataclasses import dataclass, fields

import numpy as np

from incipient.arrays import Floats
from incipient.errors import SceneError
from incipient.geometry.contacts import Contacts, freeze


@dataclass(frozen=True, eq=False)
class Load:
    """What acts on the grain besides the bed, each (3,).

    `flow_force`: the flow's force on the grain; `flow_couple`: its couple about `centre`; `weight`: all else
    that acts at `centre`, the centre of mass, such as weight and buoyancy. Raises SceneError on anything but
    three finite numbers each.
    """

    flow_force: Floats
    flow_couple: Floats
    weight: Floats
    centre: Floats

    def __post_init__(self) -> None:
        for item in fields(self):
            value = np.array(getattr(self, item.name), dtype=float)
            if value.shape != (3,):
                raise SceneError(
                    f"load: {item.name} has shape {value.shape}; give three components"
                )
            if not np.isfinite(value).all():
                raise SceneError(f"load: {item.name} is {value.tolist()}; give finite numbers")
            freeze(self, item.name, value)

    @property
    def force(self) -> Floats:
        """F_flow&g of (9): flow force and weight together, (3,)."""
        return self.flow_force + self.weight

    @property
    def couple(self) -> Floats:
        """tau_flow&g of (21) about the centre of mass, where the weight has no couple, (3,)."""
        return self.flow_couple


@dataclass(frozen=True, eq=False)
class Loads:
    """n loads: force and couple of the flow (n, 3), weight (n, 3), and the centre of mass (3,) that couples are about.

    Raises SceneError if shapes do not fit or a number is not finite.
    """

    force: Floats
    couple: Floats
    weight: Floats
    centre: Floats

    def __post_init__(self) -> None:
        shape = np.shape(self.force)
        if len(shape) != 2 or shape[1] != 3:
            raise SceneError(f"loads: force has shape {shape}; give (n, 3)")
        object.__setattr__(self, "weight", np.broadcast_to(self.weight, shape))
        for name in ("force", "couple", "weight"):
            given = np.asarray(getattr(self, name), dtype=float)
            if given.shape != shape or not np.isfinite(given).all():
                raise SceneError(
                    f"loads: {name} is not {shape[0]} rows of three finite numbers; give such"
                )
            object.__setattr__(self, name, given)

    def __len__(self) -> int:
        return len(self.force)

    def load(self, number: int) -> Load:
        """One of them."""
        return Load(self.force[number], self.couple[number], self.weight[number], self.centre)


def require_outward(contacts: Contacts, centre: Floats) -> None:
    """Refuse contacts whose normals all point into the grain, toward its centre of mass: a sign mistaken.

    One of several may do so on a grain that is not convex. Raises SceneError.
    """
    if (((contacts.points - centre) * contacts.normals).sum(axis=1) < 0.0).all():
        raise SceneError(
            "contacts: all normals point into the grain; give them pointing out, into the bed"
        )
