"""The procedure of a sweep over workers that forget, come late, or are gone, in a time of their own."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest

from incipient.errors import OutputError, SceneError
from incipient.sweep import procedure
from incipient.sweep.case_process import Order
from incipient.sweep.cases import SweepCase
from incipient.sweep.executors import short_of_cores
from incipient.sweep.expectation import Expected
from incipient.sweep.procedure import LATER, LEAST, UNKNOWN, Limits, Sweep, SweepProgress, Watcher
from incipient.sweep.request import parsed_limit
from incipient.sweep.store import CaseOutcome, Store

CASES = [SweepCase(f"case{n}", "judge", "made", (f"a.x={n}",), f"{n}", "") for n in range(6)]


class Workers:
    """Two workers that do at once what `does` says of the text of a case; its futures may also be kept by it."""

    def __init__(self, does: Callable[[str, Future[CaseOutcome]], None]):
        self.places, self.orders, self.seconds, self.renewals = 2, list[Order](), 0.0, 0
        self._does = does

    def clock(self) -> float:
        """Each look at it takes 10 s."""
        self.seconds += 10.0
        return self.seconds

    def submit(self, order: Order) -> Future[CaseOutcome]:
        self.orders.append(order)
        future: Future[CaseOutcome] = Future()
        self._does(order.text, future)
        return future

    def renew(self) -> None:
        self.renewals += 1

    def close(self, sweep: str, at_once: bool) -> None:
        assert sweep == self.orders[0].sweep


class Finished(Watcher):
    """Notes what is finished."""

    def __init__(self) -> None:
        self.found: list[tuple[str, Any]] = []

    def finished(self, case: SweepCase, outcome: CaseOutcome, progress: SweepProgress) -> None:
        self.found.append((case.identity, outcome.result or outcome.reason))


def expected(cases: Sequence[SweepCase]) -> Mapping[str, Expected]:
    return {case.identity: Expected(1.0) for case in cases}


def swept(
    directory: Path, workers: Workers, monkeypatch: pytest.MonkeyPatch, limits: Limits | None = None
) -> tuple[list[tuple[str, Any]], dict[str, int]]:
    monkeypatch.setattr(procedure, "LOOK", 0.01)
    watcher = Finished()
    with Store(directory / "sweep.sqlite", make=True) as store:
        store.add(CASES, ["a.x"])
        Sweep(
            CASES, store, workers, expected, limits or Limits(), watcher, clock=workers.clock
        ).run()
        return watcher.found, {row["id"]: row["tries"] for row in store.rows()}


def test_a_forgotten_case_is_given_out_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its future never ends; it is not waited for longer than its limit allows."""
    seen = Counter[str]()

    def does(text: str, future: Future[CaseOutcome]) -> None:
        seen[text] += 1
        if text != "3" or seen[text] > 1:
            future.set_result(CaseOutcome({"x": text}))

    workers = Workers(does)
    found, tries = swept(tmp_path, workers, monkeypatch, Limits(case=30.0))
    assert sorted(found) == [(case.identity, {"x": case.text}) for case in CASES]
    assert tries == {case.identity: 1 + (case.text == "3") for case in CASES}
    assert workers.orders[0].limit == 30.0 and workers.seconds > 1.1 * 30.0 + LATER


def test_a_late_result_counts_and_its_second_try_does_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first future of a case cannot be cancelled, and ends when the case has been given out again."""
    first: list[Future[CaseOutcome]] = []

    def does(text: str, future: Future[CaseOutcome]) -> None:
        if text != "2":
            future.set_result(CaseOutcome({"x": text}))
        elif not first:
            future.set_running_or_notify_cancel()
            first.append(future)
        else:
            first[0].set_result(CaseOutcome({"x": "late"}))

    found, tries = swept(tmp_path, Workers(does), monkeypatch, Limits(case=30.0))
    assert sorted(found) == [
        (case.identity, {"x": "late" if case.text == "2" else case.text}) for case in CASES
    ]
    assert tries["case2"] == 2


def test_a_case_whose_worker_dies_each_time_fails_with_its_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def does(text: str, future: Future[CaseOutcome]) -> None:
        if text == "1":
            future.set_exception(RuntimeError("the worker\nis gone"))
        elif text == "4":
            future.set_result(CaseOutcome(reason="cannot be computed"))
        else:
            future.set_result(CaseOutcome({"x": text}))

    found, tries = swept(tmp_path, Workers(does), monkeypatch, Limits(tries=2))
    said = {
        "case1": "its worker failed: RuntimeError: the worker is gone (tried 2 times)",
        "case4": "cannot be computed",
    }
    assert {name: words for name, words in found if name in said} == said
    assert (tries["case1"], tries["case4"]) == (2, 1) and len(found) == len(CASES)


def test_futures_that_fail_together_are_nobodys_fault(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As those of a scheduler that has gone: its cases wait again, however often."""
    seen = Counter[str]()

    def does(text: str, future: Future[CaseOutcome]) -> None:
        seen[text] += 1
        if seen[text] <= 5:
            future.cancel()
            future.set_running_or_notify_cancel()
        else:
            future.set_result(CaseOutcome({"x": text}))

    workers = Workers(does)
    found, _ = swept(tmp_path, workers, monkeypatch, Limits(tries=1))
    assert sorted(found) == [(case.identity, {"x": case.text}) for case in CASES]
    assert workers.renewals > 0


def test_a_refusal_ends_the_sweep_and_keeps_what_there_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def does(text: str, future: Future[CaseOutcome]) -> None:
        if text == "3":
            future.set_exception(SceneError("a worker has 1 core"))
        else:
            future.set_result(CaseOutcome({"x": text}))

    with pytest.raises(SceneError, match="1 core"):
        swept(tmp_path, Workers(does), monkeypatch)
    with Store(tmp_path / "sweep.sqlite") as store:
        states = Counter(row["status"] for row in store.rows())
    assert states["done"] >= 3 and states.keys() == {"done", "waiting"}


def test_a_sweep_without_a_worker_that_is_free_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All are at cases that do not end, and cannot be ended."""

    def does(text: str, future: Future[CaseOutcome]) -> None:
        if text == "0":  # alone, as none has been computed that shares its forms
            future.set_result(CaseOutcome({"x": text}))
        else:
            future.set_running_or_notify_cancel()

    with pytest.raises(
        OutputError, match="all workers are at cases that do not end: 1 of 6 cases are finished"
    ):
        swept(tmp_path, Workers(does), monkeypatch, Limits(case=30.0))


def test_ranks_that_share_cores_are_found() -> None:
    """Two ranks with a core each, or with both, are well; two that are bound to the same one are not."""
    first, second = frozenset({0}), frozenset({1})
    assert not short_of_cores([("a", first), ("a", second), ("b", first)])
    assert not short_of_cores([("a", first | second)] * 2)
    assert (
        short_of_cores([("a", first), ("b", first), ("b", first)])
        == "2 ranks compute on b and have 1 cores there"
    )


def test_limits_follow_estimates_and_what_cases_have_taken() -> None:
    assert Limits().of_case(None, None) == UNKNOWN
    assert Limits().of_case(1.0, None) == LEAST
    assert Limits().of_case(100.0, 200.0) == Limits().factor * 200.0
    assert Limits(case=5.0).of_case(100.0, 200.0) == 5.0
    assert parsed_limit("1h30m") == (5400.0, Limits().factor)
    assert parsed_limit("30x") == (None, 30.0) and parsed_limit(None) == (None, Limits().factor)
