"""Wall time and memory by stage and by effect."""

import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from incipient.results import timing as ledgers
from incipient.results.timing import Corrections, Ledger, Share, cost_lines


@pytest.fixture
def clock(monkeypatch):
    """A clock that only moves when it is told to, and memory likewise: `clock(seconds, mib)`."""
    now = {"time": 100.0, "memory": 50.0}
    monkeypatch.setattr(ledgers.time, "perf_counter", lambda: now["time"])
    monkeypatch.setattr(ledgers, "peak_memory_mib", lambda: now["memory"])

    def passes(seconds, mib=0.0):
        now["time"] += seconds
        now["memory"] += mib

    return passes


def corrections(ledger, *present):
    return Corrections(ledger, SimpleNamespace(has=lambda name: name in present))


def seconds(ledger):
    return {name: share.wall_time for name, share in ledger.effects.items() if share.wall_time}


def test_inner_stages_are_not_counted_twice(clock):
    ledger = Ledger(began=100.0)
    with ledger.stage("flow"):
        clock(1.0, 10.0)
        with ledger.stage("mesh motion"):
            clock(2.0, 5.0)
        clock(4.0)
    clock(8.0, 100.0)  # of no stage
    assert ledger.to_dict() == {"flow": 5.0, "mesh motion": 2.0, "total": 15.0}
    assert ledger.effects == {"flow": Share(5.0, 10.0), "moving mesh": Share(2.0, 5.0)}


def test_a_stage_that_fails_is_closed(clock):
    ledger = Ledger()
    with pytest.raises(ValueError), ledger.stage("flow"):
        clock(1.0)
        raise ValueError
    clock(1.0)
    assert ledger.wall_time == {"flow": 1.0}


def test_what_an_earlier_session_took_is_counted(clock):
    ledger = Ledger(began=100.0)
    ledger.count({"flow": 3.0, "interface": 2.0}, 7.0)
    assert ledger.total() == 7.0
    assert seconds(ledger) == {"flow": 3.0, "free body": 2.0}


def test_laps_and_transfers_add_up(clock):
    ledger = Ledger()
    with ledger.stage("flow"):
        clock(1.0)
        assert ledger.lap("flow") == Share(1.0, 0.0)
        clock(2.0, 3.0)
        lap = ledger.lap("flow")
        ledger.transfer("flow", "inertia", lap)
        clock(4.0)
        assert ledger.lap("flow") == Share(4.0, 0.0)
    assert ledger.effects == {"flow": Share(5.0, 0.0), "inertia": Share(2.0, 3.0)}


def solve(clock, made, *taken):
    for iteration, time in enumerate(taken):
        clock(time)
        made.record(iteration)


def step(order, iterations):
    return SimpleNamespace(order=order, report=SimpleNamespace(iterations=iterations))


def test_the_first_correction_at_the_last_order_is_that_of_stokes_flow(clock):
    ledger = Ledger()
    made = corrections(ledger, "inertia")
    with ledger.stage("flow"), made.begun():
        solve(clock, made, 1.0, 2.0)
        solve(clock, made, 16.0, 4.0, 8.0)
        made.book_steady([step(2, 2), step(4, 3)])
    assert seconds(ledger) == {"flow": 16.0, "inertia": 15.0}


def test_without_inertia_all_corrections_are_the_flow_s(clock):
    ledger = Ledger()
    made = corrections(ledger)
    with ledger.stage("flow"), made.begun():
        solve(clock, made, 1.0, 2.0)
        made.book_steady([step(2, 2)])
    assert seconds(ledger) == {"flow": 3.0}


def test_time_steps_after_the_first_are_unsteadiness_s(clock):
    """Of each, corrections beyond the two of a linear flow are inertia's; other stages within keep what is theirs."""
    ledger = Ledger()
    made = corrections(ledger, "inertia", "unsteadiness")
    for number in (1, 2):
        with ledger.stage("flow"), made.begun():
            solve(clock, made, 1.0, 2.0, 4.0)
            with ledger.stage("tractions"):
                clock(32.0)
            clock(8.0)
            made.book_step(number)
    assert seconds(ledger) == {"flow": 11.0, "inertia": 8.0, "unsteadiness": 11.0, "traction": 64.0}


def test_unknowns_stand_beside_the_time(clock):
    ledger = Ledger()
    with ledger.stage("flow"):
        clock(3.0)
    with ledger.stage("contact"):
        clock(1.0)
    found = ledger.by_effect({"flow": 1000})
    assert found["flow"] == {"wall_time": 3.0, "memory_mib": 0.0, "unknowns": 1000}
    first, second = cost_lines(found)
    assert first.split()[:6] == ["cost", "by", "effect", "flow", "3.00", "s"] and "75.0%" in first
    assert "1000 unknowns" in first and "contact" in second
    assert np.isclose(sum(share["wall_time"] for share in found.values()), 4.0)


def test_the_memory_of_the_process_that_started_this_one_is_not_counted() -> None:
    """A test runner of 800 MB starts a run of 200 MB."""
    child = f"from {ledgers.__name__} import peak_memory_mib; print(peak_memory_mib())"
    parent = (
        "import subprocess, sys; held = bytearray(b'x') * 600_000_000\n"
        f"print(subprocess.run([sys.executable, '-c', {child!r}], capture_output=True, text=True).stdout)"
    )
    done = subprocess.run(
        [sys.executable, "-c", parent], capture_output=True, text=True, timeout=60
    )
    assert 5.0 < float(done.stdout) < 300.0
