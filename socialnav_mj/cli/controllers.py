"""The sub-command `check`: does a controller keep what every built-in one promises?"""

import sys
from dataclasses import dataclass
from typing import Annotated

import tyro

from socialnav_mj.cli.arguments import File
from socialnav_mj.cli.console import console, say


@dataclass(frozen=True, kw_only=True)
class Check:
    """Try a controller on made-up walks, without a simulator; exit code 1 if it breaks a promise.

    A tick for each promise, or the input that breaks it.
    """

    controller: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="CONTROLLER")]
    """As in `evaluate`, such as mine:Spin or 'mine:Spin(margin=0.5)'."""
    seed: int = 0
    """Of the walks."""
    save: File = None
    """File (.npz) that gets the first observation that breaks a promise."""

    def run(self) -> None:
        """Print a line for each promise; exit with 1 if one is broken."""
        import numpy as np

        from socialnav_mj.controllers import make_controller
        from socialnav_mj.controllers.examination import examine

        broken = 0
        findings = []
        make_controller(self.controller)
        for finding in examine(lambda: make_controller(self.controller), seed=self.seed):
            findings.append({"question": finding.question, "passed": finding.passed, "told": finding.told})
            mark, style = ("\N{CHECK MARK}", "green") if finding.passed else ("\N{BALLOT X}", "red")
            say(f"{mark} {finding.question}{f': {finding.told}' if finding.told else ''}", style=style)
            if not finding.passed and not broken and self.save is not None and finding.observation is not None:
                np.savez(self.save, **finding.observation)  # type: ignore[arg-type]
                say(f"  the observation is in {self.save}")
            broken += not finding.passed
        console.tell(findings=findings)
        if broken:
            sys.exit(1)
