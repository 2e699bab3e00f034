"""How scenarios, names and folders are written in the help of all sub-commands that take them."""

from pathlib import Path
from typing import Annotated, Literal

import tyro

Scenarios = Annotated[tuple[Literal[1, 2, 3, 4], ...], tyro.conf.arg(metavar="{1,2,3,4} ...")]
Name = Annotated[str | None, tyro.conf.arg(metavar="NAME", help_behavior_hint="")]
Folder = Annotated[Path | None, tyro.conf.arg(metavar="FOLDER", help_behavior_hint="")]
File = Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")]
