"""What a checkpoint holds comes back on any mesh numbering; what is not whole is refused; writing is all or nothing."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from domains import ball_in_box, curved_box, ring, square_in_box, unit_box
from mpi4py import MPI

from incipient.errors import OutputError, SceneError
from incipient.files import cut_after
from incipient.fluid import FlowModel, Fluid, Prescribed
from incipient.fluid.transient import Transient
from incipient.interrupt import SAME_WISH, Interruption
from incipient.mesh.domain import Domain
from incipient.output.directory import CHECKPOINT
from incipient.output.runs import reopened
from incipient.planning.discretisation import order_of
from incipient.restart.checkpoint import (
    Checkpoint,
    Progress,
    StoredBody,
    StoredFlow,
    StoredMesh,
    read,
    write,
)
from incipient.restart.redistribution import spread_flow, spread_mesh, stored_flow, stored_mesh
from incipient.scene.file import dumps, loads

COMM = MPI.COMM_SELF
SCENE = """
[domain]
kind = "box"
length = 1.0
height = 1.0
[fluid]
reynolds = 10
scale = "flow"
[flow]
kind = "lid"
velocity = 1.0
[time]
end = 2.0
step = 0.5
"""


# -- meshes and flows ------------------------------------------------------------------------------------------


def renumbered(whole: StoredMesh) -> StoredMesh:
    """The same mesh with nodes and cells in another order."""
    random = np.random.default_rng(3)
    nodes, cells = random.permutation(len(whole.nodes)), random.permutation(len(whole.cells))
    new = np.argsort(nodes)
    return replace(
        whole,
        nodes=whole.nodes[nodes],
        cells=new[whole.cells][cells],
        facets=new[whole.facets],
    )


def lengths(domain: Domain) -> dict[str, float]:
    import dolfinx
    import ufl

    from incipient import compat

    one = dolfinx.fem.Constant(domain.mesh, 1.0)
    found = {name: one * domain.measure(name) for name in domain.names} | {
        "": one * ufl.dx(domain.mesh)
    }
    return {name: dolfinx.fem.assemble_scalar(compat.form(form)) for name, form in found.items()}


@pytest.mark.parametrize(
    "make",
    [
        lambda: unit_box(2, 4),
        lambda: curved_box(2, 3, 3),
        lambda: ring(1.0, 2.0, 16, 2),
        lambda: ring(1.0, 2.0, 16, 3),
        lambda: unit_box(3, 2),
        lambda: ball_in_box(0.3),
    ],
)
def test_a_mesh_comes_back_with_its_boundaries(make: Callable[[], Domain]) -> None:
    """Volume and the area of every named boundary, to round-off; and the same numbering from the same order."""
    domain = make()
    whole = stored_mesh(domain)
    again = spread_mesh(MPI.COMM_WORLD, whole)
    assert np.array_equal(again.mesh.geometry.x, domain.mesh.geometry.x)
    shuffled = spread_mesh(MPI.COMM_WORLD, renumbered(whole))
    assert lengths(again) == pytest.approx(lengths(domain), rel=1e-12)
    assert lengths(shuffled) == pytest.approx(lengths(domain), rel=1e-12)


def test_a_facet_that_is_none_is_refused() -> None:
    whole = stored_mesh(unit_box(2, 3))
    wrong = replace(whole, facets=np.vstack([whole.facets[1:], [[0, 2]]]))
    with pytest.raises(OutputError, match="12 boundary facets are stored, 11 of them"):
        spread_mesh(MPI.COMM_WORLD, wrong)


def streams(domain: Domain, order: int) -> Fluid:
    return Fluid(domain, FlowModel(order=order), [Prescribed("body", lambda x, t: 0 * x)], 1.0)


def fill(fluid: Fluid) -> None:
    """A state that is a different polynomial in each component."""
    x, y = fluid.space.velocity_points()[:, :2].T
    u, v = x**2 - 3 * y, x * y
    a, b = fluid.space.pressure.tabulate_dof_coordinates()[:, :2].T
    fluid.state.x.array[fluid.space.velocity_map] = np.column_stack([u, v]).ravel()
    fluid.state.x.array[fluid.space.pressure_map] = a - 2 * b


@pytest.mark.parametrize("order", [2, 3, 4])
def test_a_flow_finds_its_nodes_by_place(order: int) -> None:
    """On a mesh of another numbering that has been moved as the first one was."""

    def moved(domain: Domain) -> Domain:
        domain.mesh.geometry.x[:, 0] += 0.1 * domain.mesh.geometry.x[:, 1]
        return domain

    domain = moved(square_in_box(0.3, 0.4))
    with streams(domain, order) as fluid:
        fill(fluid)
        whole = stored_mesh(domain)
        flow = stored_flow(fluid, [fluid.state.x.array, 2 * fluid.state.x.array])
    with streams(spread_mesh(MPI.COMM_WORLD, renumbered(whole)), order) as other:
        fill(other)
        for factor, state in zip((1, 2), spread_flow(other, flow), strict=True):
            assert state == pytest.approx(factor * other.state.x.array, abs=1e-13)


def test_a_flow_of_another_mesh_is_refused() -> None:
    with streams(square_in_box(0.3, 0.4), 2) as fluid:
        whole = stored_flow(fluid, [fluid.state.x.array])
    refused = pytest.raises(
        OutputError, match="the stored flow and the stored mesh have different nodes"
    )
    with streams(square_in_box(0.3, 0.3), 2) as other, refused:
        spread_flow(other, whole)


# -- the file --------------------------------------------------------------------------------------------------


def sample(time: float = 1.0, met: bool = False) -> Checkpoint:
    """Something of every kind that a checkpoint may hold."""
    numbers = np.random.default_rng(1).standard_normal
    cells = np.array([[0, 1, 2]])
    mesh = StoredMesh(2, numbers((4, 2)), cells, np.array([[0, 1]]), np.array([7]), {"bed": 7})
    flow = StoredFlow(*(numbers(shape) for shape in ((4, 3), (3, 3), (4, 2, 2), (3, 2))))
    body = StoredBody(
        *(numbers(shape) for shape in ((4, 3), (4, 3), 3, (2, 6), 2, (4, 2, 3))),
        None, 2, 0.1, numbers(3), numbers(3), 0.1, numbers((0, 3)), met,
        [{"time": 0.1, "cells": 5}], np.array([1, 2]),
    )  # fmt: skip
    progress = Progress(2, 0.1 + 0.2, 1e-5, None, {"newton": 3}, {"solves": 4}, {"flow": 0.3}, 1.5)
    times = np.array([time, 0.5])
    return Checkpoint(dumps(loads(SCENE)), progress, mesh, times, flow, body)


def assert_same(first: Any, second: Any) -> None:
    for field in fields(first):
        one, other = getattr(first, field.name), getattr(second, field.name)
        if is_dataclass(one):
            assert_same(one, other)
        elif isinstance(one, np.ndarray):
            assert one.dtype == other.dtype
            assert np.array_equal(one, other)
        else:
            assert one == other and type(one) is type(other)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A checkpoint in a directory with its scene."""
    found = tmp_path / CHECKPOINT
    write(found, sample(), COMM)
    (tmp_path / "scene.toml").write_text(SCENE)
    return found


