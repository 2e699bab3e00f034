"""ReplayIRL: maximum-entropy inverse reinforcement learning on the replay buffer of an off-policy learner."""
