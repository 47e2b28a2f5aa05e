"""How incipient motions are computed: the smallest contact forces, and what is compiled for it.

In the plane: x downstream, y up. Normals point out of the grain; weights and masses are one.
"""

import subprocess
import sys

import numpy as np
import pytest

from incipient.contact import Contacts, Load
from incipient.contact.acceleration import AccelerationProblem, Mode, incipient_motion
from incipient.contact.impulses import CoulombLaw, _differentiate
from incipient.contact.problem import Kernel
from incipient.contact.safety import safety_rows

X = np.arange(-2.0, 3.0)
ROW = Contacts(np.column_stack([X, np.zeros((5, 2))]), [[0.0, -1.0, 0.0]] * 5)


def on_row(push, x, height, friction):
    """The motion of a grain on the row with its centre at (x, height), pushed downstream."""
    acting = Load([push, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, -1.0, 0.0], [x, height, 0.0])
    return incipient_motion(acting, ROW, friction, 1.0, np.eye(3))


class TestSmallestForces:
    """Of several sets of forces that give the same accelerations the one with the least sum of squares."""

    @pytest.mark.parametrize("friction", [0.0, 0.5])
    def test_loaded_at_the_end(self, friction):
        # Without limits they vary linearly along the row, and would pull at its other end. With the last two
        # alone, 0.1 and 0.9 for a load at 1.9, the line through both is below zero at all others.
        result = on_row(0.0, 1.9, 0.3, friction)
        assert result.contact_forces[:, 1] == pytest.approx([0.0, 0.0, 0.0, 0.1, 0.9], abs=1e-12)
        assert result.contact_forces[:, 0] == pytest.approx(np.zeros(5), abs=1e-12)
        assert not result.solutions[0].forces_unique

    def test_at_the_edge_of_their_cones(self):
        # With multipliers a, b, t of the three balances: N_i = a + b x_i, T_i = t inside the cones, and on their
        # edge T = -m N the nearest to it, N_i = (a + b x_i - m t) / (1 + m^2). The first two contacts are.
        friction, edge = 0.5, X < -0.5
        normal = np.where(edge, 1.0 / (1.0 + friction**2), 1.0) * np.array(
            [np.ones(5), X, -friction * edge]
        )
        shear = np.where(edge, -friction * normal, [[0.0], [0.0], [1.0]])
        balances = np.array([normal.sum(axis=1), (X * normal).sum(axis=1), shear.sum(axis=1)])
        multipliers = np.linalg.solve(balances, [1.0, 0.1 + 0.4 * 1.0, -0.4])
        result = on_row(0.4, 0.1, 1.0, friction)
        assert result.mode is Mode.REST
        assert result.contact_forces[:, 1] == pytest.approx(multipliers @ normal, abs=1e-10)
        assert result.contact_forces[:, 0] == pytest.approx(multipliers @ shear, abs=1e-10)


def missed(law: CoulombLaw, force):
    """Forces minus the projection of f - r A on the discs of friction, (3k,)."""
    projection = (force @ law.onto + law.offset).reshape(-1, 3)
    projection[:, 0] = np.maximum(projection[:, 0], 0.0)
    size = np.hypot(projection[:, 1], projection[:, 2])
    projection[:, 1:] *= np.minimum(law.friction * projection[:, 0] / size, 1.0)[:, None]
    return force - projection.ravel()


def law_of_three_contacts() -> CoulombLaw:
    """Of a sphere in a pocket of three, pushed and turned."""
    around = np.radians([10.0, 120.0, 250.0])
    normals = np.column_stack([0.6 * np.cos(around), 0.6 * np.sin(around), np.full(3, -0.8)])
    acting = Load([0.5, 0.2, 0.1], [0.0, 0.01, 0.02], [0.0, 0.0, -1.0], [0.0, 0.0, 0.0])
    contacts = Contacts(0.5 * normals, normals)
    return AccelerationProblem.of(acting, contacts, 0.4, 1.0, 0.1 * np.eye(3)).law


FRESH = """
import sys
import numpy as np
from incipient.contact import Contacts, Load, judge
corners = [[x, y, 0] for x in (-1, 1) for y in (-1, 1)]
normals = np.tile([0.0, 0.0, -1.0], (4, 1))
for push in (0.1, 0.7):
    load = Load([push, 0.1, 0], [0, 0, 0], [0, 0, -1], [0, 0, 1])
    print(judge(load, Contacts(corners, normals), 0.5, (1.0, np.eye(3))).moves)
print(*(name in sys.modules for name in ("numba", "clarabel", "dolfinx")))
"""


class TestCompiled:
    def test_a_single_verdict_needs_no_compiler(self):
        done = subprocess.run(
            [sys.executable, "-c", FRESH], capture_output=True, text=True, check=True
        )
        assert done.stdout.split() == ["False", "True", "False", "False", "False"]

    def test_derivative(self):
        # Central differences of Coulomb's law at forces on neither side of a kink.
        law, near, found = law_of_three_contacts(), 1e-6 * np.eye(9), np.empty((9, 9))
        for force in np.random.default_rng(1).normal(size=(40, 9)):
            _differentiate(law.onto, law.friction, force @ law.onto + law.offset, found)
            expected = [(missed(law, force + d) - missed(law, force - d)) / 2e-6 for d in near]
            assert found == pytest.approx(np.transpose(expected), abs=1e-8)

    def test_compiled_and_interpreted_agree(self):
        """The same function before and after numba; forces are known to the root of what the program leaves."""
        random = np.random.default_rng(5)
        rows = random.normal(size=(3, 6, 12))
        one = rows, random.normal(size=(3, 6)), random.normal(size=(3, 6)), 0
        kernel = Kernel(safety_rows)
        slow = kernel(*one)
        kernel.left = 0
        fast = kernel(*one)
        assert kernel.compiled is not None
        for before, after, close in zip(slow, fast, (1e-11, 1e-11, 0.0, 1e-7), strict=True):
            assert after == pytest.approx(before, nan_ok=True, abs=close)
