"""claims.md: the verdict on every sentence of the paper, the rule behind it, and the verdicts under other settings."""

from collections.abc import Mapping, Sequence
from math import isnan

from socialnav_mj.report.intervals import LEAST, ONE_RECORDING, Interval
from socialnav_mj.report.markdown import bounds, head, row
from socialnav_mj.report.power import told_size
from socialnav_mj.studies.claims import COMPARABLE, Part
from socialnav_mj.studies.findings import Finding, Verdict

WOULD_TAKE = """\
*To decide*: the draws and trainings, at least as many as here and with the fewest episodes in all, at which the \
interval is expected to leave out 0, were every difference as large as the one found.
"""
"""What stands in the column."""
_RULE = f"""\
- A claim is a list of comparisons, each a mean difference turned so that the claim says "greater than 0".
- A comparison **holds** if its 95 % interval lies above 0, **fails** if it lies below 0, and is **undecided** if the \
interval covers 0 or there is none.
- A claim **holds** if all its comparisons hold, **fails** if at least one fails, and is **undecided** otherwise. A \
claim about all four scenarios so needs all four. With every comparison at its own 95 %, a claim that holds is wrong \
in at most 2.5 % of studies; a claim of eight comparisons that are all exactly 0 would fail by chance in up to 20 %.
- Within a draw all controllers drove the same agents. A comparison is taken agent by agent, averaged over the draw's \
agents, then over draws; learned policies are compared training by training, the potential field standing beside each.
- Draws and training seeds are crossed random effects: the interval is Student's with the variance of both and \
Satterthwaite's degrees of freedom (`socialnav_mj.report.intervals`; docs/results.md has its simulated coverage). The \
interval **for the trainings at hand** is over draws alone, and its verdict stands in brackets where it differs. With \
fewer than {LEAST} trainings there is no other. {ONE_RECORDING}
- "Comparable" has no margin in the paper; here it is {COMPARABLE:.0%} of ReplayIRL's value to either side.
- Time and path are compared over the agents that every controller brought home without a collision; over each one's \
own successes a fragile controller would keep only the short trips. Claim f2 takes everybody, time-outs with the time \
they were watched.
"""


def claims_page(findings: Mapping[str, Sequence[Finding]], *, titles: Mapping[str, str], command: str) -> str:
    """Text of claims.md: a table of verdicts, the rule, and a section for each claim with its comparisons.

    Args:
        findings: Setting: one finding for each claim; the first setting is the default.
        titles: Setting: what it changes.
        command: Command line that wrote the page.

    Returns:
        Markdown.
    """
    names = list(findings)
    default = findings[names[0]]
    lines = ["# The paper's claims", "", f"Command: `{command}`", "", "## Verdicts", ""]
    lines += head(["claim", "the paper says", *(titles[name] for name in names), f"to decide, {titles[names[0]]}"])
    for place, finding in enumerate(default):
        verdicts = [_verdict(findings[name][place]) for name in names]
        lines.append(row([f"({finding.claim.key})", finding.claim.sentence, *verdicts, to_decide(finding)]))
    lines += ["", WOULD_TAKE.rstrip()]
    lines += ["", "## How a verdict comes about", "", _RULE]
    for place, finding in enumerate(default):
        lines += _section(finding, {name: findings[name][place] for name in names[1:]}, titles)
    return "\n".join(lines) + "\n"


def to_decide(finding: Finding) -> str:
    """What it would take to decide a claim.

    Args:
        finding: Of the claim.

    Returns:
        "-" if it is decided; "the comparisons not run" if there are any.
    """
    if finding.verdict != "undecided":
        return "-"
    return "the comparisons not run" if finding.missing else told_size(finding.would_take)


def share_of(count: int, total: int) -> str:
    """A number of agents as text.

    Args:
        count: Some of them.
        total: All.

    Returns:
        Such as "177 of 430 (41 %)".
    """
    return f"{count} of {total}" + (f" ({count / total:.0%})".replace("%", " %") if total else "")


def _section(finding: Finding, others: Mapping[str, Finding], titles: Mapping[str, str]) -> list[str]:
    claim = finding.claim
    lines = [f"## ({claim.key}) {claim.sentence}", "", f"Test: {claim.test} [{claim.unit}].", ""]
    lines += [f"Default setting: **{_verdict(finding)}**.", ""]
    if finding.verdict == "undecided":
        lines += [f"To decide: {to_decide(finding)}.", ""]
    if finding.same_agents:
        counts = (f"{name} {share_of(*count)}" for name, count in finding.same_agents.items())
        lines += [f"Agents that every controller brought home: {', '.join(counts)}.", ""]
    lines += head(["comparison", "effect", "95 % interval", "for the trainings at hand", "verdict", "draws"])
    for part, interval, verdict in finding.parts:
        given = bounds(interval.low_given, interval.high_given, sign="+")
        count = f"{interval.n_draws}" + (f" x {interval.n_trainings} trainings" if interval.n_trainings else "")
        cells = [
            part.label,
            f"{interval.mean:+.3f}",
            bounds(interval.low, interval.high, sign="+"),
            given,
            verdict,
            count,
        ]
        lines.append(row(cells))
    lines += [row([label, "not run", "-", "-", "undecided", "0"]) for label in finding.missing] + [""]
    if others:
        lines += head(["setting", "verdict", "its weakest comparison", "effect", "95 % interval", "draws"])
        for name, other in others.items():
            if not other.parts:
                lines.append(row([titles[name], other.verdict, "none was run", "-", "-", "0"]))
                continue
            part, interval, _ = min(other.parts, key=_strength)
            effect = [f"{interval.mean:+.3f}", bounds(interval.low, interval.high, sign="+")]
            lines.append(row([titles[name], _verdict(other), part.label, *effect, f"{interval.n_draws}"]))
        lines.append("")
    return lines


def _strength(item: tuple[Part, Interval, Verdict]) -> tuple[int, float]:
    """What fails comes first, then by the lower end."""
    _, interval, verdict = item
    return (0 if verdict == "fails" else 1, interval.mean if isnan(interval.low) else interval.low)


def _verdict(finding: Finding) -> str:
    if finding.verdict == finding.verdict_given:
        return finding.verdict
    return f"{finding.verdict} ({finding.verdict_given})"
