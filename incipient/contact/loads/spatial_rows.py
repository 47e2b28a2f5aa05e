"""Many contact problems in space with friction, by compiled loops over them.

Problems near to a boundary, or whose answer is not sure enough, are left to the single judge.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from incipient.arrays import Booleans, Floats, Integers, unit
from incipient.contact.exact.motion import ZERO
from incipient.contact.exact.motion_modes import Mode
from incipient.contact.exact.release import SAME
from incipient.contact.exact.safety import NEARLY_ALL
from incipient.contact.exact.spatial_motion import FEW, PATIENCE, STEPS
from incipient.contact.loads.rows import (
    CLEAR,
    LIFTS,
    ROLLS,
    SLIDES,
    SPINS,
    TURNS,
    Answers,
    Rows,
    unit_and_size,
)

SURE = 1e-9  # relative error of a safety factor that counts as none
ROOM = 1e-6  # in the cones: with less it is not sure whether a load is held
NEAR_ZERO = 10.0  # factor on the acceleration that counts as zero, within which a motion is judged by itself
SAME_ENERGY = (
    1e-6  # relative: motions whose energies are nearer than that are ordered by the single judge
)
TURNED, ROUND_OFF = (
    1e-4,
    1e-13,
)  # of a unit load: what certainly turns a grain about its contacts, and what does not
OUT_OF_PLANE = (
    1e-8  # determinant of moments of the unit vectors of a case, above which they are in no plane
)


def in_no_plane(rows: Rows) -> Booleans:
    """Whose arms, normals and loads certainly span space, (n,)."""
    loads = np.stack(
        [unit_and_size(wrench[:, :3])[0] for wrench in (rows.flow, rows.weight)], axis=1
    )
    vectors = np.concatenate([rows.arms, rows.inward, loads], axis=1)
    return np.asarray(np.linalg.det(vectors.transpose(0, 2, 1) @ vectors) > OUT_OF_PLANE)


def judged_in_space(rows: Rows) -> Answers:
    """Judge problems that lie in no plane, with friction that is neither none nor infinite.

    Raises ImportError without numba.
    """
    from incipient.contact.loads import (
        compiled_rows,
    )  # numba takes time to import, and most cases do without

    columns = _wrenches(rows)
    few = rows.arms.shape[1] < 3
    answers = _held_by_few(rows) if few else _held(rows, columns, compiled_rows.held_rows)
    whole, _ = unit_and_size(rows.flow + rows.weight)
    if rows.arms.shape[1] > FEW:
        answers.doubtful[~answers.held & rows.tells] = True
    moving = np.flatnonzero(~answers.held & ~answers.doubtful & rows.tells)
    if len(moving):
        inertia = np.ascontiguousarray(rows.inertia[moving])
        made_of = compiled_rows.moving_rows(
            columns[moving],
            inertia,
            np.linalg.inv(inertia),
            rows.friction[moving],
            whole[moving],
            STEPS,
            PATIENCE,
            ZERO,
            NEAR_ZERO,
            SAME,
            SAME_ENERGY,
        )
        answers.modes[moving] = _modes(made_of)
        answers.doubtful[moving] = made_of < 0
    return answers


def _wrenches(rows: Rows) -> Floats:
    """The wrenches (n, 6, 3k) of unit local forces, in frames as of `exact.grasp`."""
    first = unit(np.cross(rows.inward, np.eye(3)[np.abs(rows.inward).argmin(axis=2)]))
    frames = np.stack([rows.inward, first, np.cross(rows.inward, first)], axis=2)
    both = np.concatenate([frames, np.cross(rows.arms[:, :, None], frames)], axis=3)
    return np.ascontiguousarray(both.transpose(0, 3, 1, 2).reshape(len(rows), 6, -1))


def _held(rows: Rows, columns: Floats, held_rows: Callable[..., tuple[Floats, ...]]) -> Answers:
    """Safety factors and what is held, by three contacts or more; `held_rows` is that of `compiled_rows`."""
    cosine = 1.0 / np.hypot(1.0, rows.friction)
    scaling = np.stack([cosine, rows.friction * cosine, rows.friction * cosine], axis=1)
    matrices = columns * np.tile(scaling, (1, rows.arms.shape[1]))[:, None]
    (flow, f_size), (weight, w_size) = unit_and_size(rows.flow), unit_and_size(rows.weight)
    whole, size = unit_and_size(rows.flow + rows.weight)
    factors, errors, of_flow, of_weight, of_whole = held_rows(
        matrices, flow, weight, whole, ROOM, SURE, NEARLY_ALL
    )
    weight_held, unlimited, sure = of_weight > ROOM, of_flow >= 0.0, errors <= SURE
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        factors = np.where(unlimited, np.inf, factors * w_size / f_size)
    doubtful = ~np.where(
        weight_held,
        unlimited | (sure & (np.abs(factors - 1.0) > CLEAR)),
        (of_weight < -ROOM) & (np.abs(of_whole) > ROOM),
    )
    doubtful |= ~(np.minimum(np.minimum(f_size, w_size), size) > CLEAR * (f_size + w_size))
    factors = np.where(weight_held, factors, 0.0)
    held = np.where(weight_held, factors >= 1.0, of_whole > 0.0)
    return Answers(factors, held, np.where(held, 0, 1).astype(np.int64), doubtful)


def _held_by_few(rows: Rows) -> Answers:
    """One contact or two hold no load that turns the grain about them: any part of it moves the grain."""
    count = len(rows)
    if rows.arms.shape[1] == 1:
        axes, length = np.broadcast_to(np.eye(3), (count, 3, 3)), np.ones(count)
    else:
        along = rows.arms[:, 1] - rows.arms[:, 0]
        length = np.linalg.norm(along, axis=1)
        axes = unit(along)[:, None]
    turned, sizes = [], []
    for wrench in (rows.flow, rows.flow + rows.weight, rows.weight):
        one, size = unit_and_size(wrench)
        couple = one[:, 3:] - np.cross(rows.arms[:, 0], one[:, :3])
        turned.append(np.linalg.norm(np.einsum("naj,nj->na", axes, couple), axis=1))
        sizes.append(size)
    clear = (np.minimum(turned[0], turned[1]) > TURNED) & (length > ROOM)
    clear &= ((turned[2] < ROUND_OFF) | (turned[2] > ROOM)) & (
        sizes[1] > CLEAR * (sizes[0] + sizes[2])
    )
    return Answers(
        np.zeros(count), np.zeros(count, dtype=bool), np.ones(count, dtype=np.int64), ~clear
    )


def _modes(made_of: Integers) -> Integers:
    """The modes as of `batch.LABELS`, by `motion_modes.mode`; what is doubtful moves."""
    turns, slides, rolls, lifts, spins = (
        made_of & flag > 0 for flag in (TURNS, SLIDES, ROLLS, LIFTS, SPINS)
    )
    kinds = (
        (made_of < 0, None),
        (~turns & slides, Mode.SLIDING),
        (~turns & ~rolls, Mode.LIFTING),
        (~turns, None),
        (~rolls & slides, Mode.PIVOTING_AND_SLIDING),
        (~rolls, Mode.LIFTING_AND_ROTATING),
        (slides, Mode.PIVOTING_AND_SLIDING_APART),
        (lifts, Mode.PIVOTING),
        (spins, Mode.SPINNING),
    )
    places = [1 if one is None else 1 + list(Mode).index(one) for _, one in kinds]
    return np.select([where for where, _ in kinds], places, 1 + list(Mode).index(Mode.ROLLING))
