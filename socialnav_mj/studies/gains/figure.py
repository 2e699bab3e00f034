"""Success against nearness to people, at every setting of the gains."""

from collections.abc import Sequence
from pathlib import Path

from socialnav_mj.report.style import new_figure, save, style
from socialnav_mj.studies.gains.ranges import Sweep
from socialnav_mj.studies.looks import LOOKS, short_title
from socialnav_mj.studies.panel import MIXED, REPLAY_IRL

_X, _Y = "intrusion_share_of_steps", "success"


def draw_gains(sweeps: Sequence[Sweep], folder: Path) -> list[Path]:
    """A row for each recording, a sub-figure for each scenario, a mark for each setting.

    Args:
        sweeps: Of every recording and form.
        folder: Gets a PNG and an SVG.

    Returns:
        Paths of the files.
    """
    recordings = list(dict.fromkeys(sweep.recording for sweep in sweeps))
    scenarios = sweeps[0].scenarios
    with style():
        figure = new_figure(0.7 + 1.9 * len(recordings))
        grid = figure.subplots(len(recordings), len(scenarios), sharex="col", squeeze=False)
        for row, recording in zip(grid, recordings, strict=True):
            own = [sweep for sweep in sweeps if sweep.recording == recording]
            for place, (axes, scenario) in enumerate(zip(row, scenarios, strict=True)):
                for sweep in own:
                    look = LOOKS[sweep.form]
                    x, y = sweep.values(scenario, _X), sweep.values(scenario, _Y)
                    common = {"linestyle": "", "marker": look.marker, "color": look.colour, "markeredgecolor": "black"}
                    axes.plot(x[1:], y[1:], **common, markersize=3.5, markeredgewidth=0.3, label=look.label)
                    axes.plot(
                        x[:1], y[:1], **common, markersize=8.0, markeredgewidth=1.2, label=f"{look.label}, default"
                    )
                for method in (REPLAY_IRL, MIXED):
                    look = LOOKS[method]
                    point = [[own[0].learned(scenario, method, measure)] for measure in (_X, _Y)]
                    axes.plot(
                        *point, linestyle="", marker=look.marker, color=look.colour, markersize=7.0, label=look.label
                    )
                axes.set_title(
                    f"{recording}, {short_title(scenario, place)}" if place == 0 else short_title(scenario, place)
                )
                axes.grid(visible=True, axis="both")
            row[0].set_ylabel("share of agents that succeed")
        for axes in grid[-1]:
            axes.set_xlabel("share of steps within 1.2 m")
        handles, labels = grid[0][0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=3)
        return save(figure, folder, "gains")
