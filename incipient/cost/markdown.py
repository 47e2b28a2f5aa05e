"""A study of what accuracy costs as files: cost.json and cost.md."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..files import write_json, write_text_atomically
from . import calibration, frontier
from .comparison import Compared
from .frontier import percent, seconds
from .measurement import ENOUGH, MeasuredRun
from .solvers import SolverOptions, said
from .study import Study, findings, to_dict


def write(study: Study, directory: Path) -> None:
    """Write cost.json and cost.md. Not collective. Raises OutputError: they cannot be written."""
    stored = {**to_dict(study), "findings": calibration.plain(findings(study))}
    write_json(directory / calibration.STUDY, stored)
    write_text_atomically(directory / "cost.md", page(study))


def page(study: Study) -> str:
    """The study as Markdown, with the picture cost.png."""
    title = study.scene.title or "What accuracy costs"
    parts = [f"# {title}", f"**{study.words()}.**", "![Error against cost](cost.png)"]
    parts += [
        _explained(study),
        _accuracies(study),
        _of_goals(study),
        *_solvers(study),
        _runs(study),
    ]
    if study.failed:
        lines = [f"- {run.variant.name}: {run.failed}" for run in study.failed]
        parts += ["Runs that failed:", "\n".join(lines)]
    return "\n\n".join(parts) + "\n"


def _explained(study: Study) -> str:
    leading = [goal for goal in study.goals if goal.leading]
    names = ", ".join(goal.name for goal in leading)
    worst = max(study.doubt(goal) for goal in leading)
    largest = (
        "the largest of the relative errors of " if len(leading) > 1 else "the relative error of "
    )
    again = f", those of less than {ENOUGH:g} s twice: the quicker one counts"
    return (
        f"The error is {largest}{names}, against {study.compared_with.variant.name} "
        f"({study.reference.how}; itself good to {percent(worst)}). Each run has a process of its own, forms "
        f"compiled before, without error bars{again if study.solvers() else ''}. Times are of the whole "
        "process, processor time first: on a busy machine wall time says little."
    )


def _accuracies(study: Study) -> str:
    """The table of what accuracies cost."""
    times, errors = study.frontier()
    laws = study.laws
    if laws["cpu"] is None:
        return "No law: too few runs can be told apart from the reference."
    walls = [study.judged[index].run.wall for index in study.front]
    rows = []
    for accuracy in frontier.accuracies(min(errors)):
        reached = [study.judged[i].run for i in study.front if study.judged[i].error <= accuracy]
        run = (
            f"{reached[0].variant.name}, {reached[0].peak_mib:.0f} MiB"
            if reached
            else "finer than any here"
        )
        of_both = (laws["cpu"], times), (laws["wall"], walls)
        prices = [frontier.cost(law, accuracy, errors, of) if law else "-" for law, of in of_both]
        rows.append([percent(accuracy), *prices, run])
    digits = [f"x {law.digit:.2g}" if law else "-" for law in (laws["cpu"], laws["wall"])]
    starting = f"of the time beyond {seconds(laws['cpu'].start)} of starting"
    rows.append(["each further digit", *digits, starting])
    heads = ["accuracy", "processor time", "wall time", "cheapest run that reached it"]
    return _table(heads, rows, left=(3,))


def _of_goals(study: Study) -> str:
    """The laws goal by goal."""
    rows = []
    for goal in study.goals:
        law, best = study.of_goals[goal.name], min(one.errors[goal.name] for one in study.judged)
        of_law = ["-", "-", "-"]
        if law is not None:
            of_law = [f"{law.constant:.2g}", f"{law.power:.2g}", f"x {law.digit:.2g}"]
        rows.append([goal.name, *of_law, percent(best), percent(study.doubt(goal))])
    heads = ["quantity", "C", "p", "a further digit", "best error", "reference good to"]
    said = "error = C (t - start)^-p on the front of each quantity, t in seconds of processor time:"
    return f"{said}\n\n{_table(heads, rows)}"


def _solvers(study: Study) -> list[str]:
    """Other solver options: a sentence and a table."""
    found = study.solvers()
    if not found:
        return []
    able = SolverOptions(study.scene)
    rows = [_solver_row(one, able) for one in found]
    numbers = [
        "time at equal errors",
        "time",
        "error",
        "change",
        "memory",
        "corrections",
        "factorisations",
    ]
    table = _table(["solver option", *numbers, "what it is", "set by"], rows, left=(8, 9))
    return [_said_of_solvers(study), table]


def _solver_row(one: Compared, able: SolverOptions) -> list[str]:
    found = (one.time_at_error, one.time, one.error, one.memory, one.newton, one.factorisations)
    ratios = [_ratio(value) for value in found]
    set_by = "; ".join(f"`{setting}`" for setting in able.settings(one.solver))
    return [one.solver, *ratios[:3], percent(one.change), *ratios[3:], said(one.solver), set_by]


def _said_of_solvers(study: Study) -> str:
    found = study.solvers()
    tried = {name for one in found for name in one.variants}
    where = (
        f"at {next(iter(tried))}"
        if len(tried) == 1
        else f"on {len(tried)} variants, geometric means"
    )
    better = [f"*{one.solver}* ({_ratio(one.time_at_error)})" for one in found if one.cheaper]
    best = "None of them is cheaper at equal errors by a tenth on the whole and on every variant."
    if better:
        best = f"Cheaper at equal errors, by a tenth on the whole and on every variant: {', '.join(better)}."
    return (
        f"**Solver options** beside the scene's own ({SolverOptions(study.scene).own}), {where}. Time (without that of "
        'starting), error, memory, Newton\'s corrections and factorisations are relative to its own; "-": error not '
        "to be told apart from the reference's, or nothing to count. At equal errors: by how error and time go "
        "together on these variants. The change is the largest relative difference between the numbers of both. "
        f"{best}"
    )


def _ratio(value: float | None) -> str:
    return "-" if value is None else f"x {value:.2g}"


def _runs(study: Study) -> str:
    heads, rows = (
        ["run", "error", "processor [s]", "wall [s]", "unknowns", "memory [MiB]", "front"],
        [],
    )
    for index, one in enumerate(study.judged):
        error = percent(one.error) if one.told_apart else f"({percent(one.error)})"
        rows.append(
            [one.run.variant.name, error, *_spent(one.run), "yes" if index in study.front else ""]
        )
    run = study.compared_with
    rows.append([run.variant.name, "reference", *_spent(run), ""])
    return _table(heads, rows)


def _spent(run: MeasuredRun) -> list[str]:
    return [f"{run.cpu:.2f}", f"{run.wall:.2f}", str(run.unknowns), f"{run.peak_mib:.0f}"]


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]], left: Sequence[int] = ()) -> str:
    marks = [":--" if column == 0 or column in left else "--:" for column in range(len(heads))]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (heads, marks, *rows))
