"""The sub-command `export`: episodes as files of other tools."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from socialnav_mj.cli.arguments import Folder
from socialnav_mj.cli.console import say
from socialnav_mj.export import Format


@dataclass(frozen=True, kw_only=True)
class Export:
    """Write the episodes of a run in the formats of other tools."""

    path: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="PATH")]
    """Folder that `evaluate` wrote, or an episode (.npz)."""
    format: tuple[Format, ...] = ("csv",)
    """trajnet: TrajNet++ ndjson; pedpy: text that PedPy and JuPedSim read; csv: a table of everybody."""
    out: Folder = None
    """Folder of the files; export/ in the run's folder, or beside the episode, by default."""

    def run(self) -> None:
        """Write the files and print their paths."""
        from socialnav_mj.export import export

        beside = self.path if self.path.is_dir() else self.path.parent
        for path in export(self.path, self.out or beside / "export", self.format):
            say(str(path))
