"""What contacts can carry: one interface to circular cones (programs) and to polyhedral ones (exact).

Local forces (k, 3) are in the friction cones, the wrenches that they balance are unit ones.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from incipient.arrays import Floats
from incipient.contact.exact import cones, fans
from incipient.contact.exact.grasp import Grasp

TOLERANCE = 1e-9  # in numbers of order one: what counts as balanced
SIDES = 16  # of pyramids inside and around a circular cone that answer nearly every question about holding
ANGLES = np.arange(SIDES) * (2.0 * np.pi / SIDES)
RING = np.stack([np.ones(SIDES), np.cos(ANGLES), np.sin(ANGLES)], axis=1)  # edges of the one inside
RING_AROUND = RING / [1.0, np.cos(np.pi / SIDES), np.cos(np.pi / SIDES)]


@dataclass(frozen=True, eq=False)
class Polyhedral:
    """Cones with a few edges: planar cases, no friction, infinite friction; all answers are exact."""

    grasp: Grasp
    fan: Floats

    @cached_property
    def edges(self) -> Floats:
        """The wrenches (6, k g) of all edges."""
        return fans.edges(self.grasp, self.fan)

    def holds(self, wrench: Floats) -> bool:
        """Whether contact forces balance a wrench, by non-negative least squares."""
        return fans.combination(self.edges, -wrench) is not None

    def forces(self, wrench: Floats) -> Floats | None:
        """Forces on as few edges as possible."""
        found = fans.combination(self.edges, -wrench)
        return None if found is None else fans.local(found, self.fan)

    def has_share(self, flow: Floats, weight: Floats) -> bool:
        """Whether some mixture of two wrenches can be held, by non-negative least squares."""
        return fans.has_share(self.edges, flow, weight)

    def largest_share(self, flow: Floats, weight: Floats) -> tuple[float, Floats] | None:
        """The largest share of the flow that can be held, and the forces, by linear programming."""
        found = fans.largest_share(self.edges, flow, weight)
        return None if found is None else (found[0], fans.local(found[1], self.fan))

    def can_jam(self) -> bool:
        """Whether contact forces balance one another, by non-negative least squares."""
        return fans.can_jam(self.edges, np.tile(self.fan[:, 0], len(self.grasp)))


@dataclass(frozen=True, eq=False)
class Circular:
    """Coulomb's cones in space: by cone programs, or by pyramids where these decide (50 times as fast)."""

    grasp: Grasp

    @cached_property
    def balance(self) -> cones.Balance:
        """How scaled forces balance wrenches."""
        return cones.balance(self.grasp)

    def holds(self, wrench: Floats) -> bool:
        """No if pyramids around the cones do not, yes if pyramids inside do, else by a cone program."""
        around, inside = self.pyramids
        if fans.combination(around, -wrench) is None:
            return False
        return fans.combination(inside, -wrench) is not None or self.forces(wrench) is not None

    def forces(self, wrench: Floats) -> Floats | None:
        """The shortest forces if they are in the cones, else those most inside."""
        if self._missed(wrench) > TOLERANCE:
            return None
        shortest = -self.balance.inverse @ wrench
        if cones.slack(shortest).min() >= 0.0:
            return self._local(shortest)
        margin, found = cones.most_inside(self.balance, wrench)
        return self._local(found) if margin >= -TOLERANCE else None

    def has_share(self, flow: Floats, weight: Floats) -> bool:
        """Whether some mixture of two wrenches can be held, by pyramids around the cones."""
        return fans.has_share(self.pyramids[0], flow, weight)

    def largest_share(self, flow: Floats, weight: Floats) -> tuple[float, Floats] | None:
        """The largest share by a cone program, or by comparison where contacts cannot have every wrench."""
        flow_missed, weight_missed = self._missed(flow), self._missed(weight)
        if max(flow_missed, weight_missed) <= TOLERANCE:
            found = cones.largest_share(self.balance, flow, weight)
            return None if found is None else (found[0], self._local(found[1]))
        share = weight_missed / (flow_missed + weight_missed)
        if share <= TOLERANCE or share >= 1.0 - TOLERANCE:
            share = round(share)
        held = self.forces(share * flow + (1.0 - share) * weight)
        return None if held is None else (share, held)

    def can_jam(self) -> bool:
        """Whether contact forces balance one another, by pyramids around the cones, else by a cone program."""
        around, inside = self.pyramids
        pressure = np.repeat(self.grasp.law.scaling[0], around.shape[1])
        if not fans.can_jam(around, pressure):
            return False
        return fans.can_jam(inside, pressure) or cones.can_jam(self.balance)

    @cached_property
    def pyramids(self) -> tuple[Floats, Floats]:
        """Wrenches (6, k SIDES) of the edges of pyramids around the friction cones and of pyramids inside."""
        inside = fans.edges(self.grasp, RING * self.grasp.law.scaling)
        return fans.edges(self.grasp, RING_AROUND * self.grasp.law.scaling), inside

    def _missed(self, wrench: Floats) -> float:
        """The size of the part of a wrench that no contact force can have."""
        part = self.balance.beyond.T @ wrench
        return float(np.sqrt(part @ part))

    def _local(self, scaled: Floats) -> Floats:
        return np.asarray(scaled.reshape(-1, 3) * self.grasp.law.scaling)


