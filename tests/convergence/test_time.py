"""Orders of convergence in time, and steps that follow a tolerance.

The flows are polynomials in space that P2-P1 holds exactly, also on meshes moved by maps that are affine in space: only
time errs. Source of the orders: BDF1 1, BDF2 2, with variable steps too while the ratio of neighbouring
steps stays below 1 + sqrt(2) (Grigorieff 1983).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from domains import unit_box
from manufactured import Flow, Motion, errors, fluid_of, orders, start_from
from moving import Swaying

from incipient.fluid import FlowModel, Fluid
from incipient.fluid import transient as in_time
from incipient.fluid.transient import Transient

REYNOLDS, END = 10.0, 1.0

FLOW = Flow(
    2,
    lambda x, t, m: (m.sin(2 * t) + x[1] ** 2 * m.cos(2 * t), x[0] ** 2 * m.sin(3 * t)),
    lambda x, t, m: (x[0] - 2 * x[1]) * m.cos(2 * t),
)
STRETCHING = Motion(
    lambda x, t, m: (
        0.2 * m.sin(2 * t) * x[0] + 0.3 * t**2 * x[1],
        0.2 * (m.cos(3 * t) - 1) * x[1],
    )
)
# At rest, then a burst about t = 0.5 that lasts a tenth.
BURST = Flow(
    2,
    lambda x, t, m: tuple(
        (1.2 + m.tanh(20 * (t - 0.5))) * square for square in (x[1] ** 2, x[0] ** 2)
    ),
    lambda x, t, m: x[0] - x[1],
)


def constant(n: int) -> list[float]:
    return [END / n] * n


def alternating(n: int) -> list[float]:
    """n steps, one twice as long as the other in turn."""
    return [END / (1.5 * n), 2 * END / (1.5 * n)] * (n // 2)


# Steps alike are a special case.
lengths = pytest.mark.parametrize(
    "steps", [pytest.param(constant, marks=pytest.mark.slow), alternating]
)


def errors_after(steps: Sequence[float], order: int, model: FlowModel) -> np.ndarray:
    """L2 errors of velocity and pressure at the end, on a mesh at rest or moved before each step."""
    domain = unit_box(2, 2)
    made = domain.mesh.geometry.x.copy()
    with fluid_of(FLOW, domain, model, REYNOLDS) as fluid:
        start_from(fluid, FLOW)
        stretching = Swaying(fluid, lambda time: STRETCHING.place(made.T, time).T)
        interface = stretching if model.moving_mesh else None
        transient = Transient(fluid, order, 1e-10, interface=interface)
        for step in steps:
            assert not transient.advance(step).rejected
        result = errors(fluid, FLOW)
    return np.array([result.velocity, result.pressure])


@pytest.mark.parametrize("moving", [False, True], ids=["fixed", "moving"])
@pytest.mark.parametrize("convection", ["implicit", "extrapolated"])
@lengths
@pytest.mark.parametrize("order", [1, 2])
def test_order_in_time(order: int, steps: Any, convection: str, moving: bool) -> None:
    counts = [64, 128] if moving else [32, 64]
    model = FlowModel(unsteady=True, convection=convection, moving_mesh=moving)
    result = np.array([errors_after(steps(n), order, model) for n in counts])
    observed = [orders([1 / n for n in counts], column) for column in result.T]
    print(order, steps.__name__, convection, moving, result[-1], observed)
    # The next term of the error makes a tenth of an order at these steps.
    assert [o[-1] for o in observed] == pytest.approx([order, order], abs=0.15)


def started(flow: Flow) -> Fluid:
    fluid = fluid_of(flow, unit_box(2, 2), FlowModel(unsteady=True), REYNOLDS)
    start_from(fluid, flow)
    return fluid


def largest_error(flow: Flow, order: int, accuracy: float, step: float) -> float:
    """The largest velocity error of a run with steps that follow the accuracy."""
    with started(flow) as fluid:
        transient = Transient(fluid, order, tolerance=1e-11, accuracy=accuracy)
        return max(errors(fluid, flow).velocity for _ in transient.march(END, step))


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 2])
def test_error_follows_the_tolerance(order: int) -> None:
    """With the local error kept at the tolerance the global error goes as tolerance^(k / (k + 1))."""
    tolerances = [1e-2, 1e-3] if order == 1 else [1e-3, 1e-4, 1e-5]
    result = [largest_error(BURST, order, tolerance, 0.1) for tolerance in tolerances]
    print(result, orders(tolerances, result))
    # Steps change by quarters and are few at loose tolerances: 0.720 and 0.647 of order two.
    assert orders(tolerances, result) == pytest.approx(
        [order / (order + 1)] * (len(result) - 1), abs=0.1
    )
    assert all(error < 10 * tolerance for error, tolerance in zip(result, tolerances, strict=True))


def test_error_does_not_depend_on_the_first_step() -> None:
    """Nothing tells the error of the first step: it must be short by itself."""
    short, long = (largest_error(FLOW, 2, 1e-4, step) for step in (0.01, 0.25))
    assert long == pytest.approx(short, rel=0.01)


def test_rejected_steps_leave_no_trace() -> None:
    """A run with rejections ends where a run of its accepted steps ends."""
    with started(BURST) as fluid:
        transient = Transient(fluid, 2, tolerance=1e-11, accuracy=1e-3)
        steps = list(transient.march(END, 0.1))
        expected = fluid.state.x.array.copy()
    assert sum(step.rejected for step in steps) > 0
    with started(BURST) as fluid:
        transient = Transient(fluid, 2, tolerance=1e-11)
        for step in steps:
            transient.advance(step.length)
        assert fluid.time == pytest.approx(END, rel=1e-14)
        assert np.abs(fluid.state.x.array - expected).max() < 1e-8 * np.abs(expected).max()


@pytest.mark.parametrize("order", [1, 2])
def test_order_in_time_of_steps_solved_to_a_share_of_their_error(
    order: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Iterations that leave a tenth of a step's error, most of them after one correction, keep the order."""
    monkeypatch.setattr(in_time, "MOST", 1.0)
    counts, result, corrections = [32, 64, 128], [], 0
    for n in counts:
        with started(FLOW) as fluid:
            transient = Transient(fluid, order, tolerance="auto")
            steps = [transient.advance(step) for step in constant(n)]
            result.append(errors(fluid, FLOW).velocity)
            corrections += sum(step.report.iterations for step in steps)
    observed = orders([1 / n for n in counts], result)
    print(order, result, observed, corrections / sum(counts))
    # Beside the next term of the error there is what the iterations leave, a tenth of it.
    assert observed == pytest.approx([order] * 2, abs=0.15)
    # First-order steps take 449 updates: of one step alone two do not suffice, since boundary values jump in the first.
    assert corrections <= 2.0 * sum(counts) + 1


