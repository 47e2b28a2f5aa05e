"""What fails while it is being made gives back the memory that PETSc has lent it."""

from __future__ import annotations

import pytest
from domains import square_in_box
from mpi4py import MPI
from ranks_script import box

from incipient.accuracy.dual import GoalErrors
from incipient.coupled.tractions import TractionProbe
from incipient.errors import ConvergenceError
from incipient.fluid import FlowModel, Fluid
from incipient.fluid.solvers.direct import Direct
from incipient.scene import loads
from incipient.scene.file import example
from incipient.simulation.build import prepared


@pytest.fixture
def destroyed(monkeypatch: pytest.MonkeyPatch) -> list[Fluid]:
    """The fluids whose memory has been given back."""
    given: list[Fluid] = []
    destroy = Fluid.destroy

    def noted(self: Fluid) -> None:
        given.append(self)
        destroy(self)

    monkeypatch.setattr(Fluid, "destroy", noted)
    return given


def fail(*arguments: object) -> None:
    raise ConvergenceError("no solution")


def test_an_error_estimate_that_fails(
    destroyed: list[Fluid], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The finer elements' memory goes, the flow itself stays."""
    with Fluid(square_in_box(0.3, 0.5), FlowModel(order=2), box(), 20.0) as fluid:
        monkeypatch.setattr(Fluid, "correct", fail)
        with pytest.raises(ConvergenceError):
            GoalErrors(fluid, "body", (0.8, 0.55))
        (finer,) = destroyed
        assert finer is not fluid and finer.space.order == 3
    assert destroyed == [finer, fluid]


def test_a_fluid_that_fails_while_it_is_made(
    destroyed: list[Fluid], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Matrix and vectors, made before the solver, go."""
    monkeypatch.setattr(Direct, "__init__", fail)
    with pytest.raises(ConvergenceError):
        Fluid(square_in_box(0.3, 0.5), FlowModel(order=2), box(), 20.0)
    (half_made,) = destroyed
    for lent in (
        half_made._matrix,
        half_made._vector,
        half_made._correction,
        half_made._state_view,
    ):
        assert not lent, "the handle of what has been destroyed is null"


def test_a_run_that_fails_while_it_is_prepared(
    destroyed: list[Fluid], monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = loads(example(), overrides=["numerics.mesh_size=6"])
    monkeypatch.setattr(TractionProbe, "__init__", fail)
    with pytest.raises(ConvergenceError), prepared(scene, MPI.COMM_SELF):
        raise AssertionError("prepared all the same")
    assert len(destroyed) == 1
