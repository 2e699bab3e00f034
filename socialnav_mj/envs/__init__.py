"""Crowds as environments of other libraries: Gymnasium, its vector environments, PettingZoo, stable-baselines3.

Importing this registers the four scenarios, so that `gymnasium.make` and `gymnasium.make_vec` find them.
"""

from gymnasium.envs import registration

SCENARIOS = (1, 2, 3, 4)
ENVIRONMENT_ID = "SocialNavMJ/Scenario{number}-v0"

for number in SCENARIOS:
    registration.register(
        id=ENVIRONMENT_ID.format(number=number),
        entry_point="socialnav_mj.envs.single:CrowdEnv",
        vector_entry_point="socialnav_mj.envs.vector:CrowdVectorEnv",
        kwargs={"scenario": number},
    )
