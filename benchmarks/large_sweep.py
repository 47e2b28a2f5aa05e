"""A sweep of a million cases, made up, and how long its table, pictures and page take (docs/sweeps.md).

python benchmarks/large_sweep.py FILE.sqlite [NUMBER]    makes the file if it is not there, then measures

Each row is a case to be judged with two keys that vary and a result of the size of a small one; it goes into the file
as a sweep puts it there. Its numbers are of a formula, not of mechanics.
"""

from __future__ import annotations

import json
import math
import random
import subprocess
import sys
import time
from pathlib import Path

from incipient.parallel import Alone
from incipient.sweep.cases import Source, SweepCase, resolved
from incipient.sweep.store import CaseOutcome, Store
from incipient.sweep.worker import computed

CASE = Path(__file__).parents[1] / "demos" / "cases" / "disc_in_pocket.toml"
KEYS = ("contacts.friction", "load.flow_couple")
AT_A_TIME = 10_000


def made(file: Path, number: int) -> None:
    """Fill a file with cases."""
    source = Source(CASE.stem, CASE.read_text().partition("[errors]")[0], CASE.parent)
    first = resolved(source, (f"{KEYS[0]}=0.3",), "judge")
    result = computed("judge", first.text, Alone()).result
    assert result is not None
    verdict = {**result["verdict"], "judges": {"criteria": {"moves": False, "wording": ""}}}
    versions, chance = {"incipient": "0.1.0", "numpy": "1.24.2"}, random.Random(0)
    with Store(file, make=True) as store:
        for start in range(0, number, AT_A_TIME):
            cases, outcomes = [], {}
            for n in range(start, start + AT_A_TIME):
                friction, couple = chance.uniform(0.05, 0.9), -0.01 * chance.randrange(1, 100)
                scene = json.loads(first.text)
                scene["contacts"]["friction"], scene["load"]["flow_couple"] = friction, couple
                case = SweepCase(
                    f"{n:020d}", "judge", "made", (f"{KEYS[0]}={friction}",), json.dumps(scene), ""
                )
                factor = 0.3 * friction / (0.05 - 0.2 * couple) * math.exp(chance.gauss(0.0, 0.3))
                mode = (
                    "rest"
                    if factor >= 1.0
                    else "sliding"
                    if friction < 0.4
                    else "pivoting about contact 1"
                )
                found = {**verdict, "mode": mode, "moves": factor < 1.0, "safety_factor": factor}
                cases.append(case)
                outcomes[case.identity] = CaseOutcome(
                    {**result, "verdict": found}, "", 0.01, 0.01, 90.0, versions
                )
            store.add(cases, KEYS)
            store.claim([case.identity for case in cases])
            store.finish(outcomes)
            print(start + AT_A_TIME, "cases", flush=True)


def main() -> None:
    """Make the file, and measure whole commands."""
    file, number = Path(sys.argv[1]), int((*sys.argv[2:], 1_000_000)[0])
    if not file.exists():
        made(file, number)
    print(f"{file.stat().st_size / 2**30:.2f} GiB")
    for words in (["table", file], ["show", file], ["report", file]):
        began = time.perf_counter()
        said = subprocess.run(
            [sys.executable, "-m", "incipient", *map(str, words)], capture_output=True, text=True
        )
        lines = (said.stdout + said.stderr).splitlines()
        print(
            f"{words[0]}: {time.perf_counter() - began:.2f} s, {len(lines)} lines, the last: {lines[-1]}",
            flush=True,
        )


if __name__ == "__main__":
    main()
