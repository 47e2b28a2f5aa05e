"""Questions to circular friction cones, answered by small second-order cone programs (Clarabel).

A scaled force phi = (normal, two tangential) of a contact is in the unit cone |tangential| <= normal; times
`FrictionLaw.scaling` it is a local force in the friction cone. All scaled forces that balance a wrench w are
-inverse w + null z, so equilibrium holds to round-off whatever the program leaves.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import clarabel
import numpy as np
from numpy.typing import NDArray

from incipient.arrays import Floats
from incipient.contact.exact.grasp import Grasp

RANK = 1e-10  # singular values below it, relative to the largest, count as zero
GAP = 1e-11  # tolerance of the cone programs, in numbers of order one
SNAPPED = 1e-14  # misses below it are round-off
EDGE, APEX = 1e-6, 3e-8  # room in a cone, and forces relative to the largest, that count as none
TRIPLE = clarabel.SecondOrderConeT(3)
ANSWERED = (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved)


@dataclass(frozen=True, eq=False)
class Balance:
    """How scaled contact forces balance wrenches."""

    matrix: Floats  # (6, 3k): wrench of scaled forces
    inverse: Floats  # (3k, 6): its pseudo-inverse
    null: Floats  # (3k, m): an orthonormal basis of scaled forces that balance themselves
    beyond: Floats  # (6, r): of wrenches that no contact force has


def balance(grasp: Grasp) -> Balance:
    """The pseudo-inverse, null space and unreachable wrenches of the contacts."""
    matrix = (grasp.matrix * grasp.law.scaling).reshape(6, -1)
    left, sizes, right = np.linalg.svd(matrix)
    rank = int((sizes > RANK * sizes[0]).sum())
    inverse = (right[:rank].T / sizes[:rank]) @ left[:, :rank].T
    return Balance(matrix, inverse, right[rank:].T, left[:, rank:])


def slack(scaled: Floats) -> Floats:
    """normal - |tangential| of scaled forces (3k,): negative outside the cone, (k,)."""
    table = scaled.reshape(-1, 3)
    return np.asarray(table[:, 0] - np.hypot(table[:, 1], table[:, 2]))


def most_inside(forces: Balance, wrench: Floats) -> tuple[float, Floats]:
    """The largest margin <= 1 by which contact forces that balance a wrench stay inside, and the forces.

    Maximises m under: scaled force - m (1, 0, 0) in the unit cone at every contact. Negative: not balanced.
    """
    start, size = -forces.inverse @ wrench, forces.null.shape[1]
    margin = float(slack(start).min())
    if size == 0 or margin >= 1.0:
        return min(margin, 1.0), start
    normal = np.tile([1.0, 0.0, 0.0], len(start) // 3)
    rows = np.vstack([np.zeros(size + 1), np.column_stack([-forces.null, normal])])
    rows[0, size] = 1.0
    answer = minimum(-rows[0], rows, np.concatenate([[1.0], start]), nonnegative=1)
    found = start + forces.null @ answer[:size] if answer is not None else start
    return float(slack(found).min()), found


def largest_share(forces: Balance, flow: Floats, weight: Floats) -> tuple[float, Floats] | None:
    """The largest share a in [0, 1] such that forces balance a flow + (1 - a) weight, and the forces (3k,).

    None if no share is balanced. `flow` and `weight` must be wrenches that contact forces can have.
    """
    start, size = -forces.inverse @ weight, forces.null.shape[1]
    change = -forces.inverse @ (flow - weight)
    basis = np.column_stack([forces.null, change])
    rows = np.vstack([np.zeros((2, size + 1)), -basis])
    rows[:2, size] = 1.0, -1.0
    answer = minimum(-rows[0], rows, np.concatenate([[1.0, 0.0], start]), nonnegative=2)
    if answer is None:
        return None
    answer = snapped(start, basis, answer)
    return float(np.clip(answer[size], 0.0, 1.0)), start + basis @ answer


def share_bound(columns: Floats, single: int, first: Floats, second: Floats) -> float | None:
    """An upper bound, close to round-off, of the largest a in [0, 1] with columns x + a first + (1 - a) second = 0.

    x: scaled forces, and last a number `single` of unknowns >= 0. None if no a does, for which the program has a
    certificate; 1 if it is not answered. The value of the dual program is what is given: it is a bound from above.
    """
    height, width = columns.shape
    rows = np.zeros((height + 2 + width, width + 1))
    rows[:height, :width], rows[:height, width] = columns, first - second
    rows[height : height + 2, width] = 1.0, -1.0
    rows[height + 2 : height + 2 + single, width - single : width] = -np.eye(single)
    rows[height + 2 + single :, : width - single] = -np.eye(width - single)
    limits = np.zeros(len(rows))
    limits[:height], limits[height] = -second, 1.0
    solution = _run(-np.eye(width + 1)[width], rows, limits, nonnegative=2 + single, equal=height)
    if solution.status == clarabel.SolverStatus.PrimalInfeasible:
        return None
    if solution.status not in ANSWERED:
        return 1.0
    return float(np.clip(max(-solution.obj_val_dual, solution.x[width]), 0.0, 1.0))


def can_jam(forces: Balance) -> bool:
    """Whether contact forces in the cones, not all zero, balance one another."""
    if forces.null.shape[1] == 0:
        return False
    count = len(forces.null) // 3
    total = np.tile([1.0, 0.0, 0.0], count) @ forces.null
    limits = np.concatenate([[1.0], np.zeros(3 * count)])
    answer = minimum(-total, np.vstack([total, -forces.null]), limits, nonnegative=1)
    return answer is not None and bool(total @ answer > 0.5)


def associated(
    forces: Balance, mass: Floats, wrench: Floats, rise: Floats
) -> tuple[Floats, Floats] | None:
    """Acceleration (6,) and scaled forces (3k,) of the convex problem with given sliding.

    Minimises y.mass.y / 2 - wrench.y under: matrix^T y + (rise, 0, 0) in the unit cone at every contact. With
    rise = sine * |tangential acceleration| that is Coulomb's law (De Saxce and Feng 1998); with rise = 0 slip
    dilates, and y = 0 exactly if the wrench is balanced.
    """
    limits = np.zeros((len(rise), 3))
    limits[:, 0] = rise
    solution = _run(-wrench, -forces.matrix.T, limits.ravel(), quadratic=mass)
    if solution.status not in ANSWERED:
        return None
    return np.array(solution.x), np.array(solution.z)


def frictionless(mass: Floats, pressures: Floats, wrench: Floats) -> tuple[Floats, Floats]:
    """The y that minimises y.mass.y / 2 - wrench.y under pressures^T y >= 0, (6,), and the pressures (k,)."""
    count = pressures.shape[1]
    solution = _run(-wrench, -pressures.T, np.zeros(count), nonnegative=count, quadratic=mass)
    return np.array(solution.x), np.array(solution.z)


def snapped(start: Floats, basis: Floats, answer: Floats) -> Floats:
    """The answer moved so that forces near the edge or the apex of their cones are on it, by Newton's method.

    Scaled forces are start + basis answer.
    """
    rows = basis.reshape(len(start) // 3, 3, -1)
    for _ in range(2):
        table = (start + basis @ answer).reshape(-1, 3)
        shear = np.hypot(table[:, 1], table[:, 2])
        gaps = table[:, 0] - shear
        apex = table[:, 0] < APEX * table[:, 0].max()
        edge = ~apex & (np.abs(gaps) < EDGE * np.maximum(table[:, 0], 1e-2))
        outward = np.ones_like(table)
        outward[:, 1:] = -table[:, 1:] / np.maximum(shear, 1e-300)[:, None]
        wanted = np.vstack(
            [(outward[edge, None] @ rows[edge])[:, 0], rows[apex].reshape(-1, basis.shape[1])]
        )
        missed = np.concatenate([gaps[edge], table[apex].ravel()])
        if len(missed) == 0 or np.abs(missed).max() < SNAPPED:
            break
        moved = answer - np.linalg.lstsq(wanted, missed, rcond=1e-8)[0]
        if slack(start + basis @ moved).min() <= gaps.min():
            break
        answer = moved
    return answer


def minimum(
    linear: Floats,
    rows: Floats,
    limits: Floats,
    nonnegative: int = 0,
    quadratic: Floats | None = None,
) -> Floats | None:
    """The x that minimises x.quadratic.x / 2 + linear.x under limits - rows x in the cones, if there is one."""
    solution = _run(linear, rows, limits, nonnegative, quadratic)
    return np.array(solution.x) if solution.status in ANSWERED else None


def _run(
    linear: Floats,
    rows: Floats,
    limits: Floats,
    nonnegative: int = 0,
    quadratic: Floats | None = None,
    equal: int = 0,
) -> Any:
    """Minimise x.quadratic.x / 2 + linear.x under limits - rows x in the cones.

    The first `equal` rows are equations, the next `nonnegative` plain inequalities, the others triples in unit
    circular cones.
    """
    height, width = rows.shape
    table, square = ConeTable(rows.T.ravel(), *_dense_pattern(height, width)), _zero_table(width)
    if quadratic is not None:
        square = ConeTable(np.triu(quadratic).T.ravel(), *_dense_pattern(width, width))
    cones: list[Any] = [clarabel.ZeroConeT(equal)] if equal else []
    cones += [clarabel.NonnegativeConeT(nonnegative)] if nonnegative else []
    cones += [TRIPLE] * ((height - equal - nonnegative) // 3)
    return clarabel.DefaultSolver(square, linear, table, limits, cones, _settings()).solve()


@dataclass(frozen=True, eq=False)
class ConeTable:
    """A matrix as Clarabel reads it, column by column, by the names that scipy's has; making that takes longer."""

    data: Floats
    indices: NDArray[np.int32]
    indptr: NDArray[np.int32]
    shape: tuple[int, int]
    has_canonical_format: bool = True


@lru_cache(maxsize=256)
def _dense_pattern(
    height: int, width: int
) -> tuple[NDArray[np.int32], NDArray[np.int32], tuple[int, int]]:
    """Row indices, starts of columns and shape of a table without zeros."""
    indices = np.tile(np.arange(height, dtype=np.int32), width)
    return indices, np.arange(width + 1, dtype=np.int32) * np.int32(height), (height, width)


@lru_cache(maxsize=256)
def _zero_table(width: int) -> ConeTable:
    """A square table of zeros."""
    nothing, starts = np.zeros(0, dtype=np.int32), np.zeros(width + 1, dtype=np.int32)
    return ConeTable(np.zeros(0), nothing, starts, (width, width))


@lru_cache(maxsize=1)
def _settings() -> Any:
    """Clarabel's settings, which every solver copies."""
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.presolve_enable = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = GAP
    return settings
