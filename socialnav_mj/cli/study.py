"""What every sub-command does that runs a study."""

import shlex
import sys
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

from socialnav_mj.cli.console import errors, follow, say


def run_study(
    study: Any,
    write: Callable[..., Path],
    public: Collection[str],
    *,
    out: Path,
    jobs: int,
    publish_to: Path | None,
    making: str,
    label: str = "report",
    also: str = "",
) -> None:
    """Run what is missing behind a bar, then write the outputs, and copy them if asked to.

    Args:
        study: A `studies.study.Study`.
        write: Makes the outputs of its episodes, and returns the path of its page.
        public: Names of the outputs that may travel with the project.
        out: Folder of the results.
        jobs: Processes; -1 for one a core.
        publish_to: Folder that gets a copy; None for none.
        making: What is made, for who waits.
        label: What the page is called.
        also: Said after the page's path.
    """
    from socialnav_mj.studies.files import publish
    from socialnav_mj.studies.study import reproduce

    command = shlex.join(["socialnav-mj", *sys.argv[1:]])
    follow(reproduce(study, out, command=command, n_jobs=jobs), study.jobs())
    with errors.status(making):
        page = write(study, out, command=command, n_jobs=jobs)
    say(f"{label}: {page}{also}")
    if publish_to is not None:
        say(f"to be committed: {publish(out, publish_to, public)}")
