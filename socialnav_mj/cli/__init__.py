"""The command `socialnav-mj`: sub-commands, and nothing that another module could do."""

import logging
import signal
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import tyro
from dm_control.rl.control import PhysicsError

from socialnav_mj.cli.arguments import LOCAL
from socialnav_mj.cli.board import Leaderboard, PeopleAsRobots, Plant, Reaction
from socialnav_mj.cli.catalogue import Data, List
from socialnav_mj.cli.console import console, errors, failures, say, scoring
from socialnav_mj.cli.controllers import Check
from socialnav_mj.cli.cost import Bench, StepSize
from socialnav_mj.cli.exports import Export
from socialnav_mj.cli.learning import RewardMaps, Ship, Train
from socialnav_mj.cli.runs import Draws, Evaluate, Report, Verify
from socialnav_mj.cli.selection import FitSelector
from socialnav_mj.cli.studies import FitPrediction, Gains, LeaveOneOut, Reproduce
from socialnav_mj.cli.view import Render, View
from socialnav_mj.processes import stoppable
from socialnav_mj.report.watching import watched

Command = (
    Annotated[Evaluate, tyro.conf.subcommand("evaluate")]
    | Annotated[Report, tyro.conf.subcommand("report")]
    | Annotated[View, tyro.conf.subcommand("view")]
    | Annotated[Render, tyro.conf.subcommand("render")]
    | Annotated[Export, tyro.conf.subcommand("export")]
    | Annotated[Verify, tyro.conf.subcommand("verify")]
    | Annotated[Check, tyro.conf.subcommand("check")]
    | Annotated[Draws, tyro.conf.subcommand("draws")]
    | Annotated[List, tyro.conf.subcommand("list")]
    | Annotated[Data, tyro.conf.subcommand("data")]
    | Annotated[Bench, tyro.conf.subcommand("bench")]
    | Annotated[StepSize, tyro.conf.subcommand("step-size")]
    | Annotated[Train, tyro.conf.subcommand("train")]
    | Annotated[Ship, tyro.conf.subcommand("ship")]
    | Annotated[RewardMaps, tyro.conf.subcommand("reward-maps")]
    | Annotated[FitPrediction, tyro.conf.subcommand("fit-prediction")]
    | Annotated[FitSelector, tyro.conf.subcommand("fit-selector")]
    | Annotated[Reproduce, tyro.conf.subcommand("reproduce")]
    | Annotated[LeaveOneOut, tyro.conf.subcommand("leave-one-out")]
    | Annotated[Gains, tyro.conf.subcommand("gains")]
    | Annotated[Leaderboard, tyro.conf.subcommand("leaderboard")]
    | Annotated[Reaction, tyro.conf.subcommand("reaction")]
    | Annotated[Plant, tyro.conf.subcommand("plant")]
    | Annotated[PeopleAsRobots, tyro.conf.subcommand("people-as-robots")]
)


def main(args: list[str] | None = None) -> None:
    """Entry point; bad input ends in one clear message and exit code 2, an interruption in 128 + the signal's number.

    1 means that `verify`, `check` or `bench --compare` found something. `--json` and `--quiet` may stand anywhere.

    These are 130 for Ctrl-C, 143 for SIGTERM and 129 for SIGHUP.

    Args:
        args: Command line without the program's name; sys.argv by default.
    """
    given = sys.argv[1:] if args is None else args
    if given == ["--version"]:
        say(f"socialnav-mj {version('socialnav-mj')}")
        return
    console.begin(as_json="--json" in given)
    errors.quiet = "--quiet" in given
    logging.disable(logging.WARNING if errors.quiet else logging.NOTSET)
    if logging.lastResort is not None:  # what prints warnings where nobody has set up logging
        logging.lastResort.setFormatter(logging.Formatter("%(levelname)s: %(message)s"))
    command = tyro.cli(
        Command,
        prog="socialnav-mj",
        description="Social navigation in recorded crowds, as a MuJoCo physics benchmark. With every command: --json "
        "prints results as one JSON object, --quiet hides progress and notes. --version tells the version.",
        args=[word for word in given if word not in ("--json", "--quiet")],
        config=(tyro.conf.OmitSubcommandPrefixes, tyro.conf.OmitArgPrefixes),
    )
    # As `python -m` does, so that package.module:Class finds what lies here; last, so that it hides nothing.
    sys.path.append(str(Path.cwd()))
    try:
        with stoppable():
            try:
                with scoring() as tell, watched(tell), getattr(command, "where", LOCAL).used():
                    command.run()
            finally:
                console.finish()
    except KeyboardInterrupt as stop:
        say("interrupted; repeat the command to resume", failures)
        sys.exit(128 + getattr(stop, "number", signal.SIGINT))
    except (ValueError, OSError, RuntimeError, PhysicsError) as error:
        say(f"error: {error}", failures, style="red")
        sys.exit(2)