Support = Polyhedral | Circular


def support(grasp: Grasp) -> Support:
    """The polyhedral cones of a case if it has them, else the circular ones."""
    fan = grasp.fan
    return Circular(grasp) if fan is None else Polyhedral(grasp, fan)


@dataclass(frozen=True, eq=False)
class Widened:
    """What contacts hold of a flow's load that is known only within a box: flow + ways u with |u_i| <= 1.

    Errors count as further contact forces: a (flow + ways u) is a (flow - sum of ways) + ways p with p + q = 2 a and
    p, q >= 0. All arrays have one more row for each way, so that these sums hold as forces balance. `around`, `inside`:
    edges of cones around the friction cones and inside; `circular`: columns of these themselves, three a contact and
    then the errors, None where they have edges, which `around` then holds; `flow`: of length about one.
    """

    around: Floats
    inside: Floats
    circular: Floats | None
    flow: Floats

    @classmethod
    def of(cls, carried: Support, flow: Floats, ways: Floats) -> "Widened":
        """The errors (6, m) put beside what contacts can carry."""
        shifted = np.concatenate([flow - ways.sum(axis=1), np.full(ways.shape[1], -2.0)])
        if isinstance(carried, Polyhedral):
            edges = fans.beside(carried.edges, ways)
            return cls(edges, edges, None, shifted)
        assert isinstance(carried, Circular)
        around, inside = (fans.beside(edges, ways) for edges in carried.pyramids)
        return cls(around, inside, fans.beside(carried.balance.matrix, ways), shifted)

    def may_hold_flow(self) -> bool:
        """Whether the flow's load is held for some u; False is certain."""
        return self._largest_share(self.flow, self.flow) is not None

    def largest_share_of_flow(self, weight: Floats) -> float | None:
        """The largest a in [0, 1] such that for some u a (flow + ways u) + (1 - a) weight is held.

        None if certainly none is; 1 where that is not found, so that it never is too small.
        """
        return self._largest_share(self.flow, self._longer(weight))

    def largest_share_of_weight(self, weight: Floats) -> float | None:
        """The largest b in [0, 1] such that for some u b weight + (1 - b) (flow + ways u) is held; None, 1 as above."""
        return self._largest_share(self._longer(weight), self.flow)

    def _largest_share(self, first: Floats, second: Floats) -> float | None:
        if not fans.has_share(self.around, first, second):
            return None
        if self.circular is not None:
            return cones.share_bound(self.circular, 2 * (len(first) - 6), first, second)
        found = fans.largest_share(self.around, first, second)
        return 1.0 if found is None else found[0]

    def _longer(self, wrench: Floats) -> Floats:
        return np.concatenate([wrench, np.zeros(len(self.flow) - 6)])
