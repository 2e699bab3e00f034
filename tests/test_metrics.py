"""Metrics of the paper against values worked out by hand, and their symmetries."""

from episodes import Agent, Pedestrian, Touch, build_episode, line

from socialnav_mj.episode import Episode, Outcome, Partner


def test_built_episode_is_valid_and_survives_a_file(tmp_path):
    episode = build_episode(
        [
            Agent(positions=line((0, 0), (4, 0), 20), spawn_step=3, delay_steps=2),
            Agent(positions=line((0, 2), (4, 2), 10), outcome=Outcome.TIMED_OUT, goal=(9, 2)),
            Agent(positions=[(1, 1)], outcome=Outcome.NEVER_SPAWNED, goal=(5, 5)),
        ],
        [Pedestrian(positions=line((2, 0), (2, 3), 15))],
        [Touch(agent=0, partner=0, step=4.5), Touch(agent=0, partner=1, step=3, kind=Partner.AGENT)],
    )
    assert episode.n_agents == 3 and episode.n_pedestrians == 1
    assert episode.agent_active.sum(axis=0).tolist() == [20, 10, 0]
    assert episode.contact_agent.tolist() == [0, 1, 0]
    assert Episode.load(episode.save(tmp_path / "a.npz")).metadata == episode.metadata