def test_kinks_keep_the_order() -> None:
    """The differences begin anew there as at the start: two steps without an error, the first one of first order."""
    counts, result = [40, 80], []
    for n in counts:
        with started(FLOW) as fluid:
            transient = Transient(fluid, 2, 1e-10, kinks=[0.3, 0.7])
            steps = list(transient.march(END, END / n))
            result.append(errors(fluid, FLOW).velocity)
        first = [round(time * n) + 1 for time in (0.0, 0.3, 0.7)]
        unknown = [step.number for step in steps if step.error is None]
        assert unknown == [number + k for number in first for k in (0, 1)]
    assert orders([1 / n for n in counts], result) == pytest.approx([2.0], abs=0.15)


def test_steps_of_a_resumed_run_end_at_the_same_stops() -> None:
    """Two stops that differ by round-off of the end are one, whenever the steps begin."""
    with started(FLOW) as fluid:
        transient = Transient(fluid, 2, 1e-6)
        stops = [0.9 * END * (1.0 - 1e-9), 0.9 * END]
        whole = transient.march(END, 0.1 * END, stops=stops)
        lengths = [next(whole).length for _ in range(8)]
        lengths += [step.length for step in transient.march(END, 0.1 * END, stops=stops)]
    assert lengths == pytest.approx([0.1 * END] * 10)
