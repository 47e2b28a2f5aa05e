"""How errors fall with cell size and time step, by the order of the velocity: fitted to runs, used to predict."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

POWERS = tuple(np.arange(1.0, 8.5, 0.5).tolist())  # of the cell size that a fit tries
OTHER_ORDER = (
    3.0  # what is not known more of an error whose order was not measured: cell sizes make orders alike
)


@dataclass(frozen=True)
class Seen:
    """The error of one run; `step` in units of the flow's time, zero for steady flow."""

    order: int
    mesh_size: float
    step: float
    error: float


@dataclass(frozen=True)
class OrderLaw:
    """error = mesh h^power + time step^rate for one order; errors lie beside it by a factor `scatter`."""

    mesh: float
    power: float
    time: float
    rate: float
    scatter: float

    def error(self, mesh_size: float, step: float) -> float:
        """The error at a cell size and a step."""
        return self.mesh * mesh_size**self.power + (self.time * step**self.rate if step else 0.0)


@dataclass(frozen=True)
class ErrorLaw:
    """Laws by order of the velocity."""

    orders: Mapping[int, OrderLaw]

    def error(self, order: int, mesh_size: float, step: float) -> tuple[float, float]:
        """The error, and the factor by which it may be off."""
        nearest = min(self.orders, key=lambda known: abs(known - order))
        law = self.orders[nearest]
        return law.error(mesh_size, step), law.scatter * (1.0 if nearest == order else OTHER_ORDER)

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {str(order): asdict(law) for order, law in self.orders.items()}

    @staticmethod
    def of_dict(data: Mapping[str, Any]) -> ErrorLaw:
        """From plain data."""
        return ErrorLaw({int(order): OrderLaw(**law) for order, law in data.items()})


def fit(seen: Sequence[Seen], rate: float) -> ErrorLaw | None:
    """The law that fits the errors best, order by order; None where there is nothing to fit.

    Args:
        seen: runs whose errors are known.
        rate: order of the time steps; where the first steps err most, it is one less.
    """
    laws = {}
    for order in sorted({one.order for one in seen}):
        if law := _of_order([one for one in seen if one.order == order and one.error > 0.0], order, rate):
            laws[order] = law
    return ErrorLaw(laws) if laws else None


def _of_order(seen: Sequence[Seen], order: int, rate: float) -> OrderLaw | None:
    if not seen:
        return None
    # One cell size alone does not tell the power: that of the energy norm then.
    powers = POWERS if len({one.mesh_size for one in seen}) > 1 else (float(order),)
    rates = sorted({rate, 1.0}, reverse=True) if any(one.step for one in seen) else [rate]
    tried = (_with_power(seen, power, r) for r in rates for power in powers)
    return min(tried, key=lambda law: law.scatter)


def _with_power(seen: Sequence[Seen], power: float, rate: float) -> OrderLaw:
    from scipy.optimize import nnls

    errors = np.array([one.error for one in seen])
    parts = np.array([(one.mesh_size**power, one.step**rate if one.step else 0.0) for one in seen])
    (mesh, time), _ = nnls(parts / errors[:, None], np.ones(len(seen)))
    told = np.maximum(parts @ [mesh, time], 1e-300)
    scatter = float(np.exp(np.sqrt(np.mean(np.log(errors / told) ** 2))))
    return OrderLaw(float(mesh), power, float(time), rate, scatter)