@pytest.mark.parametrize("body", [True, False])
def test_what_was_written_is_read(path: Path, body: bool) -> None:
    given = sample() if body else replace(sample(), body=None)
    write(path, given, COMM)
    assert_same(given, read(path, COMM))


def test_no_file(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"checkpoint\.h5: no such checkpoint; start a new run"):
        read(tmp_path / CHECKPOINT, COMM)


def test_another_version_names_the_program_that_wrote_it(path: Path) -> None:
    with h5py.File(path, "r+") as file:
        file.attrs["version"], file.attrs["program"] = 99, "incipient 9.9"
    with pytest.raises(
        OutputError, match=r"of version 99, .* reads version 9; .* \(incipient 9\.9\)"
    ):
        read(path, COMM)


def test_another_file(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["velocity"] = 1.0
    with pytest.raises(OutputError, match="is not a checkpoint; give the directory of a run"):
        read(path, COMM)


def _names(group: Any) -> Iterator[str]:
    found: list[str] = []
    group.visit(found.append)
    return iter(found)


def test_nothing_may_be_missing(path: Path) -> None:
    """Whatever dataset or group is taken out is missed by its name."""
    with h5py.File(path) as file:
        names = list(_names(file))
    assert len(names) > 40
    for name in names:
        write(path, sample(), COMM)
        with h5py.File(path, "r+") as file:
            del file[name]
        with pytest.raises(
            OutputError, match=rf"checkpoint\.h5: {name} is missing; start a new run"
        ):
            read(path, COMM)


@pytest.mark.parametrize("damage", ["a byte", 0, 10, 1000, 10_000])
def test_a_damaged_file(path: Path, damage: str | int) -> None:
    """One byte of a number, which HDF5's checksum notices; a file cut after so many bytes."""
    if isinstance(damage, int):
        os.truncate(path, damage)
    else:
        content = path.read_bytes()
        at = content.index(sample().flow.velocities.tobytes())
        path.write_bytes(content[: at + 6] + b"\x55" + content[at + 7 :])
    damaged = r"checkpoint\.h5: cannot be read: it is damaged or incomplete; start a new run"
    with pytest.raises(OutputError, match=damaged) as told:
        read(path, COMM)
    assert "\n" not in str(told.value)


# -- the history -----------------------------------------------------------------------------------------------


def test_a_history_is_cut_back(tmp_path: Path) -> None:
    """To the rows that begin with at most a time; half a row of a killed run goes, too."""
    path = tmp_path / "history.csv"
    for time, left in ((2.0, "t,x\n1.0,5\n2.0,5\n"), (0.5, "t,x\n")):
        path.write_text("t,x\n1.0,5\n2.0,5\n3.0,5\n4")
        cut_after(path, time)
        assert path.read_text() == left
    cut_after(tmp_path / "absent.csv", 1.0)


@pytest.mark.parametrize("left", ["t,x\n1.0,5\n2.0", "", None])
def test_a_history_that_lacks_rows_is_refused_and_stays(tmp_path: Path, left: str | None) -> None:
    path = tmp_path / "history.csv"
    if left is not None:
        path.write_text(left)
    with pytest.raises(
        OutputError, match=r"history\.csv: has lost some of its 2 rows; restore the"
    ):
        cut_after(path, 2.0, 2)
    assert (path.read_text() if path.exists() else None) == left


# -- opening a run again ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("override", "length"), [("time.step=0.1", 0.1), ("time.tolerance=0.01", 0.3)]
)
def test_other_steps_may_be_given(path: Path, override: str, length: float) -> None:
    scene, kept = reopened(path.parent, [override], COMM)
    assert scene.time is not None and override.split("=")[1] in (
        str(scene.time.step),
        str(scene.time.tolerance),
    )
    assert kept.progress.next_length == pytest.approx(
        length
    )  # steps that adapt go on from the last one


