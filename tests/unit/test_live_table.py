"""What a terminal shows of a sweep while it runs."""

import io
import sys
import time

from rich.console import Console

from incipient.progress import telling
from incipient.sweep.cases import SweepCase
from incipient.sweep.live_table import LiveTable
from incipient.sweep.procedure import SweepProgress
from incipient.sweep.store import CaseOutcome


class Paper:
    """Keeps what would be drawn."""

    def update(self, table):
        console = Console(file=io.StringIO(), width=100)
        console.print(table)
        self.text = console.file.getvalue()


def case(value):
    return SweepCase(str(value), "run", "grain", (f"fluid.reynolds={value}",), "", "")


def test_the_table_says_what_runs_what_came_out_and_what_is_left():
    """Of three cases one took 2.5 s, one is running, one waits: 2.5 s times two are left."""
    paper, progress = Paper(), SweepProgress(total=3, known=0, places=1, done=1, spent=2.5)
    progress.running["2"] = case(2), time.monotonic()
    LiveTable(paper).finished(case(1), CaseOutcome(reason="[no] flow", wall=2.5), progress)
    assert "1 of 3 cases, 1 running, about 5 s left" in paper.text
    assert "failed: [no] flow" in paper.text and "2.5 s" in paper.text
    assert "fluid.reynolds=2" in paper.text and "running" in paper.text


def test_brackets_in_a_title_are_no_markup():
    """A closing tag without an opening one would be an error of markup, which ends the sweep."""
    paper, progress = Paper(), SweepProgress(total=3, known=0, places=2)
    progress.running["2"] = case("[/coarse]"), time.monotonic()
    LiveTable(paper).finished(case("[red]clay"), CaseOutcome(reason="[/no] flow"), progress)
    assert all(words in paper.text for words in ("=[/coarse]", "=[red]clay", "failed: [/no] flow"))


def test_brackets_in_a_stage_are_no_markup(monkeypatch, capsys):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with telling(0) as voice:
        voice.begin("mesh of sand[/coarse]")
        voice.count("[/cases]", 1, 2)
    assert "[/cases]" in capsys.readouterr().err
