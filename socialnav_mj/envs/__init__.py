"""Crowds as environments of other libraries: Gymnasium, its vector environments, PettingZoo, stable-baselines3."""

SCENARIOS = (1, 2, 3, 4)
ENVIRONMENT_ID = "SocialNavMJ/Scenario{number}-v0"


def register() -> None:
    """Make `gymnasium.make` and `gymnasium.make_vec` find the four scenarios.

    Gymnasium calls this by itself when it is imported, if the package is installed (entry point `gymnasium.envs`).
    """
    from gymnasium.envs import registration

    for number in SCENARIOS:
        name = ENVIRONMENT_ID.format(number=number)
        if name not in registration.registry:
            registration.register(
                id=name,
                entry_point="socialnav_mj.envs.single:CrowdEnv",
                vector_entry_point="socialnav_mj.envs.vector:CrowdVectorEnv",
                kwargs={"scenario": number},
            )
