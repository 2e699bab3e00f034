"""The sub-command `fit-selector`."""

from dataclasses import dataclass
from pathlib import Path

from socialnav_mj.cli.arguments import Folder, Scenarios
from socialnav_mj.cli.console import errors, say
from socialnav_mj.config import SHARES


@dataclass(frozen=True, kw_only=True)
class FitSelector:
    """Learn which of several controllers to let act where, from trials of each in real episodes.

    If it is interrupted, repeat the command to resume it: episodes that are there are not run again.
    """

    candidates: tuple[str, ...] = (
        "mpc(preset='calm')",
        "mpc(preset='free')",
        "potential_field_capped",
        "replay_irl",
    )
    """Controllers to choose from, with settings if need be; two or more."""
    dataset: str = "students003"
    """Recording to learn from: name in the catalogue, or path."""
    data_dir: Folder = None
    """Where recordings are looked for first."""
    scenarios: Scenarios = (1, 3)
    """Scenarios in which trials are made."""
    draws: int = 3
    """Random choices of the replaced people in each, from draw 0 on; at most 100: later ones are for reporting."""
    out: Folder = None
    """Folder of trials and weights; runs/selector/DATASET by default."""

    def run(self) -> None:
        """Make the trials that are missing, fit, and say where the weights are."""
        from socialnav_mj.learning.selection import train_selector

        out = self.out or Path("runs") / "selector" / Path(self.dataset).stem
        with errors.status("trials"):
            path = train_selector(
                out,
                self.candidates,
                dataset=self.dataset,
                shares=[SHARES[f"scenario_{number}"] for number in self.scenarios],
                draws=self.draws,
                data_dir=None if self.data_dir is None else str(self.data_dir),
                progress=say,
            )
        say(f"weights: {path}\nuse them: --controllers \"learned_selector(weights='{path}')\"")
