"""Contacts at which judges could stumble: no friction and endless friction, one place twice, opposite normals."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from incipient.contact import Contacts, Load
from incipient.contact.verdict import judge
from incipient.errors import IncipientError

# Name: places and normals out of a unit disc at the origin.
PLACES: dict[str, tuple[list[list[float]], list[list[float]]]] = {
    "one contact": ([[0, -1]], [[0, -1]]),
    "the same contact three times": ([[0, -1]] * 3, [[0, -1]] * 3),
    "two contacts 1e-9 apart": ([[-5e-10, -1], [5e-10, -1]], [[0, -1]] * 2),
    "opposite contacts": ([[0, -1], [0, 1]], [[0, -1], [0, 1]]),
    "a wedge": ([[-0.6, -0.8], [0.6, -0.8]], [[-0.6, -0.8], [0.6, -0.8]]),
}
FRICTIONS = (0.0, 1e-12, 0.5, 1e12)


def degenerate_contacts() -> Iterator[tuple[str, str, str]]:
    """Rows: the case, whether it moves and the safety factor, the paper's mode or the named error."""
    for name in PLACES:
        for friction in FRICTIONS:
            case = f"{name}, friction {friction:g}"
            try:
                yield case, *judged(name, friction)
            except IncipientError as error:
                yield case, "refused", str(error)


def judged(name: str, friction: float) -> tuple[str, str]:
    """Whether the disc, of weight one under a sideways flow of a tenth, moves, with what margin, and how."""
    points, normals = (np.pad(np.array(rows, float), ((0, 0), (0, 1))) for rows in PLACES[name])
    load = Load(
        np.array([0.1, 0.0, 0.0]),
        np.array([0.0, 0.0, -0.02]),
        np.array([0.0, -1.0, 0.0]),
        np.zeros(3),
    )
    told = judge(load, Contacts(points, normals), friction, (1.0, 0.5 * np.eye(3)))
    safety = told.equilibrium.safety.value
    return (
        f"{'moves' if told.moves else 'rests'}, safety factor {safety:.4g}",
        told.equilibrium.label,
    )
