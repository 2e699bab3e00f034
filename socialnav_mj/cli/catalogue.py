"""The sub-commands `list` and `data`: which tasks, controllers and recordings there are, and what is in a recording."""

from dataclasses import dataclass
from typing import Annotated

import tyro
from rich.table import Table
from rich.text import Text

from socialnav_mj.cli.arguments import Folder, Name
from socialnav_mj.cli.console import console, errors, say
from socialnav_mj.cli.recordings import describe
from socialnav_mj.config import SHARES
from socialnav_mj.recordings import DEFAULT_READING, Reading


@dataclass(frozen=True, kw_only=True)
class List:
    """Show the tasks, controllers and recordings that there are."""

    def run(self) -> None:
        """Print a table each of tasks, controllers and recordings."""
        from socialnav_mj import suite
        from socialnav_mj.controllers import available, described_settings, factory_of
        from socialnav_mj.recordings.catalogue import catalogue

        table = Table("task", "replaced", title="tasks", title_justify="left")
        for name in suite.ALL_TASKS:
            table.add_row(name, f"{SHARES[name]:.0%}")
        console.print(table)
        table = Table("controller", "settings and their defaults", title="controllers", title_justify="left")
        for name in available():
            try:
                settings = described_settings(factory_of(name))
            except ValueError as error:  # an installed package offers what cannot be imported
                settings = str(error)
            table.add_row(name, Text(settings or "none"))
        table.add_row("package.module:Class", "its arguments, as in mine:Spin(margin=0.5)")
        console.print(table)
        table = Table("recording", "variants", "what it is", title="recordings", title_justify="left")
        for name, row in catalogue().items():
            table.add_row(name, ", ".join(row.variants), row.title)
        console.print(table)


@dataclass(frozen=True, kw_only=True)
class DataList:
    """Known recordings: source, licence, checksums, frame rate, scale, and whether they are on this machine."""

    data_dir: Folder = None
    """Where recordings are looked for first."""

    def run(self) -> None:
        """Print a table for each recording, and whether its default variant is here and has the right sha256."""
        from socialnav_mj.recordings.catalogue import UNKNOWN, catalogue, load_recording

        for name, row in catalogue().items():
            table = Table(show_header=False, title=f"{name}: {row.title}", title_justify="left")
            table.add_column()
            table.add_column(overflow="fold")
            for label in ("source", "licence", "scale"):
                table.add_row(label, getattr(row, label))
            table.add_row("frame rate", f"{row.frame_rate:g} Hz")
            for variant, files in row.variants.items():
                for file, checksum in files.items():
                    known = "not verified: no sha256 is known" if checksum == UNKNOWN else f"sha256 {checksum}"
                    table.add_row(f"{variant}: {file}", known)
            try:
                load_recording(name, data_dir=self.data_dir, warn=False)
                table.add_row("here", "yes")
            except FileNotFoundError:
                table.add_row("here", f"no: socialnav-mj data fetch {name}")
            console.print(table)


@dataclass(frozen=True, kw_only=True)
class DataInfo:
    """Facts of a recording: people, concurrency, speeds, distances, and who comes how near."""

    name: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="NAME")]
    """Name in the catalogue, or path of a recording."""
    variant: Name = None
    """Which annotation; the first by default."""
    data_dir: Folder = None
    """Where recordings are looked for first."""
    reading: Reading = DEFAULT_READING

    def run(self) -> None:
        """Print the figures, then size, frame rate and checksum in two lines."""
        from rich.markdown import Markdown

        from socialnav_mj.recordings import load_recording
        from socialnav_mj.recordings.facts import facts, facts_table

        recording = load_recording(self.name, variant=self.variant, data_dir=self.data_dir, reading=self.reading)
        console.print(Markdown(facts_table({recording.name: facts(recording)})))
        say(f"{describe(recording)}\nchecksum {recording.checksum}")


@dataclass(frozen=True, kw_only=True)
class DataFetch:
    """Download a recording from its public source and verify its checksum."""

    name: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="NAME")]
    """Name in the catalogue."""
    data_dir: Folder = None
    """Where to put it; the user cache by default."""
    accept_unverified: bool = False
    """Take files of which the catalogue knows no sha256."""

    def run(self) -> None:
        """Download what is not there yet, and print the paths, and the sha256 of what could not be verified."""
        from socialnav_mj.recordings.catalogue import UNKNOWN, catalogue_row
        from socialnav_mj.recordings.fetch import fetch
        from socialnav_mj.recordings.readers import sha256

        with errors.status(f"downloading {self.name}"):
            paths = fetch(self.name, data_dir=self.data_dir, accept_unverified=self.accept_unverified)
        sums = {file: digest for own in catalogue_row(self.name).variants.values() for file, digest in own.items()}
        for path in paths:
            say(f"{path} (not verified, sha256 {sha256([path])})" if sums.get(path.name) == UNKNOWN else str(path))


@dataclass(frozen=True, kw_only=True)
class Data:
    """Recordings: list, info, fetch."""

    action: tyro.conf.OmitSubcommandPrefixes[
        Annotated[DataList, tyro.conf.subcommand("list")]
        | Annotated[DataInfo, tyro.conf.subcommand("info")]
        | Annotated[DataFetch, tyro.conf.subcommand("fetch")]
    ]

    def run(self) -> None:
        """Run list, info or fetch."""
        self.action.run()
