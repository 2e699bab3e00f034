"""What the commands say: results to stdout, everything else to stderr."""

import json
from contextlib import ExitStack, contextmanager
from datetime import timedelta
from math import isfinite
from time import monotonic
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Column, Table
from rich.text import Text

if TYPE_CHECKING:
    from collections.abc import Iterator

    from socialnav_mj.cli.pace import Pace
    from socialnav_mj.evaluation import Done, Job
    from socialnav_mj.report.watching import Watcher


_QUIET_TIME = 10.0
"""Between two lines of progress where there is no terminal for a bar [s]."""
_PATIENCE = 1.0
"""What takes less is not worth a bar [s]."""


class Results(Console):
    """Stdout: text for people or, after `--json`, one JSON object at the end."""

    as_json = False

    def print(self, *objects: Any, **options: Any) -> None:
        """Show something, or keep it for the JSON object: lines of text, and tables with their cells as text.

        Args:
            *objects: As rich takes them.
            **options: As rich takes them.
        """
        if not self.as_json:
            super().print(*objects, **options)
            return
        for shown in objects:
            if isinstance(shown, Table):
                self._kept.setdefault("tables", []).append(_table_json(shown))
            elif isinstance(shown, str | Text):
                self._kept.setdefault("lines", []).extend(str(shown).splitlines())

    def tell(self, **values: Any) -> None:
        """Values for the JSON object alone.

        Args:
            **values: JSON values.
        """
        self._kept.update(values)

    def begin(self, *, as_json: bool) -> None:
        """Forget what was kept.

        Args:
            as_json: Whether an object is wanted at the end.
        """
        self.as_json = as_json
        self._kept: dict[str, Any] = {}

    def finish(self) -> None:
        """Print the object, if one is wanted."""
        if self.as_json:
            self.as_json = False
            self.file.write(json.dumps(self._kept, indent=1, default=str) + "\n")


def _table_json(table: Table) -> dict[str, Any]:
    headings = [" ".join(str(column.header).split()) for column in table.columns]
    cells = ([_number_or_text(str(cell)) for cell in column.cells] for column in table.columns)
    rows = [dict(zip(headings, row, strict=True)) for row in zip(*cells, strict=True)]
    return {"title": str(table.title or ""), "rows": rows}


def _number_or_text(cell: str) -> float | str:
    try:
        value = float(cell)
    except ValueError:
        return cell
    return value if isfinite(value) else cell


console = Results()
console.begin(as_json=False)
errors = Console(stderr=True)
"""Progress and notes; `--quiet` silences it."""
failures = Console(stderr=True)
"""Why a command ends without its result."""


def say(text: str, console: Console = console, style: str = "") -> None:
    """Plain text, which the terminal wraps by itself, so that paths stay whole in a copy or a file."""
    console.print(text, style=style, markup=False, highlight=False, soft_wrap=True)


def counted_progress() -> Progress:
    """A bar for work in equal pieces, with the time left."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    return Progress(*columns, TextColumn("left"), TimeRemainingColumn(), console=errors)


class _PaceColumn(ProgressColumn):
    """Simulated time per real time, and the time left."""

    def __init__(self, pace: "Pace") -> None:
        super().__init__(table_column=Column(no_wrap=True))
        self._pace = pace

    def render(self, task: Task) -> Text:
        rate, left = self._pace.rate, self._pace.left
        if rate is None:
            return Text("")
        until = "-:--:--" if left is None else str(timedelta(seconds=round(left)))
        return Text(f"{rate:.0f} x real time, {until} left", style="progress.remaining")


class _Lines:
    """Progress where there is no terminal for a bar."""

    def __init__(self) -> None:
        self._said = monotonic()

    def tell(self, text: str, *, now: bool = False) -> None:
        """Say it if nothing was said for long.

        Args:
            text: A line.
            now: Whether to say it anyhow.
        """
        if not errors.is_terminal and (now or monotonic() - self._said >= _QUIET_TIME):
            self._said = monotonic()
            say(text, errors)


def follow(episodes: "Iterator[Done]", jobs: "list[Job]") -> None:
    """Run episodes behind a bar with their rate and the time left; tell at once what went wrong."""
    from socialnav_mj.cli.pace import Pace

    pace = Pace(jobs)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=20),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        _PaceColumn(pace),
    )
    with Progress(*columns, console=errors, disable=not errors.is_terminal) as progress:
        bar = progress.add_task("episodes", total=len(jobs))
        lines = _Lines()
        for count, done in enumerate(episodes, start=1):
            pace.note(done)
            progress.update(bar, advance=1)
            lines.tell(f"episodes {count}/{len(jobs)}", now=count == len(jobs))
            if done.error is not None:
                say(f"{done.job.file_name}: {done.error}", failures if errors.quiet else progress.console, style="red")


@contextmanager
def scoring() -> "Iterator[Watcher]":
    """What tells how far the scoring is: a bar where there is a terminal, else a line now and then."""
    with ExitStack() as stack:
        bars: list[tuple[Progress, TaskID]] = []
        began, lines = monotonic(), _Lines()

        def tell(count: int, total: int) -> None:
            nonlocal began, lines
            if count == 1:
                began, lines = monotonic(), _Lines()
            if errors.is_terminal and not bars and monotonic() - began >= _PATIENCE:
                progress = stack.enter_context(counted_progress())
                bars.append((progress, progress.add_task("scoring")))
            for progress, bar in bars:
                progress.update(bar, completed=count, total=total)
            lines.tell(f"scored {count}/{total}")
            if count == total:
                stack.close()
                bars.clear()

        yield tell
