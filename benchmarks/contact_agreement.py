"""How often the paper's criteria and the exact judge differ on random cases, and why: the table "agreement".

Physics: grains of weight one and size one in space, at rest on one contact, a plane, a pocket or any contacts
         below them; the flow's force is mostly along the bed, one case in three has no couple; friction 0 to 1.
Cost:    half a minute for 2000 cases of each kind on one core.
Run:     python benchmarks/contact_agreement.py [--cases 2000] [--seed 1]
"""

import argparse
from collections import Counter
from collections.abc import Callable

import numpy as np
from tables import publish, table

from incipient.arrays import Floats
from incipient.contact import Contacts, Load, classify
from incipient.contact.verdict import Reason, compare, judged

INERT = (1.0, 0.1 * np.eye(3))  # of a sphere of diameter one: 2/5 r^2

AGREE = ("agree: rest", "agree: moves, and in the same way")

Generator = np.random.Generator


def one_contact(rng: Generator) -> Contacts:
    """A grain of any shape on one contact near its lowest point."""
    point = (
        np.array([*rng.uniform(-0.2, 0.2, 2), -0.5])
        if rng.random() < 0.5
        else np.array([0.0, 0.0, -0.5])
    )
    return Contacts(point[None], leaning(np.array([[0.0, 0.0, -1.0]]), 0.1, rng))


def box(rng: Generator) -> Contacts:
    """A box on a plane, by the corners of its base."""
    half = rng.uniform(0.2, 0.5, 2)
    corners = np.array([[x, y, -0.5] for x in (-half[0], half[0]) for y in (-half[1], half[1])])
    return Contacts(corners, np.tile([0.0, 0.0, -1.0], (4, 1)), np.full(4, half.prod()))


def pocket(rng: Generator) -> Contacts:
    """A sphere in a regular pocket of three or four others."""
    count, angle, turn = (
        int(rng.integers(3, 5)),
        rng.uniform(0.3, 0.9),
        rng.uniform(0.0, 2.0 * np.pi),
    )
    around = turn + 2.0 * np.pi * np.arange(count) / count
    low = np.full(count, -np.cos(angle))
    normals = np.column_stack([np.sin(angle) * np.cos(around), np.sin(angle) * np.sin(around), low])
    return Contacts(0.5 * normals, normals)


def anything(rng: Generator) -> Contacts:
    """Three to six contacts anywhere on the lower half of a rounded grain."""
    count = int(rng.integers(3, 7))
    low, around = rng.uniform(0.2, 1.0, count), rng.uniform(0.0, 2.0 * np.pi, count)
    flat = np.sqrt(1.0 - low * low)
    outward = np.column_stack([flat * np.cos(around), flat * np.sin(around), -low])
    return Contacts(outward * rng.uniform(0.4, 0.6, (count, 1)), leaning(outward, 0.2, rng))


def in_the_plane(rng: Generator) -> Contacts:
    """One to three contacts of a grain of any shape in the plane of the first and third axis."""
    count = int(rng.integers(1, 4))
    angle = rng.uniform(-1.2, 1.2, count)
    normals = np.column_stack([np.sin(angle), np.zeros(count), -np.cos(angle)])
    low = normals * rng.uniform(0.4, 0.6, (count, 1))
    return Contacts(
        low + 0.2 * np.cross(normals, [0.0, 1.0, 0.0]) * rng.uniform(-1.0, 1.0, (count, 1)), normals
    )


def leaning(normals: Floats, spread: float, rng: Generator) -> Floats:
    """Normals turned a little at random."""
    turned = normals + spread * rng.standard_normal(normals.shape)
    return turned / np.linalg.norm(turned, axis=1)[:, None]


KINDS: dict[str, Callable[[Generator], Contacts]] = {
    "one contact": one_contact,
    "box on a plane": box,
    "sphere in a pocket": pocket,
    "three to six contacts": anything,
    "one to three in the plane": in_the_plane,
}


def load(rng: Generator, plane: bool = False) -> Load:
    """Weight one, a force of the flow mostly along the bed, and in two cases of three a couple."""
    strength = 10.0 ** rng.uniform(-1.5, 0.3)
    direction = np.pi * rng.integers(0, 2) if plane else rng.uniform(0.0, 2.0 * np.pi)
    force = strength * np.array([np.cos(direction), np.sin(direction), rng.normal(0.0, 0.4)])
    couple = np.zeros(3) if rng.random() < 1.0 / 3.0 else strength * rng.normal(0.0, 0.15, 3)
    if plane:
        force[1], couple[[0, 2]] = 0.0, 0.0
    return Load(force, couple, [0.0, 0.0, -1.0], np.zeros(3))


def tallied(make: Callable[[Generator], Contacts], cases: int, rng: Generator) -> Counter[str]:
    """Judge and compare so many cases of one kind: how often each outcome is met."""
    outcomes: Counter[str] = Counter()
    for _ in range(cases):
        acting, contacts = load(rng, make is in_the_plane), make(rng)
        friction = float(rng.uniform(0.0, 1.0))
        exact = judged(acting, contacts, friction, INERT)
        agreement = compare(classify(acting, contacts, friction), exact)
        outcomes[words_of(agreement.reason) if agreement.reason else AGREE[exact.moves]] += 1
    return outcomes


def words_of(reason: Reason) -> str:
    """A reason as it stands in the table."""
    return f"differ: {reason.name.lower().replace('_', ' ')}"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--cases", type=int, default=2000, help="of each kind")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    kinds = {name: tallied(make, options.cases, rng) for name, make in KINDS.items()}
    met = [name for name in map(words_of, Reason) if any(kind[name] for kind in kinds.values())]
    rows = [[name, *(str(kind[name]) for kind in kinds.values())] for name in [*AGREE, *met]]
    publish("agreement", table(["", *kinds], rows))


if __name__ == "__main__":
    main()
