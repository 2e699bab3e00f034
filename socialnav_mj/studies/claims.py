"""The paper's results, sentence by sentence, as comparisons that `findings` puts to the test."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from socialnav_mj.studies.panel import COMMON, MIXED, POTENTIAL_FIELD, REPLAY_IRL, Term

SCENARIOS = ("scenario_1", "scenario_2", "scenario_3", "scenario_4")
HUMANS_DOMINATE, AGENTS_DOMINATE = SCENARIOS[:2], SCENARIOS[2:]
COMPARABLE = 0.2
"""Intrusions that differ by less than this share of the learned policy's are comparable; the paper gives no margin."""

TIME, PATH = f"completion_time_success{COMMON}", f"distance_to_displacement_success{COMMON}"
COUNT, SHARE = "intimate_intrusions", "intrusion_share_of_steps"
SHORT = {POTENTIAL_FIELD: "potential field", REPLAY_IRL: "ReplayIRL", MIXED: "hybrid"}


@dataclass(frozen=True, kw_only=True)
class Part:
    """One comparison of a claim, turned so that the claim says it is greater than 0."""

    label: str
    """What is subtracted from what."""
    terms: tuple[Term, ...]


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A sentence of the paper as comparisons that must all be greater than 0."""

    key: str
    sentence: str
    """What the paper says."""
    test: str
    """What is compared."""
    unit: str
    """Of the comparisons."""
    parts: tuple[Part, ...]


def _minus(one: str, other: str, scenario: str, measure: str, *, lower: bool = False) -> Part:
    """`one` above `other` in a scenario; with lower, below it."""
    high, low = (other, one) if lower else (one, other)
    return Part(
        label=f"{scenario}: {SHORT[high]} - {SHORT[low]}",
        terms=(
            Term(factor=1.0, method=high, scenario=scenario, measure=measure),
            Term(factor=-1.0, method=low, scenario=scenario, measure=measure),
        ),
    )


def _beats(one: str, others: Sequence[str], measure: str, *, lower: bool = False) -> tuple[Part, ...]:
    """`one` above (below) each of the others in every scenario."""
    return tuple(_minus(one, other, scenario, measure, lower=lower) for scenario in SCENARIOS for other in others)


def _gap_falls(one: str, other: str, measure: str) -> tuple[Part, ...]:
    """The difference of two methods is smaller in the last scenario than in the first."""
    first, last = SCENARIOS[0], SCENARIOS[-1]
    signs = ((1.0, one, first), (-1.0, other, first), (-1.0, one, last), (1.0, other, last))
    gap = f"({SHORT[one]} - {SHORT[other]})"
    return (
        Part(
            label=f"{gap} in {first} - {gap} in {last}",
            terms=tuple(Term(factor=f, method=m, scenario=s, measure=measure) for f, m, s in signs),
        ),
    )


def _rises(method: str, measure: str) -> tuple[Part, ...]:
    """Higher in every scenario than in the one before; two scenarios of a draw have different agents."""
    return tuple(
        Part(
            label=f"{SHORT[method]}: {after} - {before}",
            terms=(
                Term(factor=1.0, method=method, scenario=after, measure=measure),
                Term(factor=-1.0, method=method, scenario=before, measure=measure),
            ),
        )
        for before, after in pairwise(SCENARIOS)
    )


def _comparable(one: str, other: str, measure: str) -> tuple[Part, ...]:
    """`one` within COMPARABLE of `other` in every scenario."""
    parts = []
    for scenario in SCENARIOS:
        for factor, sign in ((1.0 + COMPARABLE, 1.0), (1.0 - COMPARABLE, -1.0)):
            bound = f"{factor:g} {SHORT[other]}"
            label = f"{bound} - {SHORT[one]}" if sign > 0.0 else f"{SHORT[one]} - {bound}"
            parts.append(
                Part(
                    label=f"{scenario}: {label}",
                    terms=(
                        Term(factor=sign * factor, method=other, scenario=scenario, measure=measure),
                        Term(factor=-sign, method=one, scenario=scenario, measure=measure),
                    ),
                )
            )
    return tuple(parts)


_OTHERS = (REPLAY_IRL, MIXED)
_BROUGHT_HOME = "agents that every controller brought home without a collision"

CLAIMS: tuple[Claim, ...] = (
    Claim(
        key="a",
        sentence="Across all scenarios the mixed policy has the highest success (Fig. 1).",
        test="success of hybrid above both others, in all four scenarios",
        unit="share of agents",
        parts=_beats(MIXED, (POTENTIAL_FIELD, REPLAY_IRL), "success"),
    ),
    Claim(
        key="b1",
        sentence="Potential field agents have the highest speed (Fig. 2).",
        test="average speed above both others, in all four scenarios",
        unit="m/s",
        parts=_beats(POTENTIAL_FIELD, _OTHERS, "average_speed"),
    ),
    Claim(
        key="b2",
        sentence="Potential field agents take the most direct routes (Fig. 3).",
        test=f"path / displacement below both others, in all four scenarios, over {_BROUGHT_HOME}",
        unit="ratio",
        parts=_beats(POTENTIAL_FIELD, _OTHERS, PATH, lower=True),
    ),
    Claim(
        key="b3",
        sentence="Potential field agents intrude most; both others commit significantly less (Fig. 4).",
        test="steps within 1.2 m of a pedestrian, above both others, in all four scenarios",
        unit="steps an agent",
        parts=_beats(POTENTIAL_FIELD, _OTHERS, COUNT),
    ),
    Claim(
        key="b4",
        sentence="The same, without the advantage of arriving sooner.",
        test="share of steps within 1.2 m, above both others, in all four scenarios",
        unit="share of steps",
        parts=_beats(POTENTIAL_FIELD, _OTHERS, SHARE),
    ),
    Claim(
        key="c1",
        sentence="The IRL model outperforms the potential field at higher densities of pedestrians.",
        test="success of ReplayIRL above potential field, in scenarios 1 and 2",
        unit="share of agents",
        parts=tuple(_minus(REPLAY_IRL, POTENTIAL_FIELD, s, "success") for s in HUMANS_DOMINATE),
    ),
    Claim(
        key="c2",
        sentence="The potential field outperforms the IRL model at higher densities of agents.",
        test="success of potential field above ReplayIRL, in scenarios 3 and 4",
        unit="share of agents",
        parts=tuple(_minus(POTENTIAL_FIELD, REPLAY_IRL, s, "success") for s in AGENTS_DOMINATE),
    ),
    Claim(
        key="d1",
        sentence="The mixed policy speeds up as the number of agents rises (Fig. 2).",
        test="average speed of hybrid in each scenario above that in the one before",
        unit="m/s",
        parts=_rises(MIXED, "average_speed"),
    ),
    Claim(
        key="d2",
        sentence="Its speed approaches that of the potential field (Fig. 2).",
        test="the potential field's lead in speed is smaller in scenario 4 than in scenario 1",
        unit="m/s",
        parts=_gap_falls(POTENTIAL_FIELD, MIXED, "average_speed"),
    ),
    Claim(
        key="e1",
        sentence="In all scenarios the mixed policy keeps intrusions comparable to the IRL agent's (Fig. 4).",
        test=f"steps within 1.2 m of hybrid within {COMPARABLE:.0%} of ReplayIRL's, in all four scenarios",
        unit="steps an agent",
        parts=_comparable(MIXED, REPLAY_IRL, COUNT),
    ),
    Claim(
        key="e2",
        sentence="The same, without the effect of arriving sooner or later.",
        test=f"share of steps within 1.2 m of hybrid within {COMPARABLE:.0%} of ReplayIRL's, in all four scenarios",
        unit="share of steps",
        parts=_comparable(MIXED, REPLAY_IRL, SHARE),
    ),
    Claim(
        key="f1",
        sentence="The potential field has the lowest completion time in all scenarios (Fig. 5).",
        test=f"completion time below both others, in all four scenarios, over {_BROUGHT_HOME}",
        unit="s",
        parts=_beats(POTENTIAL_FIELD, _OTHERS, TIME, lower=True),
    ),
    Claim(
        key="f2",
        sentence="The same over all agents, not only over those that succeed.",
        test="time under way below both others, in all four scenarios, time-outs counted with the time watched",
        unit="s",
        parts=_beats(POTENTIAL_FIELD, _OTHERS, "time_under_way", lower=True),
    ),
    Claim(
        key="f3",
        sentence="The mixed policy's competitiveness in time rises as pedestrians become fewer (Fig. 5).",
        test=f"hybrid loses less time to the potential field in scenario 4 than in scenario 1, over {_BROUGHT_HOME}",
        unit="s",
        parts=_gap_falls(MIXED, POTENTIAL_FIELD, TIME),
    ),
    Claim(
        key="g1",
        sentence="The mixed policy is better than the IRL agent at completion time.",
        test=f"completion time of hybrid below ReplayIRL's, in all four scenarios, over {_BROUGHT_HOME}",
        unit="s",
        parts=_beats(MIXED, (REPLAY_IRL,), TIME, lower=True),
    ),
    Claim(
        key="g2",
        sentence="The mixed policy is better than the IRL agent at directness of route.",
        test=f"path / displacement of hybrid below ReplayIRL's, in all four scenarios, over {_BROUGHT_HOME}",
        unit="ratio",
        parts=_beats(MIXED, (REPLAY_IRL,), PATH, lower=True),
    ),
    Claim(
        key="g3",
        sentence="With many pedestrians its routes are like the IRL agent's, with few more direct (Fig. 3).",
        test=f"hybrid gains more directness on ReplayIRL in scenario 4 than in scenario 1, over {_BROUGHT_HOME}",
        unit="ratio",
        parts=_gap_falls(MIXED, REPLAY_IRL, PATH),
    ),
)
"""(a) success; (b) the potential field; (c) density; the mixed policy's (d) speed and (e) intrusions; (f) time; (g) the
mixed policy beside the IRL agent in time and path."""