@pytest.mark.parametrize(("stored", "given"), [(2, "auto"), (3, "auto"), (3, 3), ("auto", 3)])
def test_the_order_is_that_of_the_stored_flow(path: Path, stored: Any, given: Any) -> None:
    """Where "auto" means another one now, and where what it means is said."""
    order = '"auto"' if stored == "auto" else stored
    write(path, replace(sample(), scene=f"{SCENE}[numerics]\norder = {order}\n"), COMM)
    scene, _ = reopened(path.parent, [f"numerics.order={given}"], COMM)
    assert order_of(scene) == (2 if stored == 2 else 3)


def test_a_later_end_may_be_given(path: Path) -> None:
    scene, kept = reopened(path.parent, ["time.end=5"], COMM)
    assert scene.time is not None and scene.time.end == 5.0
    assert kept.time == 1.0


@pytest.mark.parametrize(
    ("override", "told"),
    [
        (
            "fluid.reynolds=20",
            r"scene\.toml: fluid\.reynolds is 20\.0, but the run to resume has 10\.0",
        ),
        (
            "time.scheme=bdf1",
            r"time\.scheme is bdf1, .* has bdf2; keep that value \(only time\.end, .* may change\)",
        ),
        ("numerics.order=2", r"numerics\.order is 2, but the run to resume has 3; "),
        ("output.fields=false", r"output\.fields is False, but the run to resume has True"),
        ("time.end=1.0", r"has already reached t = 1, and time\.end is 1; .* --set time\.end=2"),
    ],
)
def test_another_scene_is_refused_by_name(path: Path, override: str, told: str) -> None:
    with pytest.raises(SceneError, match=told):
        reopened(path.parent, [override], COMM)


