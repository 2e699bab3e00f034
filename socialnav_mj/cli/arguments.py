"""How sub-commands write scenarios, names and folders in their help, and where they have their work done."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

Scenarios = Annotated[tuple[Literal[1, 2, 3, 4], ...], tyro.conf.arg(metavar="{1,2,3,4} ...")]
Name = Annotated[str | None, tyro.conf.arg(metavar="NAME", help_behavior_hint="")]
Folder = Annotated[Path | None, tyro.conf.arg(metavar="FOLDER", help_behavior_hint="")]
File = Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")]
Address = Annotated[str | None, tyro.conf.arg(metavar="HOST:PORT", help_behavior_hint="")]


@dataclass(frozen=True, kw_only=True)
class Where:
    """Where work is done that one process does not do alone."""

    backend: Literal["loky", "ray"] = "loky"
    """Where work is done: processes of this machine, or a Ray cluster on a file system that its machines share; the
    latter needs the extra `cluster`."""
    address: Address = None
    """With --backend ray: its head; by default the one of this machine, or the one that RAY_ADDRESS names."""

    @contextmanager
    def used(self) -> Iterator[None]:
        """Have it used while the block runs.

        Raises:
            ValueError: If an address is given without Ray.
            RuntimeError: If Ray is asked for and is not installed.
            ConnectionError: If no cluster answers.
        """
        from socialnav_mj.cluster import Cluster, on_cluster
        from socialnav_mj.provenance import PACKAGES, package_versions

        if self.backend == "loky":
            if self.address is not None:
                raise ValueError(f"--address {self.address} is given without --backend ray; give both or none")
            yield
            return
        cluster = Cluster(
            address=self.address or "auto",
            folder=str(Path.cwd()),
            environment={name: os.environ[name] for name in ("SOCIALNAV_MJ_DATA",) if name in os.environ},
            versions=package_versions(PACKAGES),
        )
        with on_cluster(cluster):
            yield


LOCAL = Where()
