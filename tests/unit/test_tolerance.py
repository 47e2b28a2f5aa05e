"""What iterations may leave: given, or a share of a step's own error."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from domains import unit_box

from incipient.fluid import FlowModel, Fluid, Prescribed
from incipient.fluid.transient import LEAST, ShareOfError, Transient, of_steps
from incipient.planning.tolerance import STEADY, of_steady


def vortex(x: np.ndarray, t: float) -> np.ndarray:
    return np.sin(4 * t) * np.vstack([np.sin(3 * x[1]), np.sin(2 * x[0])])


@pytest.fixture
def fluid() -> Any:
    sides = [Prescribed(name, vortex) for name in ("left", "right", "bottom", "top")]
    with Fluid(unit_box(2, 3), FlowModel(unsteady=True), sides, reynolds=50.0) as made:
        yield made


@pytest.mark.parametrize(
    ("error", "expected"), [(None, 1e-6), (1e-3, 2e-4), (1e-5, 2e-6), (1e-12, 1e-8), (1.0, 1e-3)]
)
def test_a_share_of_the_error_between_bounds(error: float | None, expected: float) -> None:
    assert ShareOfError(0.2, 1e-6, 1e-8, 1e-3).after(error) == pytest.approx(expected)


def test_auto_and_given() -> None:
    assert (of_steady("auto"), of_steady(1e-4)) == (STEADY, 1e-4)
    assert (of_steps("auto"), of_steps(1e-4), of_steps(1e-14)) == (ShareOfError(), 1e-4, LEAST)


def test_each_step_is_solved_to_a_share_of_the_error_of_the_one_before(fluid: Fluid) -> None:
    """The tolerance follows the error as it grows and falls, and is kept by the error left."""
    asked = ShareOfError(0.1, 1e-7, 1e-12, 1.0)
    steps = list(Transient(fluid, tolerance=asked).march(1.0, 0.02))
    errors = [None, *(step.error for step in steps)]
    for step, error in zip(steps, errors, strict=False):
        assert step.tolerance == asked.after(error)
        assert step.report.error <= step.tolerance
    known = [step.error for step in steps if step.error]
    assert max(known) > 3 * min(known)


def test_one_correction_a_step_is_enough_for_most(fluid: Fluid) -> None:
    """What is left then is indeed below the tolerance, as a solution to round-off shows step by step."""
    transient = Transient(fluid, tolerance=ShareOfError(0.1, 1e-7, 1e-12, 1.0))
    alone = 0
    for step in transient.march(1.0, 0.02):
        if step.report.iterations == 1:
            alone += 1
            found = fluid.state.x.array.copy()
            fluid.correct()
            left = fluid.squared_velocities(fluid.state.x.array - found) ** 0.5
            assert left <= step.tolerance * fluid.squared_velocities(found) ** 0.5
            fluid.state.x.array[:] = found
            fluid.renew_factors()
    assert alone > 0


def test_corrections_are_saved(fluid: Fluid) -> None:
    """Over a whole run with the default: fewer than two thirds of what solving to 1e-9 takes."""
    counts = []
    for tolerance in (ShareOfError(), 1e-9):
        fluid.time, fluid.state.x.array[:] = 0.0, 0.0
        steps = list(Transient(fluid, tolerance=tolerance).march(1.0, 0.01))
        counts.append(sum(step.report.iterations for step in steps))
    assert counts[0] < 2 / 3 * counts[1]


@pytest.mark.parametrize("order", [1, 2])
def test_errors_told_by_states_of_two_meshes_are_not_believed(fluid: Fluid, order: int) -> None:
    """The tolerance after a new mesh goes by the error before it, in a run that is resumed in between as well."""
    transient = Transient(fluid, order, ShareOfError())
    list(transient.march(0.5, 0.1))
    new_mesh, small = fluid.time, 1e-9
    transient.continue_on(fluid, None, transient.past)
    transient.last_error = small  # as small as no step here errs
    transient.advance(0.1)
    resumed = Transient(fluid, order, ShareOfError())
    resumed.resume(
        transient.number, transient.next_length, transient.past, transient.last_error, new_mesh
    )
    for _ in range(order):
        resumed.advance(0.1)
        assert resumed.last_error == small
    resumed.advance(0.1)
    assert resumed.last_error is not None and resumed.last_error > 10.0 * small
