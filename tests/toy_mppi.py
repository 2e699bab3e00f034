"""A toy problem for path-integral control, and what pytorch-mppi 0.9.1 commands in it.

`python tests/toy_mppi.py` prints the commands anew; it needs torch, pytorch-mppi and arm-pytorch-utilities. The noise
is numpy's, so that others can be fed the same.
"""

import sys

import numpy as np

STEPS, SAMPLES, COMMANDS = 8, 24, 6
TEMPERATURE = 0.3
DEVIATION = np.array([0.4, 0.7])
LOW, HIGH = np.array([-0.5, -1.0]), np.array([1.0, 1.0])
START, GOAL, OBSTACLE = np.array([0.0, 0.0]), np.array([2.0, 0.5]), np.array([1.0, 0.1])


def noise() -> np.ndarray:
    """Of every command, (commands, samples, steps, 2)."""
    return DEVIATION * np.random.default_rng(11).standard_normal((COMMANDS, SAMPLES, STEPS, 2))


def moved(place, control):
    """A point that is driven by its velocity, 0.25 s later; for numpy and torch."""
    return place + 0.25 * control


def cost(place, goal=GOAL, obstacle=OBSTACLE):
    """Squared distance to the goal, and a hill in the way; for numpy and torch, (..., 2) to (...)."""
    gap = place - obstacle
    return ((place - goal) ** 2).sum(-1) + 2.0 / (1.0 + 8.0 * (gap**2).sum(-1))


def reference() -> list[list[float]]:
    """Commands of pytorch-mppi, each driven before the next is asked for."""
    import torch
    from pytorch_mppi import MPPI

    goal, obstacle = torch.as_tensor(GOAL), torch.as_tensor(OBSTACLE)
    drawn = iter(noise())
    MPPI._sample_noise = lambda self, shape: torch.as_tensor(next(drawn))
    controller = MPPI(
        lambda state, action: moved(state, action),
        lambda state, action: cost(state, goal, obstacle),
        2,
        torch.diag(torch.as_tensor(DEVIATION**2)),
        num_samples=SAMPLES,
        horizon=STEPS,
        lambda_=TEMPERATURE,
        u_min=torch.as_tensor(LOW),
        u_max=torch.as_tensor(HIGH),
        U_init=torch.zeros((STEPS, 2), dtype=torch.double),
        u_init=torch.zeros(2, dtype=torch.double),
    )
    place, commands = torch.as_tensor(START), []
    for _ in range(COMMANDS):
        command = controller.command(place)
        commands.append(command.tolist())
        place = moved(place, command)
    return commands


if __name__ == "__main__":
    sys.stdout.write(f"{reference()}\n")
