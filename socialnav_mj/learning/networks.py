"""Small networks of one shape side by side in one array, with their gradients written out.

A network of two layers of 64 is a few products of small matrices, so that torch spends most of its time on walking
modules and building graphs. Here the weights of torch modules lie in one array, each network's behind the other's; the
modules go on using them, and numpy multiplies all networks at once.
"""

import math
from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

Array = NDArray[np.float32]


class Parameters:
    """Parameters of torch modules in one array, which the modules share."""

    def __init__(self, groups: Sequence[Sequence[torch.Tensor]]) -> None:
        """Move the values into one array.

        Args:
            groups: Parameters of equal shape in each; those of a group lie side by side.
        """
        sizes = [sum(p.numel() for p in group) for group in groups]
        self.flat: Array = np.zeros(sum(sizes), dtype=np.float32)
        self.flat_gradient: Array = np.zeros_like(self.flat)
        self.values: list[Array] = []
        """Of each group, shape (group, *shape)."""
        self.gradients: list[Array] = []
        """Likewise, to be set."""
        begin = 0
        for group, size in zip(groups, sizes, strict=True):
            shape = (len(group), *group[0].shape)
            value = self.flat[begin : begin + size].reshape(shape)
            for row, parameter in zip(value, group, strict=True):
                row[...] = parameter.detach().numpy()
                parameter.data = torch.from_numpy(row)
            self.values.append(value)
            self.gradients.append(self.flat_gradient[begin : begin + size].reshape(shape))
            begin += size


class Adam:
    """Adam with torch's defaults (Kingma and Ba 2015, doi 10.48550/arXiv.1412.6980)."""

    def __init__(self, parameters: Parameters) -> None:
        """Begin with no moments.

        Args:
            parameters: To be stepped by their gradients.
        """
        self.parameters = parameters
        self.mean, self.square = np.zeros_like(parameters.flat), np.zeros_like(parameters.flat)
        self.steps = 0

    def step(self, learning_rate: float) -> None:
        """Step against the gradients.

        Args:
            learning_rate: Of this step.
        """
        gradient = self.parameters.flat_gradient
        self.steps += 1
        self.mean += 0.1 * (gradient - self.mean)
        self.square *= 0.999
        self.square += 0.001 * gradient**2
        spread = np.sqrt(self.square)
        spread *= 1.0 / math.sqrt(1.0 - 0.999**self.steps)
        spread += 1e-8
        np.divide(self.mean, spread, out=spread)
        spread *= learning_rate / (1.0 - 0.9**self.steps)
        self.parameters.flat -= spread

    def state(self) -> dict[str, torch.Tensor | int]:
        """Moments and steps, for a checkpoint.

        Returns:
            What `restore` takes.
        """
        return {
            "mean": torch.from_numpy(self.mean.copy()),
            "square": torch.from_numpy(self.square.copy()),
            "steps": self.steps,
        }

    def restore(self, state: dict[str, torch.Tensor | int]) -> None:
        """Go on from a checkpoint.

        Args:
            state: As `state` returns it.
        """
        self.mean[:], self.square[:] = np.asarray(state["mean"]), np.asarray(state["square"])
        self.steps = int(state["steps"])


class Perceptrons:
    """Networks of linear layers with ReLU between them, all of the same shape."""

    def __init__(self, modules: Sequence[nn.Module]) -> None:
        """Collect the layers; their parameters are moved into one array.

        Args:
            modules: Each nn.Sequential of linear layers and ReLUs.

        Raises:
            TypeError: If there is anything else in one.
        """
        layers = [_linear_layers(module) for module in modules]
        self.parameters = Parameters(
            [group for column in zip(*layers, strict=True) for group in _weights_and_biases(column)]
        )
        self.weights, self.biases = self.parameters.values[::2], [b[:, None] for b in self.parameters.values[1::2]]

    def forward(self, value: Array) -> list[Array]:
        """Values before the first layer and after each.

        Args:
            value: Shape (n, size), for all networks, or (networks, n, size).

        Returns:
            The argument, then an array of shape (networks, n, width) a layer; all but the last are behind the ReLU.
        """
        values = [value]
        for number, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            value = value @ weight.transpose(0, 2, 1)
            value += bias
            if number < len(self.weights) - 1:
                np.maximum(value, np.float32(0.0), out=value)
            values.append(value)
        return values

    def backward(self, values: list[Array], gradient: Array) -> None:
        """Set the parameters' gradients.

        Args:
            values: As `forward` returns them.
            gradient: Of the last of them.
        """
        gradients = self.parameters.gradients
        for number in reversed(range(len(self.weights))):
            np.matmul(gradient.transpose(0, 2, 1), values[number], out=gradients[2 * number])
            gradient.sum(axis=1, out=gradients[2 * number + 1])
            if number:
                gradient = gradient @ self.weights[number]
                gradient *= values[number] > 0.0

    def backward_to_inputs(self, values: list[Array], gradient: Array, begin: int) -> Array:
        """Gradient of the arguments.

        Args:
            values: As `forward` returns them.
            gradient: Of the last of them.
            begin: First of the argument's numbers that it is wanted for.

        Returns:
            Shape (networks, n, size - begin).
        """
        for number in reversed(range(1, len(self.weights))):
            gradient = gradient @ self.weights[number]
            gradient *= values[number] > 0.0
        result: Array = gradient @ self.weights[0][:, :, begin:]
        return result


def _linear_layers(module: nn.Module) -> list[nn.Linear]:
    parts = list(module.children())
    alternating = all(isinstance(part, nn.ReLU if i % 2 else nn.Linear) for i, part in enumerate(parts))
    if not isinstance(module, nn.Sequential) or not alternating or len(parts) % 2 == 0:
        raise TypeError(f"{module} is not a sequence of linear layers with ReLU between them")
    return [part for part in parts if isinstance(part, nn.Linear)]


def _weights_and_biases(layers: Sequence[nn.Linear]) -> tuple[list[torch.Tensor], list[torch.Tensor]]:
    return [layer.weight for layer in layers], [layer.bias for layer in layers]
