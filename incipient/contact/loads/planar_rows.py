"""Many contact problems in the plane, without a loop over them.

The loads that contact forces balance are a polyhedral cone, whose facets hold two edges of friction cones each: a
safety factor is the least of a few ratios. The loads of each way to begin to move are cones as well
(`exact.planar_motion`), and signs tell which ones a load is in. What hangs on the contacts alone is found once for each
different set of them.
Problems near to a boundary are left to the single judge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from incipient.arrays import Booleans, Floats, Integers, cross, unit
from incipient.contact.exact.motion_modes import Mode
from incipient.contact.exact.planar_motion import ZERO
from incipient.contact.exact.release import SAME
from incipient.contact.loads.rows import CLEAR, Answers, Rows, unit_and_size

FLAT = 1e-9  # a generator so near to a plane lies in it
THIN = 1e-4  # sine of the angle of two generators below which their plane is not sure enough
LEAST = (
    1e-3  # of a unit load along the decisive facet's normal: below it round-off grows above 1e-12
)
NEARLY_STRAIGHT = 1e-9  # of the free acceleration: an angular one that counts as none
SAME_ENERGY = (
    1e-6  # relative: motions whose energies are nearer than that are ordered by the single judge
)
MOST_CONTACTS = 12
AT_ONCE = 2_000_000  # numbers in a table


def judged_in_plane(rows: Rows) -> Answers:
    """Judge problems in the plane of the first two directions, with friction that is neither none nor infinite."""
    number, different = _different(rows)
    flow, weight = (one[:, [0, 1, 5]] for one in (rows.flow, rows.weight))
    contacts = _Contacts.of(different)
    answers = _held(contacts, number, flow, weight)
    moving = np.flatnonzero(~answers.held & ~answers.doubtful & rows.tells)
    count = rows.arms.shape[1]
    step = max(1, AT_ONCE // (3 * (count + 2) * (1 + 4 * count + count * (count - 1))))
    for start in range(0, len(moving), step):
        some = moving[start : start + step]
        used, place = np.unique(number[some], return_inverse=True)
        told, unclear = _told(_ways(contacts.part(used)), place, flow[some] + weight[some])
        answers.modes[some], answers.doubtful[some] = told, unclear
    return answers


def _different(rows: Rows) -> tuple[Integers, Rows]:
    """For each problem which of the different sets of contacts it has, (n,), and a problem with each of them."""
    count = len(rows)
    table = np.column_stack(
        [
            rows.arms[..., :2].reshape(count, -1),
            rows.inward[..., :2].reshape(count, -1),
            rows.friction,
            rows.inertia[:, 2, 2],
        ]
    )
    if (table.view(np.int64) == table[0].view(np.int64)).all():
        return np.zeros(count, dtype=np.int64), rows.part(slice(0, 1))
    key = np.ascontiguousarray(table).view(f"V{8 * table.shape[1]}")[:, 0]
    _, first, number = np.unique(key, return_index=True, return_inverse=True)
    return number.ravel(), rows.part(first)


@dataclass(frozen=True, eq=False)
class _Contacts:
    """g sets of k contacts in the plane; vectors are two parts of force or acceleration, and the couple or turning.

    normal, tangent: (g, k, 3) rows that give the acceleration of the grain at a contact by its own
    edges: (2, g, k, 3) wrenches of the edges of the friction cones, along the tangent and against it
    mass: (g, 3), the diagonal; facets: (g, f, 3) rows that are not positive for loads that are held, zero where there
    are fewer; sure: (g,) whether the facets are
    """

    normal: Floats
    tangent: Floats
    edges: Floats
    mass: Floats
    facets: Floats
    sure: Booleans

    @classmethod
    def of(cls, rows: Rows) -> _Contacts:
        """What hangs on the contacts of cases alone, not on their loads."""
        normal, tangent = (
            np.concatenate(
                [way, (arm[..., :1] * way[..., 1:] - arm[..., 1:] * way[..., :1])], axis=2
            )
            for arm, way in (
                (rows.arms[..., :2], rows.inward[..., :2]),
                (
                    rows.arms[..., :2],
                    np.stack([-rows.inward[..., 1], rows.inward[..., 0]], axis=-1),
                ),
            )
        )
        cosine = 1.0 / np.hypot(1.0, rows.friction)[:, None, None]
        sine = rows.friction[:, None, None] * cosine
        edges = np.stack([cosine * normal + sine * tangent, cosine * normal - sine * tangent])
        mass = np.ones((len(rows), 3))
        mass[:, 2] = rows.inertia[:, 2, 2]
        generators = -np.moveaxis(edges, 0, 2).reshape(len(rows), -1, 3)
        return cls(normal, tangent, edges, mass, *_facets(unit(generators)))

    def part(self, sets: Integers) -> _Contacts:
        """Some of the sets."""
        edges = self.edges[:, sets]
        return _Contacts(
            self.normal[sets],
            self.tangent[sets],
            edges,
            self.mass[sets],
            self.facets[sets],
            self.sure[sets],
        )


def _facets(generators: Floats) -> tuple[Floats, Booleans]:
    """Rows (g, f, 3) that are not positive on cones of generators (g, e, 3) and only there, and which cones are sure.

    A facet holds two generators; of two, which lie in a plane, one and the normal of that plane.
    """
    first, second = np.triu_indices(generators.shape[1], 1)
    normals = cross(generators[:, first], generators[:, second])
    solid = np.ones(len(generators), dtype=bool)
    if len(first) == 1:
        normals = np.concatenate([normals, cross(normals, generators)], axis=1)
    else:
        solid = np.linalg.det(generators.transpose(0, 2, 1) @ generators) > FLAT
    lengths = np.linalg.norm(normals, axis=2)
    there = np.concatenate([lengths > FLAT, lengths > FLAT], axis=1)
    normals = normals / np.maximum(lengths, FLAT)[..., None]
    both = np.concatenate([normals, -normals], axis=1)
    outside = (both @ generators.transpose(0, 2, 1)).max(axis=2)
    unclear = there & (outside > 0.01 * FLAT) & (outside < CLEAR)
    sure = solid & ~unclear.any(axis=1) & ~((lengths > FLAT) & (lengths < THIN)).any(axis=1)
    facet = there & (outside <= FLAT)
    order = np.argsort(~facet, axis=1, kind="stable")[
        :, : max(1, int(facet.sum(axis=1).max(initial=0)))
    ]
    kept = np.take_along_axis(both * facet[..., None], order[..., None], axis=1)
    return kept, sure


def _products(tables: Floats, number: Integers, vectors: Floats) -> Floats:
    """The products (n, ...) of vectors (n, 3) with the rows of their table, (g, ..., 3)."""
    shape = tables.shape[1:-1]
    flat = tables.reshape(len(tables), -1, 3)
    if len(tables) == 1:
        return np.asarray((vectors @ flat[0].T).reshape(-1, *shape))
    return np.asarray(np.einsum("nrj,nj->nr", flat[number], vectors).reshape(-1, *shape))


def _held(contacts: _Contacts, number: Integers, flow: Floats, weight: Floats) -> Answers:
    """Safety factors and what is held of the flow's loads and weights (n, 3)."""
    (f_unit, f_size), (w_unit, w_size) = unit_and_size(flow), unit_and_size(weight)
    whole, size = unit_and_size(flow + weight)
    f, w, all_of_it = (_products(contacts.facets, number, one) for one in (f_unit, w_unit, whole))
    there = contacts.facets.any(axis=2)[number]
    doubtful = ~contacts.sure[number] | ~(
        np.minimum(np.minimum(f_size, w_size), size) > CLEAR * (f_size + w_size)
    )
    w[on := np.abs(w) <= ZERO * 1e-3] = 0.0
    doubtful |= ((np.abs(w) <= CLEAR) & ~on).any(axis=1)
    weight_held = (w <= 0.0).all(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = np.where(f > CLEAR, -w / f, np.inf)
    decisive = ratios.argmin(axis=1)
    least, steep = (np.take_along_axis(one, decisive[:, None], axis=1)[:, 0] for one in (ratios, f))
    # Along a facet but for round-off: it would let the load grow to |w| / CLEAR at the least.
    along = there & (np.abs(f) <= CLEAR) & (-w <= CLEAR * least[:, None])
    doubtful |= weight_held & (along.any(axis=1) | ((least < np.inf) & (steep < LEAST)))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        factors = np.where(weight_held, least * (w_size / f_size) + 0.0, 0.0)  # no -0.0
    held = (all_of_it <= 0.0).all(axis=1)
    doubtful |= ~((all_of_it < -CLEAR) | ~there).all(axis=1) & ~(all_of_it > CLEAR).any(axis=1)
    return Answers(factors, held, np.where(held, 0, 1).astype(np.int64), doubtful)


@dataclass(frozen=True, eq=False)
class _Ways:
    """The ways to begin to move of g sets of contacts, c of each.

    rows: (g, c, r, 3), of length one: all positive for the loads w that move so; responses: (g, c, 3, 3), which give
    the accelerations; there: (g, c); turning, straight: (g, c) modes with and without angular acceleration
    told: (g,) whether these are all ways and clearly apart
    """

    rows: Floats
    responses: Floats
    there: Booleans
    turning: Integers
    straight: Integers
    mass: Floats
    told: Booleans


def _ways(of: _Contacts) -> _Ways:
    """The free motion, sliding on one contact, and accelerations along lines where two contacts stay or one sticks."""
    sets, count = of.normal.shape[:2]
    inverse = np.eye(3) / of.mass[:, None]
    free = (of.normal / of.mass[:, None])[:, None]
    parallel = np.linalg.norm(cross(of.normal[:, :, None], of.normal[:, None]), axis=3)[
        :, *np.triu_indices(count, 1)
    ]
    told = ~(parallel < CLEAR).any(axis=1)
    on_one, responses, gain = _sliding_on_one(of, inverse)
    told &= ~((np.abs(gain) > ZERO) & (np.abs(gain) < CLEAR)).any(axis=1)
    along, allowed, modes, clear = _along_lines(of, parallel)
    on_lines, factors, open_ways, unclear = _simplicial(along * of.mass[:, None], *allowed)
    there = modes > 0
    told &= clear & ~(unclear & there).any(axis=1)
    tables = [_padded(one, count + 2) for one in (free, on_one, on_lines)]
    lines = along[..., None] * factors[..., None, :]
    present = [np.ones((sets, 1), dtype=bool), np.abs(gain) > ZERO, there & open_ways]
    turning = np.concatenate(
        [
            np.full((sets, 1), _place(Mode.LIFTING_AND_ROTATING)),
            np.full((sets, 2 * count), _place(Mode.PIVOTING_AND_SLIDING)),
            modes,
        ],
        axis=1,
    )
    straight = turning.copy()
    straight[:, 0], straight[:, 1 : 1 + 2 * count] = _place(Mode.LIFTING), _place(Mode.SLIDING)
    rows = np.concatenate(tables, axis=1)
    # A row without direction says nothing for sure: its product is zero.
    lengths = np.linalg.norm(rows, axis=3, keepdims=True)
    rows = np.where(lengths > ZERO, rows / np.maximum(lengths, ZERO), 0.0)
    every = np.concatenate([inverse[:, None], responses, lines], axis=1)
    return _Ways(rows, every, np.concatenate(present, axis=1), turning, straight, of.mass, told)


def _padded(rows: Floats, height: int) -> Floats:
    """Rows (g, c, r, 3) with the first again until there are `height`."""
    again = np.broadcast_to(rows[:, :, :1], (*rows.shape[:2], height - rows.shape[2], 3))
    return np.concatenate([rows, again], axis=2)


def _sliding_on_one(of: _Contacts, inverse: Floats) -> tuple[Floats, Floats, Floats]:
    """Rows (g, 2k, k + 2, 3), responses (g, 2k, 3, 3) and gains (g, 2k): N (free + factor mass^-1 edge) = 0."""
    tables = []
    for way, edge in ((1.0, of.edges[1]), (-1.0, of.edges[0])):
        push = edge / of.mass[:, None]
        gain = (of.normal * push).sum(axis=2)
        factor = -of.normal / of.mass[:, None] / np.where(np.abs(gain) > ZERO, gain, 1.0)[..., None]
        response = inverse[:, None] + push[..., None] * factor[..., None, :]
        others = np.einsum("gmj,gkji->gkmi", of.normal, response)
        own = np.arange(others.shape[1])
        others[:, own, own] = factor  # where the grain slides it does not open
        slides = way * np.einsum("gkj,gkji->gki", of.tangent, response)
        tables.append(
            (
                np.concatenate([factor[:, :, None], slides[:, :, None], others], axis=2),
                response,
                gain,
            )
        )
    rows, responses, gains = (np.concatenate(one, axis=1) for one in zip(*tables, strict=True))
    return rows, responses, gains


def _along_lines(
    of: _Contacts, parallel: Floats
) -> tuple[Floats, tuple[Floats, Floats], Integers, Booleans]:
    """Directions (g, d, 3) where one contact sticks or two stay, edges (g, d, 3) of both forces, modes, and clarity.

    A mode is zero where the direction leads the grain into a contact. A set is not clear if a further contact stays in
    such a direction and does not slide along, or one of two sticks.
    """
    count = of.normal.shape[1]
    first, second = np.triu_indices(count, 1)
    stick, pair = cross(of.normal, of.tangent), cross(of.normal[:, first], of.normal[:, second])
    stick, pair = unit(stick), pair / np.maximum(parallel, ZERO)[..., None]
    involved = np.zeros((count + len(first), count), dtype=bool)
    involved[np.arange(count), np.arange(count)] = True
    involved[count + np.arange(len(first)), first] = involved[
        count + np.arange(len(first)), second
    ] = True
    directions, ones, others, modes, clear = [], [], [], [], np.ones(len(of.mass), dtype=bool)
    for sign in (1.0, -1.0):
        along = sign * np.concatenate([stick, pair], axis=1)
        openings = np.where(involved, np.inf, along @ of.normal.transpose(0, 2, 1))
        sliding = np.einsum(
            "gpcj,gpj->gpc", of.tangent[:, np.stack([first, second], axis=1)], along[:, count:]
        )
        against = [
            np.where(
                (sliding[..., one] > 0.0)[..., None], of.edges[1][:, ends], of.edges[0][:, ends]
            )
            for one, ends in enumerate((first, second))
        ]
        if count > 2:
            openings[:, count:][_slides_along(of, along[:, count:], *against)] = np.inf
        opening = openings.min(axis=2, initial=np.inf)
        ones.append(np.concatenate([of.edges[0], against[0]], axis=1))
        others.append(np.concatenate([of.edges[1], against[1]], axis=1))
        turning = np.abs(along[:, count:, 2])
        mode = np.full(opening.shape, _place(Mode.ROLLING if count == 1 else Mode.PIVOTING))
        mode[:, count:] = np.where(
            turning > ZERO, _place(Mode.PIVOTING_AND_SLIDING), _place(Mode.SLIDING)
        )
        unclear = np.abs(opening) <= CLEAR
        unclear[:, count:] |= (np.abs(sliding) <= CLEAR).any(axis=2) | (
            (turning > ZERO) & (turning < CLEAR)
        )
        clear &= ~(unclear & (opening > -CLEAR)).any(axis=1)
        directions.append(along)
        modes.append(np.where(opening > 0.0, mode, 0))
    joined = [np.concatenate(one, axis=1) for one in (directions, ones, others, modes)]
    return joined[0], (joined[1], joined[2]), joined[3], clear


def _slides_along(of: _Contacts, along: Floats, one: Floats, other: Floats) -> Booleans:
    """Which contacts (g, d, k) slide along with two others, with an edge in the plane of the edges of these (g, d, 3).

    Such a contact adds nothing to the loads of the pairs.
    """
    stays, way = (
        (np.abs(along @ of.normal.transpose(0, 2, 1)) <= ZERO),
        along @ of.tangent.transpose(0, 2, 1),
    )
    edges = np.where((way > 0.0)[..., None], of.edges[1][:, None], of.edges[0][:, None])
    beside = np.abs((cross(one, other)[:, :, None] * edges).sum(axis=3)) <= ZERO
    return np.asarray(stays & beside & (np.abs(way) > CLEAR))


def _simplicial(
    inertial: Floats, one: Floats, other: Floats
) -> tuple[Floats, Floats, Booleans, Booleans]:
    """Loads w = a inertial - b one - c other with a, b, c > 0, vectors (g, d, 3).

    Rows (g, d, 3, 3) that give a, b and c, that of a (g, d, 3), which cones are not flat, and which may be, (g, d).
    """
    rows = np.stack([cross(one, other), cross(inertial, other), -cross(inertial, one)], axis=2)
    volume = (rows[:, :, 0] * inertial).sum(axis=2)
    sizes = (
        np.linalg.norm(inertial, axis=2)
        * np.linalg.norm(one, axis=2)
        * np.linalg.norm(other, axis=2)
    )
    share = np.abs(volume) / sizes
    rows /= np.where(share > ZERO, volume, 1.0)[..., None, None]
    return rows, rows[:, :, 0], share > ZERO, (share > ZERO) & (share < CLEAR)


def _place(of: Mode) -> int:
    """The place of a mode among the labels: after "rest" and "moves"."""
    return 1 + list(Mode).index(of)


def _told(ways: _Ways, number: Integers, loads: Floats) -> tuple[Integers, Booleans]:
    """The modes of loads (n, 3) that are not held, and which are not clear, (n,)."""
    whole, _ = unit_and_size(loads)
    least = _products(ways.rows, number, whole).min(axis=2)
    there = ways.there[number]
    inside = there & (least > CLEAR)
    unclear = (
        ~ways.told[number] | (there & (np.abs(least) <= CLEAR)).any(axis=1) | ~inside.any(axis=1)
    )
    chosen = inside.argmax(axis=1)
    several = np.flatnonzero((inside.sum(axis=1) > 1) & ~unclear)
    if len(several):
        answers = np.einsum("ncij,nj->nci", ways.responses[number[several]], whole[several])
        energies = (answers**2 * ways.mass[number[several], None]).sum(axis=2)
        energies[~inside[several]] = np.inf
        chosen[several] = energies.argmin(axis=1)
        best = np.take_along_axis(answers, chosen[several, None, None], axis=1)
        least = energies.min(axis=1)
        scale = np.linalg.norm(whole[several] / ways.mass[number[several]], axis=1)[:, None]
        energies[np.abs(answers - best).max(axis=2) <= SAME * scale] = np.inf
        unclear[several] |= energies.min(axis=1) - least <= SAME_ENERGY * least
    turns = np.abs(np.einsum("nj,nj->n", ways.responses[number, chosen, 2], whole))
    turns /= np.linalg.norm(whole / ways.mass[number], axis=1)
    straight = turns <= NEARLY_STRAIGHT
    unclear |= ~straight & (turns <= CLEAR)
    table = np.where(straight[:, None], ways.straight[number], ways.turning[number])
    return np.take_along_axis(table, chosen[:, None], axis=1)[:, 0], unclear
