"""Many contact problems in space, one after the other, compiled to machine code by numba.

`held_rows` asks what contacts hold, by `compiled_shares`; `moving_rows` how a grain that is not held begins to move,
from the first starts of the search of the single judge (`exact.spatial_motion`), whose thresholds are passed on to it.
Import this module only where it is needed (see `exact.compiled`).
"""

import math

import numpy as np
from numpy.typing import NDArray

from incipient.arrays import Floats, Integers
from incipient.contact.exact.compiled import coulomb_forces, inner, kernel, largest, product, solved
from incipient.contact.loads.compiled_shares import optimum, room
from incipient.contact.loads.rows import DOUBTFUL, LIFTS, ROLLS, SLIDES, SPINS, TURNS

REGULAR = 1e-5  # of the largest pivot: below it contacts may not have all wrenches
OUTWARD = 1.0  # how far inside the cones the search for the most inside forces begins
ENOUGH = 0.1  # room in the cones beyond which it ends
DUAL = 1e-11  # an opening below it, relative to the free acceleration, presses no more
PARTS = 9  # of the friction, each a tenth more
ROUNDS = 30  # of contacts that begin to press or cease to, for each contact


@kernel
def held_rows(
    matrices: Floats,
    flow: Floats,
    weight: Floats,
    whole: Floats,
    sure: float,
    near: float,
    nearly_all: float,
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """What contacts hold: safety factors, by which share these may be off, and three rooms in the cones, (n,) each.

    matrices: (n, 6, 3k), wrenches of scaled forces; flow, weight, whole: wrenches (n, 6) of length one
    The rooms are those of the forces most inside the cones that balance flow, weight, and, where the weight is not held
    for sure, the whole; `sure`: room that is. Shares of the flow nearer to none or all than `nearly_all` are not
    answered, others found again where they are off by more than `near`. NaN: contacts that may not have all wrenches.
    """
    count, height = len(flow), matrices.shape[2]
    factors, errors, rooms = np.zeros(count), np.full(count, np.inf), np.full((3, count), np.nan)
    null = np.empty((height, height - 6))
    mirrors, triangle = np.empty((6, height)), np.empty((6, 6))
    first, second = np.empty(height), np.empty(height)
    table, limits = np.empty((height + 2, height - 5)), np.empty(height + 2)
    for i in range(count):
        if not _factorise(matrices[i], mirrors, triangle):
            continue
        _put_null_space(mirrors, null)
        _put_least(mirrors, triangle, weight[i], second)
        rooms[1, i] = _most_inside(null, second, table, limits, sure)
        if rooms[1, i] <= sure:
            _put_least(mirrors, triangle, whole[i], first)
            rooms[2, i] = _most_inside(null, first, table, limits, sure)
            continue
        _put_least(mirrors, triangle, flow[i], first)
        _put_table(null, table, limits)
        for j in range(height):
            table[j + 2, height - 6], limits[j + 2] = second[j] - first[j], second[j]
        x, error = optimum(table, limits)
        share = min(max(x[height - 6], 0.0), 1.0)
        x[height - 6] = 1.0
        rooms[0, i] = room(table, limits, x)
        part, scale = min(share, 1.0 - share), 1.0
        if error > near * part and part > nearly_all and error < 0.1 * part:
            # Once more with a flow that is about critical: errors are then those of a share of a half.
            scale = share / (1.0 - share)
            for j in range(height):
                table[j + 2, height - 6] = second[j] - scale * first[j]
            x, error = optimum(table, limits)
            share = min(max(x[height - 6], 0.0), 1.0)
            part = min(share, 1.0 - share)
        if part > nearly_all:
            factors[i], errors[i] = scale * share / (1.0 - share), error / part
    return factors, errors, rooms[0], rooms[1], rooms[2]


@inner
def _put_table(null: Floats, table: Floats, limits: Floats) -> None:
    """Fill in the program of `compiled_shares.optimum` but for the change and the start."""
    width = null.shape[1]
    table[:2] = 0.0
    table[0, width], table[1, width], limits[0], limits[1] = 1.0, -1.0, 1.0, 0.0
    for j in range(len(null)):
        for m in range(width):
            table[j + 2, m] = -null[j, m]


@inner
def _most_inside(null: Floats, start: Floats, table: Floats, limits: Floats, sure: float) -> float:
    """The most room in the cones of forces start + null x, as far as it is less than ENOUGH, or some that is sure."""
    width, inside = null.shape[1], np.inf
    for j in range(0, len(start), 3):
        inside = min(inside, start[j] - math.hypot(start[j + 1], start[j + 2]))
    if inside > sure:
        return inside
    out = OUTWARD - inside
    _put_table(null, table, limits)
    for j in range(len(start)):
        table[j + 2, width] = out + ENOUGH if j % 3 == 0 else 0.0
        limits[j + 2] = start[j] + (out if j % 3 == 0 else 0.0)
    x, error = optimum(table, limits)
    return (
        min(max(x[width], 0.0), 1.0) * (out + ENOUGH) - out
        if error < sure / (out + ENOUGH)
        else 0.0
    )


@inner
def _factorise(matrix: Floats, mirrors: Floats, triangle: Floats) -> bool:
    """Householder's factors of the transpose of a matrix (6, h): mirrors (6, h), and triangle (6, 6); False: rank."""
    height = matrix.shape[1]
    column = np.empty(height)
    triangle[:] = 0.0
    for j in range(6):
        column[:] = matrix[j]
        for i in range(j):
            _mirror(mirrors[i], column, i)
            triangle[i, j] = column[i]
        size = 0.0
        for m in range(j, height):
            size += column[m] ** 2
        size = math.sqrt(size)
        triangle[j, j] = -size if column[j] > 0.0 else size
        column[j] -= triangle[j, j]
        length = 0.0
        for m in range(j, height):
            length += column[m] ** 2
        length = math.sqrt(length)
        for m in range(height):
            mirrors[j, m] = column[m] / length if m >= j and length > 0.0 else 0.0
    least, most = np.inf, 0.0
    for j in range(6):
        least, most = min(least, abs(triangle[j, j])), max(most, abs(triangle[j, j]))
    return least > REGULAR * most


@inner
def _mirror(unit: Floats, vector: Floats, start: int) -> None:
    along = 0.0
    for m in range(start, len(vector)):
        along += unit[m] * vector[m]
    for m in range(start, len(vector)):
        vector[m] -= 2.0 * along * unit[m]


@inner
def _put_null_space(mirrors: Floats, null: Floats) -> None:
    """Fill in an orthonormal basis (h, h - 6) of forces that balance themselves."""
    height = len(null)
    column = np.empty(height)
    for m in range(6, height):
        column[:] = 0.0
        column[m] = 1.0
        for j in range(5, -1, -1):
            _mirror(mirrors[j], column, j)
        null[:, m - 6] = column


@inner
def _put_least(mirrors: Floats, triangle: Floats, wrench: Floats, forces: Floats) -> None:
    """Fill in the shortest forces (h,) that balance a wrench (6,)."""
    forces[:] = 0.0
    for i in range(6):
        forces[i] = -wrench[i]
        for j in range(i):
            forces[i] -= triangle[j, i] * forces[j]
        forces[i] /= triangle[i, i]
    for j in range(5, -1, -1):
        _mirror(mirrors[j], forces, j)


@kernel
def moving_rows(
    columns: Floats,
    inertia: Floats,
    inverse: Floats,
    friction: Floats,
    wrenches: Floats,
    steps: int,
    patience: int,
    zero: float,
    near_zero: float,
    same: float,
    same_energy: float,
) -> Integers:
    """What the motions of grains that are not held are made of, or DOUBTFUL, (n,).

    columns: (n, 6, 3k) wrenches of unit local forces; inertia, inverse: (n, 3, 3); wrenches: (n, 6) of length one
    steps, patience: of Newton's method, the latter where the former do not do
    zero, near_zero: of the free acceleration what is none, and by which factor near to it
    same, same_energy: accelerations and energies less apart than that are one
    """
    count, height = len(friction), columns.shape[2]
    made_of = np.empty(count, dtype=np.int64)
    moved, compliance, free = np.empty((6, height)), np.empty((height, height)), np.empty(height)
    acceleration = np.empty(6)
    starts = np.empty((height // 3 + 2, height))
    for i in range(count):
        made_of[i] = DOUBTFUL
        _put_response(columns[i], inverse[i], moved, compliance)
        _put_motion(wrenches[i], inverse[i], acceleration)
        scale = math.sqrt(product(acceleration, acceleration))
        for j in range(height):
            free[j] = 0.0
            for m in range(6):
                free[j] += wrenches[i, m] * moved[m, j]
        pressed = _pressures(compliance, free, scale)
        if pressed[0] < 0.0:
            continue
        _put_acceleration(pressed, wrenches[i], columns[i], inverse[i], acceleration)
        if largest(acceleration) <= near_zero * zero * scale:
            continue
        onto, offset, step = _coulomb(compliance, free)
        _put_starts(pressed, acceleration, columns[i], free, step, friction[i], starts)
        found = coulomb_forces(onto, offset, friction[i], starts, steps, steps)
        if len(found) == 0:
            more = _growing(onto, offset, friction[i], starts, pressed, steps)
            found = coulomb_forces(onto, offset, friction[i], more, steps, patience)
        if _choose(
            found,
            wrenches[i],
            columns[i],
            inertia[i],
            inverse[i],
            same * scale,
            same_energy,
            acceleration,
        ):
            made_of[i] = _made_of(acceleration, columns[i], zero * scale, near_zero)
    return made_of


@inner
def _put_motion(wrench: Floats, inverse: Floats, acceleration: Floats) -> None:
    """Fill in the acceleration (6,) by a wrench."""
    for m in range(3):
        acceleration[m], acceleration[m + 3] = wrench[m], 0.0
        for n in range(3):
            acceleration[m + 3] += inverse[m, n] * wrench[n + 3]


@inner
def _put_response(columns: Floats, inverse: Floats, moved: Floats, compliance: Floats) -> None:
    """Fill in accelerations (6, h) by unit local forces, and the local accelerations (h, h) at the contacts."""
    height = columns.shape[1]
    for j in range(height):
        for m in range(3):
            moved[m, j], moved[m + 3, j] = columns[m, j], 0.0
            for n in range(3):
                moved[m + 3, j] += inverse[m, n] * columns[n + 3, j]
    for j in range(height):
        for other in range(j + 1):
            total = 0.0
            for m in range(6):
                total += columns[m, j] * moved[m, other]
            compliance[j, other] = compliance[other, j] = total


@inner
def _put_acceleration(
    local: Floats, wrench: Floats, columns: Floats, inverse: Floats, acceleration: Floats
) -> None:
    """Fill in the acceleration (6,) under a wrench and local forces (h,)."""
    whole = wrench.copy()
    for m in range(6):
        whole[m] += product(columns[m], local)
    _put_motion(whole, inverse, acceleration)


@inner
def _pressures(compliance: Floats, free: Floats, scale: float) -> Floats:
    """Local forces (h,) without friction: pressures p >= 0 that keep contacts from entering; the first -1: not found.

    By the active sets of Lawson and Hanson (1974), chapter 23.
    """
    count, local = len(free) // 3, np.zeros(len(free))
    presses, p = np.zeros(count, dtype=np.bool_), np.zeros(count)
    for _ in range(ROUNDS * count):
        enters, deepest = -1, -DUAL * scale * max(1.0, largest(p))
        for i in range(count):
            opening = free[3 * i]
            for j in range(count):
                opening += compliance[3 * i, 3 * j] * p[j]
            if not presses[i] and opening < deepest:
                enters, deepest = i, opening
        if enters < 0:
            for i in range(count):
                local[3 * i] = p[i]
            return local
        presses[enters] = True
        _make_press(compliance, free, presses, p)
    local[0] = -1.0
    return local


@inner
def _make_press(compliance: Floats, free: Floats, presses: NDArray[np.bool_], p: Floats) -> None:
    """Change pressures until those that press keep their contacts closed, with fewer of them where one would pull."""
    for _ in range(len(p)):
        kept = np.flatnonzero(presses)
        square, right = np.empty((len(kept), len(kept))), np.empty(len(kept))
        for a in range(len(kept)):
            right[a] = -free[3 * kept[a]]
            for b in range(len(kept)):
                square[a, b] = compliance[3 * kept[a], 3 * kept[b]]
        wanted = solved(square, right)
        part = 1.0
        for a in range(len(kept)):
            if wanted[a] <= 0.0:
                part = min(part, p[kept[a]] / (p[kept[a]] - wanted[a]) if p[kept[a]] > 0.0 else 0.0)
        for a in range(len(kept)):
            one = kept[a]
            p[one] += part * (wanted[a] - p[one])
            if wanted[a] <= 0.0 and p[one] <= 1e-14 * largest(p):
                p[one], presses[one] = 0.0, False
        if part == 1.0:
            break


@inner
def _coulomb(compliance: Floats, free: Floats) -> tuple[Floats, Floats, Floats]:
    """The law at the contacts as in `spatial_motion.coulomb`: onto (h, h), offset (h,), step (k,)."""
    height = len(free)
    onto, offset, step = np.empty((height, height)), np.empty(height), np.empty(height // 3)
    for i in range(height // 3):
        j = 3 * i
        step[i] = 3.0 / (compliance[j, j] + compliance[j + 1, j + 1] + compliance[j + 2, j + 2])
    for j in range(height):
        offset[j] = -step[j // 3] * free[j]
        for i in range(height):
            onto[i, j] = (1.0 if i == j else 0.0) - compliance[i, j] * step[j // 3]
    return onto, offset, step


@inner
def _put_starts(
    pressed: Floats,
    acceleration: Floats,
    columns: Floats,
    free: Floats,
    step: Floats,
    friction: float,
    starts: Floats,
) -> None:
    """Fill in none, sliding without friction, and one contact alone, as in `spatial_motion.Search`."""
    starts[:] = 0.0
    way = np.zeros(3)
    for i in range(len(step)):
        for axis in range(3):
            way[axis] = 0.0
            for m in range(6):
                way[axis] += acceleration[m] * columns[m, 3 * i + axis]
        _put_rubbed(pressed[3 * i], way, friction, starts[1], 3 * i)
        way[:] = free[3 * i : 3 * i + 3]
        _put_rubbed(abs(way[0]) * step[i], way, friction, starts[i + 2], 3 * i)


@inner
def _put_rubbed(pressure: float, way: Floats, friction: float, forces: Floats, place: int) -> None:
    """Fill in a pressure, and friction in full against an acceleration (3,)."""
    size = max(math.hypot(way[1], way[2]), 1e-300)
    forces[place] = pressure
    forces[place + 1] = -friction * pressure / size * way[1]
    forces[place + 2] = -friction * pressure / size * way[2]


@inner
def _growing(
    onto: Floats, offset: Floats, friction: float, starts: Floats, pressed: Floats, steps: int
) -> Floats:
    """The starts, and forces at parts of the friction, each reached from the one before: (s, h)."""
    count = len(starts)
    more = np.empty((count + PARTS + 1, len(pressed)))
    more[:count], more[count] = starts, pressed
    for part in range(1, PARTS + 1):
        found = coulomb_forces(
            onto, offset, 0.1 * part * friction, more[count : count + 1].copy(), steps, steps
        )
        if len(found):
            count += 1
            more[count] = found[0]
    return more[: count + 1].copy()


@inner
def _choose(
    found: Floats,
    wrench: Floats,
    columns: Floats,
    inertia: Floats,
    inverse: Floats,
    same: float,
    same_energy: float,
    chosen: Floats,
) -> bool:
    """Fill in the acceleration of the least energy among those of forces found (s, h); False: none, or not surely."""
    least, second, one = np.inf, np.inf, np.empty(6)
    for i in range(len(found)):
        _put_acceleration(found[i], wrench, columns, inverse, one)
        energy, apart = 0.0, 0.0
        for m in range(3):
            energy += one[m] ** 2
            for n in range(3):
                energy += one[m + 3] * inertia[m, n] * one[n + 3]
        for m in range(6):
            apart = max(apart, abs(one[m] - chosen[m])) if i else np.inf
        if apart <= same:
            continue
        if energy < least:
            least, second = energy, least
            chosen[:] = one
        else:
            second = min(second, energy)
    return len(found) > 0 and second - least > same_energy * least


@inner
def _made_of(acceleration: Floats, columns: Floats, zero: float, near: float) -> int:
    """What a motion is made of; DOUBTFUL where an acceleration is near to what counts as zero."""
    turning = max(abs(acceleration[3]), abs(acceleration[4]), abs(acceleration[5]))
    if _is_near(turning, zero, near) or _is_near(largest(acceleration), zero, near):
        return DOUBTFUL
    turns = turning > zero
    made_of, spins, at = TURNS if turns else 0, True, np.empty(3)
    for i in range(columns.shape[1] // 3):
        for axis in range(3):
            at[axis] = 0.0
            for m in range(6 if turns else 3):
                at[axis] += acceleration[m] * columns[m, 3 * i + axis]
        along = math.hypot(at[1], at[2])
        if _is_near(abs(at[0]), zero, near) or _is_near(along, zero, near):
            return DOUBTFUL
        made_of |= LIFTS if at[0] > zero else (SLIDES if along > zero else ROLLS)
        part = 0.0
        for m in range(3):
            part += acceleration[m + 3] * columns[m, 3 * i]
        for m in range(3):
            across = abs(acceleration[m + 3] - part * columns[m, 3 * i])
            if _is_near(across, zero, near):
                return DOUBTFUL
            spins &= across <= zero
    return made_of | (SPINS if spins else 0)


@inner
def _is_near(size: float, zero: float, near: float) -> bool:
    return zero / near < size < zero * near
