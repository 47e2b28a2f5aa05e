"""Linear systems of flow and turbulence in space, beside numpy's solution, with factors of the flow that are off."""

import numpy as np
import pytest
from petsc4py import PETSc

from incipient.fluid.solvers import direct
from incipient.turbulence import linear
from incipient.turbulence.coupled_flow import half_where_reversed
from incipient.turbulence.linear import ROUGH, BlockByBlock, CompressedFactors

ROWS = 40


def sparse(entries):
    matrix = (
        PETSc.Mat().createDense(entries.shape, array=entries, comm=PETSc.COMM_SELF).convert("aij")
    )
    matrix.assemble()
    return matrix


@pytest.fixture
def blocks():
    """Four blocks (ROWS, ROWS), those on the diagonal well conditioned; k and omega act on each other."""
    made = np.random.default_rng(1).standard_normal((2, 2, ROWS, ROWS))
    for one in (0, 1):
        made[one, one] += 20.0 * np.eye(ROWS)
    for k, omega, sign in ((0, 1, 1.0), (1, 0, -1.0)):
        made[1, 1, k::2, omega::2] += 20.0 * sign * np.eye(ROWS // 2)
    return made


@pytest.fixture
def solver(blocks, monkeypatch):
    """With factors of the flow's block that are wrong in one direction, as those that leave something out may be."""

    class Off(CompressedFactors):
        def __init__(self, matrix):
            wrong = blocks[0, 0].copy()
            wrong[:, 0] *= 4.0
            super().__init__(sparse(wrong))

    monkeypatch.setattr(linear, "CompressedFactors", Off)
    nest = PETSc.Mat().createNest(
        [[sparse(one) for one in row] for row in blocks], comm=PETSc.COMM_SELF
    )
    nest.assemble()
    made = BlockByBlock(nest)
    made.prepare()
    yield made
    made.destroy()


def solved(solver):
    right, x = solver.matrix.createVecs()
    right.setArray(np.linspace(1.0, 2.0, 2 * ROWS))
    solver.approximate(right, x)
    return right.array.copy(), x.array.copy()


def test_together_both_are_solved_though_the_factors_are_off(solver, blocks):
    b, x = solved(solver)
    whole = np.block([list(row) for row in blocks])
    assert np.linalg.norm(whole @ x - b) <= 1.01 * ROUGH * np.linalg.norm(b)


def test_k_and_omega_are_solved_at_once(solver, monkeypatch):
    """Where the flow depends on no turbulence GMRES needs two applications, for factors wrong in one direction."""
    block = solver.matrix.getNestSubMatrix(0, 1)
    block.zeroEntries()
    block.assemble()
    applied = []
    once = BlockByBlock.apply
    monkeypatch.setattr(
        BlockByBlock, "apply", lambda self, *given: applied.append(once(self, *given))
    )
    solved(solver)
    assert len(applied) <= 3  # the last one makes the solution of what the two span


def test_where_there_is_no_memory_for_factors_it_is_told(blocks, monkeypatch, caplog):
    """0.6 of 440 n^(4/3) bytes of 40 unknowns are 36 kB, of which twice as much must be free."""
    nest = PETSc.Mat().createNest(
        [[sparse(one) for one in row] for row in blocks], comm=PETSc.COMM_SELF
    )
    nest.assemble()
    for free, told in ((78e3, 0), (66e3, 1)):
        monkeypatch.setattr(direct, "free_bytes", lambda free=free: free)
        BlockByBlock(nest).destroy()
        assert (
            sum("more than half of the free memory" in one.message for one in caplog.records)
            == told
        )


def test_what_factors_cannot_solve_is_not_finite(solver, blocks):
    """A matrix without an inverse, to whose range the right-hand side does not belong."""
    for column in (0, 1):
        block = solver.matrix.getNestSubMatrix(0, column)
        block.zeroEntries()
        block.assemble()
    _, x = solved(solver)
    assert np.isinf(x).all()


def test_turns_that_newtons_method_takes_end():
    """Newton's whole corrections of arctan(x) = 0 from 1.5 go to and fro and grow."""
    x, last = np.array([1.5]), 0.0
    for _ in range(30):
        last = half_where_reversed(-np.arctan(x) * (1.0 + x**2), last)
        x = x + last
    assert abs(x[0]) < 1e-6


def test_changes_that_go_on_or_shrink_are_whole():
    last = np.array([1.0, 1.0, 1.0, 0.0])
    assert half_where_reversed(np.array([0.8, -0.4, -0.6, -2.0]), last).tolist() == [
        *(0.8, -0.4, -0.3, -2.0)
    ]
