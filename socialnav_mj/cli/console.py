"""What the commands say: results to stdout, everything else to stderr."""

from datetime import timedelta
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Column
from rich.text import Text

if TYPE_CHECKING:
    from collections.abc import Iterator

    from socialnav_mj.cli.pace import Pace
    from socialnav_mj.evaluation import Done, Job

console = Console()
errors = Console(stderr=True)


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
        if rate is None or left is None:
            return Text("")
        return Text(f"{rate:.0f} x real time, {timedelta(seconds=round(left))} left", style="progress.remaining")


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
    with Progress(*columns, console=errors) as progress:
        bar = progress.add_task("episodes", total=len(jobs))
        for done in episodes:
            pace.note(done)
            progress.update(bar, advance=1)
            if done.error is not None:
                say(f"{done.job.file_name}: {done.error}", progress.console, style="red")