def test_a_scene_edited_in_the_directory_is_refused(path: Path) -> None:
    (path.parent / "scene.toml").write_text(SCENE.replace("height = 1.0", "height = 2.0"))
    with pytest.raises(SceneError, match=r"domain\.height is 2\.0, but the run to resume has 1\.0"):
        reopened(path.parent, [], COMM)


def test_a_grain_that_has_met_something_does_not_go_on(path: Path) -> None:
    write(path, sample(met=True), COMM)
    with pytest.raises(
        SceneError,
        match=r"its grain reached the bed or a wall; to resume it set a smaller contact\.gap",
    ):
        reopened(path.parent, [], COMM)


# -- time integration ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("accuracy", [None, 1e-3])
@pytest.mark.parametrize("order", [1, 2])
def test_steps_go_on_as_if_nothing_had_happened(order: int, accuracy: float | None) -> None:
    """Adaptive steps, too: lengths, errors and states of a new time integration given the past of another."""

    def stream(x: np.ndarray, t: float) -> np.ndarray:
        return np.vstack([np.sin(3 * t) * x[1], t**3 * x[0]])

    def fluid() -> Fluid:
        sides = [Prescribed(name, stream) for name in ("left", "right", "bottom", "top")]
        return Fluid(unit_box(2, 2), FlowModel(unsteady=True), sides, reynolds=10.0)

    with fluid() as one, fluid() as other:
        first = Transient(one, order, 1e-12, accuracy)
        steps = first.march(0.6, 0.1)
        for _ in range(3):
            next(steps)
        second = Transient(other, order, 1e-12, accuracy)
        other.time, other.state.x.array[:] = one.time, one.state.x.array
        second.resume(first.number, first.next_length, first.past, first.last_error)
        for expected, found in zip(list(steps), list(second.march(0.6, 0.1)), strict=True):
            assert (found.number, found.time) == (
                expected.number,
                pytest.approx(expected.time, rel=1e-10),
            )
            assert found.error == pytest.approx(expected.error, rel=1e-6)
        assert other.state.x.array == pytest.approx(one.state.x.array, abs=1e-10)


# -- interrupts ------------------------------------------------------------------------------------------------


def test_the_first_signal_is_a_wish_a_later_one_an_interrupt(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    now = 0.0
    monkeypatch.setattr("incipient.interrupt.time.monotonic", lambda: now)
    with Interruption(COMM) as interruption:
        interruption.armed = True
        assert not interruption.asked()
        os.kill(os.getpid(), signal.SIGTERM)
        assert interruption.asked()
        now = 0.9 * SAME_WISH
        os.kill(os.getpid(), signal.SIGINT)  # as mpirun passes one on
        now = 1.1 * SAME_WISH
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
    assert capfd.readouterr().err == "stopping after this step; once more to stop at once\n"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_before_the_first_step_a_signal_interrupts_at_once(number: int) -> None:
    before = [signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)]
    with pytest.raises(KeyboardInterrupt), Interruption(COMM):
        os.kill(os.getpid(), number)
    assert [signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)] == before
