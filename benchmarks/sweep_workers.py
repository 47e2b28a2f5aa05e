"""Workers of sweeps: overhead of a case, pools whose worker dies, and a large sweep on paper (docs/howto/cluster.md).

python benchmarks/sweep_workers.py [overhead|pools|simulation ...]

The simulation is of the workers alone: 1,000 of them compute 100,000 cases of 60 s in a time of their own, while one of
them fails each hour and is back after ten minutes. The procedure of the sweep and its SQLite file are the real ones, so
that the processor time, the wall time and the memory are those of the parent of such a sweep.
"""

from __future__ import annotations

import concurrent.futures
import heapq
import json
import multiprocessing
import os
import random
import resource
import signal
import sys
import tempfile
import time
from concurrent.futures import Future
from contextlib import suppress
from pathlib import Path
from queue import Empty, SimpleQueue

import incipient.sweep
from incipient.sweep.case_process import Order
from incipient.sweep.cases import SweepCase
from incipient.sweep.expectation import Expected
from incipient.sweep.procedure import Limits, Sweep
from incipient.sweep.store import CaseOutcome, Store

CASE = Path(__file__).parents[1] / "demos" / "cases" / "disc_in_pocket.toml"
QUICK = CASE.read_text().partition("[errors]")[0]
NUMBER = 400


def overhead(directory: Path) -> None:
    """Wall time of a case on one worker beside its computation."""
    scene = directory / "case.toml"
    scene.write_text(QUICK)

    def measured(name: str, **how: object) -> None:
        file = directory / f"{name}.sqlite"
        over = {"contacts.friction": f"lin:0.1:0.9:{NUMBER}"}
        # The first case starts the process.
        incipient.sweep.run(scene, file, {"contacts.friction": [0.05]}, do="judge", **how)  # type: ignore[arg-type]
        began, used = time.perf_counter(), time.process_time()
        incipient.sweep.run(scene, file, over, do="judge", **how)  # type: ignore[arg-type]
        wall, cpu = time.perf_counter() - began, time.process_time() - used
        own = sum(row["wall"] for row in incipient.sweep.rows(file)[1:])
        each = 1e3 / NUMBER
        print(
            f"{name}: {each * (wall - own):.1f} ms a case, {each * cpu:.1f} ms of the parent's processor",
            flush=True,
        )

    measured("processes", jobs=1)
    with suppress(ImportError):
        from distributed import LocalCluster

        with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:
            measured("dask", executor=f"dask://{cluster.scheduler_address}")


def _slept(number: int) -> int:
    time.sleep(0.2)
    return number


def pools(directory: Path) -> None:
    """How many of forty tasks fail where one of four workers is killed."""
    context = multiprocessing.get_context("spawn")
    makers = {
        "concurrent.futures.ProcessPoolExecutor": lambda: concurrent.futures.ProcessPoolExecutor(
            4, context
        ),
        "with max_tasks_per_child": lambda: concurrent.futures.ProcessPoolExecutor(
            4, context, max_tasks_per_child=1000
        ),
    }
    with suppress(ImportError):
        import loky

        makers["loky.ProcessPoolExecutor"] = lambda: loky.ProcessPoolExecutor(4)
    for name, make in makers.items():
        executor = make()
        executor.submit(_slept, 0).result()
        futures = [executor.submit(_slept, number) for number in range(40)]
        time.sleep(0.5)
        os.kill(next(iter(executor._processes)), signal.SIGKILL)
        concurrent.futures.wait(futures)
        failed = sum(future.exception() is not None for future in futures)
        print(f"{name}: {failed} of 40 tasks fail when one of 4 workers is killed", flush=True)


