"""Who was in the training data: people of the part of the recording that a policy learned from, and the others."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from socialnav_mj.recordings import Recording
from socialnav_mj.studies.levels import Level, levels
from socialnav_mj.studies.panel import Entry, make_panel

IN_SAMPLE, VALIDATION, HELD_OUT = "in-sample", "validation", "held out"
PERIODS = (IN_SAMPLE, VALIDATION, HELD_OUT)
HELD_OUT_MEASURES = ("success", "intrusion_share_of_steps")


def recording_name(dataset: str) -> str:
    """Name that a recording has when it is loaded.

    Args:
        dataset: Its name in the catalogue, or its path.

    Returns:
        Of a path the file's name without its ending.
    """
    return Path(dataset).stem


def learned_from(configuration: Mapping[str, Any]) -> tuple[str, ...]:
    """Recordings that a policy learned from.

    Args:
        configuration: Of the training (`datasets`: names in the catalogue, or paths).

    Returns:
        Their names.
    """
    return tuple(recording_name(dataset) for dataset in configuration["datasets"])


def period_of_people(recording: Recording, configurations: Sequence[Mapping[str, Any]]) -> dict[int, str]:
    """Part of the recording in which each person appears.

    Args:
        recording: That was evaluated.
        configurations: Of the trainings (`datasets`, `train_window` and `validation_window`, shares of the duration).

    Returns:
        Person's id: one of `PERIODS`. A person is held out who appears after the training and validation windows of
        all trainings; everybody is if none of them learned from this recording.

    Raises:
        ValueError: If the trainings used different parts of the recording, so that the periods differ.
    """
    windows = {
        (tuple(c["train_window"]), tuple(c["validation_window"])) if recording.name in learned_from(c) else None
        for c in configurations
    }
    if len(windows) > 1:
        raise ValueError(f"the policies were trained on different parts of {recording.name}: {windows}")
    window = windows.pop()
    if window is None:
        return {int(person): HELD_OUT for person in recording.ids}
    (begin, end), (_, last) = window
    share = recording.start_time / recording.duration
    trained, unseen = (share >= begin) & (share < end), share >= max(end, last)
    names = np.where(unseen, HELD_OUT, np.where(trained, IN_SAMPLE, VALIDATION))
    return {int(person): str(name) for person, name in zip(recording.ids, names, strict=True)}


def held_out_levels(agents: pa.Table, roster: Sequence[Entry], periods: Mapping[int, str]) -> dict[str, list[Level]]:
    """Success and intrusions of the agents that replace people of each period.

    Args:
        agents: Columns of `agents.SCHEMA`.
        roster: Controllers of the experiment.
        periods: Of `period_of_people`.

    Returns:
        Period: levels of `HELD_OUT_MEASURES`, all trainings together; periods without people are left out.
    """
    result = {}
    for period in PERIODS:
        people = [person for person, own in periods.items() if own == period]
        if people:
            panel = make_panel(agents, roster, keep=partial(np.isin, test_elements=people))
            result[period] = levels(panel, HELD_OUT_MEASURES, each_training=False)
    return result