class Simulated:
    """Workers in a time of their own: `get` goes on to the next thing that happens."""

    def __init__(self, number: int, seconds: float, between_failures: float):
        self.now, self.places, self.failures = 0.0, number, 0
        self._seconds, self._between = seconds, between_failures
        self._chance, self._count = random.Random(1), 0
        self._events: list[tuple[float, int, Future[CaseOutcome] | None]] = []
        self._ended: SimpleQueue[Future[CaseOutcome]] = SimpleQueue()
        self._result = json.loads(RESULT)
        self._push(self._chance.expovariate(1.0 / between_failures), None)

    def clock(self) -> float:
        """Seconds."""
        return self.now

    def submit(self, order: Order) -> Future[CaseOutcome]:
        """See `Workers`: each case takes its time, more or less."""
        future: Future[CaseOutcome] = Future()
        self._push(self.now + self._seconds * self._chance.uniform(0.7, 1.3), future)
        return future

    def renew(self) -> None:
        """See `Workers`."""

    def close(self, sweep: str, at_once: bool) -> None:
        """See `Workers`."""

    def put(self, future: Future[CaseOutcome]) -> None:
        """A future has ended."""
        self._ended.put(future)

    def get(self, timeout: float) -> Future[CaseOutcome]:
        """The next future that ends, or none within the time."""
        until = self.now + timeout
        while self._events and self._events[0][0] <= until:
            self.now, _, future = heapq.heappop(self._events)
            if future is None:
                self._fail()
            elif not future.done():
                took = (self._seconds, self._seconds, 300.0)
                future.set_result(CaseOutcome(self._result, "", *took, VERSIONS, LOG))
            with suppress(Empty):
                return self._ended.get_nowait()
        self.now = until
        raise Empty

    def get_nowait(self) -> Future[CaseOutcome]:
        """A further future that has ended."""
        return self._ended.get_nowait()

    def _fail(self) -> None:
        """The worker of one case dies, and another one is there ten minutes later."""
        at_work = [one for _, _, one in self._events if one is not None and not one.done()]
        self._push(self.now + self._chance.expovariate(1.0 / self._between), None)
        if at_work:
            self.failures += 1
            self._chance.choice(at_work).set_result(
                CaseOutcome(reason="its process was ended by signal 9", lost=True)
            )

    def _push(self, when: float, future: Future[CaseOutcome] | None) -> None:
        self._count += 1
        heapq.heappush(self._events, (when, self._count, future))


def _a_run() -> tuple[str, str]:
    """Text of a case and of its result, as large as those of a run."""
    from incipient import sweep

    with tempfile.TemporaryDirectory() as name:
        file = Path(name) / "one.sqlite"
        scene = Path(__file__).parents[1] / "demos" / "scenes" / "reynolds_sweep.toml"
        sweep.run(
            scene,
            file,
            {"fluid.reynolds": [1.0]},
            do="run",
            settings=["numerics.mesh_size=3"],
            jobs=1,
        )
        with Store(file) as store:
            (row,) = store.rows()
            return row["scene"], row["result"]


VERSIONS = {"incipient": "0.1.0", "numpy": "1.24.2", "dolfinx": "0.5.1"}
LOG = "host node123, process 12345, ranks 1, threads 1, cores 1\n"
SCENE, RESULT = "", "{}"


def _peak() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def simulation(
    directory: Path, number: int = 100_000, places: int = 1000, seconds: float = 60.0
) -> None:
    """A large sweep on paper."""
    global SCENE, RESULT
    if not SCENE:
        SCENE, RESULT = _a_run()
    before = _peak()
    cases = [
        SweepCase(
            f"{n:020d}", "run", "scene", (f"fluid.reynolds={n}",), f"{SCENE}\n# {n}\n", "forms"
        )
        for n in range(number)
    ]
    workers, file = Simulated(places, seconds, 3600.0), directory / f"{number}_{places}.sqlite"
    with Store(file, make=True) as store:
        began = time.perf_counter()
        store.add(cases, ["fluid.reynolds"])
        added = time.perf_counter() - began
        began, used = time.perf_counter(), time.process_time()

        def expect(some: list[SweepCase]) -> dict[str, Expected]:
            return {case.identity: Expected(seconds, 300.0) for case in some}

        sweep = Sweep(cases, store, workers, expect, Limits(), clock=workers.clock)
        sweep._ended = workers  # type: ignore[assignment]
        progress = sweep.run()
        wall, cpu = time.perf_counter() - began, time.process_time() - used
    ideal = number * seconds / places
    print(
        f"{number} cases of {seconds:g} s on {places} workers: {progress.done} done, {progress.failed} failed, "
        f"{workers.failures} workers failed; {workers.now / 3600:.2f} h ({ideal / 3600:.2f} h without any loss)\n"
        f"  parent: {number / workers.now:.1f} cases a second, of which it can do {number / wall:.0f}; "
        f"{1e3 * cpu / number:.2f} ms of processor a case, busy {100 * wall / workers.now:.2f}% of the time; "
        f"{_peak():.0f} MiB (before: {before:.0f}); put in within {added:.1f} s; "
        f"file {file.stat().st_size / 2**20:.0f} MiB\n"
        f"  its end: {number / wall * seconds:.0f} workers at cases of {seconds:g} s",
        flush=True,
    )


def main() -> None:
    """Print the measurements that are asked for."""
    every = {"overhead": overhead, "pools": pools, "simulation": simulation}
    for name in sys.argv[1:] or every:
        with tempfile.TemporaryDirectory() as directory:
            every[name](Path(directory))


if __name__ == "__main__":
    main()
