"""Trained weights in files: safetensors with a card, checked before they are used; networks of them in numpy."""

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import load

from socialnav_mj.controllers.policy_card import PolicyError, read_card
from socialnav_mj.geometry import Array

Layers = tuple[tuple[Array, Array], ...]
"""(weight (out, in), bias (out,)) of each layer."""
Tensors = dict[str, NDArray[Any]]


def forward(layers: Layers, values: Array) -> Array:
    """Linear layers with ReLU between them.

    Args:
        layers: Of the network.
        values: Shape (n, inputs).

    Returns:
        Shape (n, outputs).
    """
    for number, (weight, bias) in enumerate(layers, start=1):
        # Not a matrix product, whose order of summation is BLAS's choice for the processor, see `elementary`.
        values = np.einsum("ni,oi->no", values, weight) + bias
        if number < len(layers):
            values = np.maximum(values, 0.0)
    return values


def read_weights(path: Path) -> tuple[dict[str, Any], str, Tensors]:
    """Read NAME.safetensors and NAME.json; never runs code from them.

    Args:
        path: Of the .safetensors file; its card is beside it.

    Returns:
        The card, the sha256 of the weights' file, which is the card's, and the tensors by name.

    Raises:
        PolicyError: If the files are damaged or contradict each other.
    """
    card_path = path.with_suffix(".json")
    card, content = read_card(card_path), path.read_bytes()
    checksum = hashlib.sha256(content).hexdigest()
    if checksum != card["sha256"]:
        raise PolicyError(f"{path} has sha256 {checksum}, but its card {card_path.name} says {card['sha256']}")
    try:
        tensors: Tensors = load(content)
    except Exception as error:
        # Which exceptions a file that was made to do harm can provoke here is the library's matter.
        raise PolicyError(f"{path} is no readable safetensors file: {error!r}") from error
    return card, checksum, tensors


def networks_of(path: Path, tensors: Tensors, shapes: dict[str, tuple[int, int]]) -> dict[str, Layers]:
    """Networks made of tensors; all tensors are used.

    Args:
        path: Of the file, for error messages.
        tensors: "NETWORK.NUMBER.weight" and "NETWORK.NUMBER.bias".
        shapes: Of each network: inputs, outputs.

    Returns:
        Layers that follow one another from so many inputs to so many outputs.

    Raises:
        PolicyError: If a tensor is missing, unknown, of another shape, or holds what could overflow.
    """
    networks = {name: _layers(path, tensors, name, *shape) for name, shape in shapes.items()}
    used = {f"{n}.{i}.{k}" for n, own in networks.items() for i in range(len(own)) for k in ("weight", "bias")}
    if unknown := sorted({*tensors} - used):
        raise PolicyError(f"{path}: it has unknown tensors {', '.join(unknown)}")
    return networks


def _layers(path: Path, tensors: Tensors, network: str, inputs: int, outputs: int) -> Layers:
    layers: list[tuple[Array, Array]] = []
    width = inputs
    while not layers or any(f"{network}.{len(layers)}.{kind}" in tensors for kind in ("weight", "bias")):
        name = f"{network}.{len(layers)}"
        weight, bias = _numbers(path, tensors, f"{name}.weight"), _numbers(path, tensors, f"{name}.bias")
        if weight.ndim != 2 or weight.shape[1] != width or bias.shape != weight.shape[:1]:
            raise PolicyError(
                f"{path}: {name} has weight {weight.shape} and bias {bias.shape}; expected (n, {width}) and (n,)"
            )
        layers.append((weight, bias))
        width = weight.shape[0]
    if width != outputs:
        raise PolicyError(f"{path}: the {network} maps {inputs} to {width} numbers; expected {inputs} to {outputs}")
    return tuple(layers)


def _numbers(path: Path, tensors: Tensors, key: str) -> Array:
    """A tensor whose values cannot overflow in the forward pass."""
    if key not in tensors:
        raise PolicyError(f"{path}: it lacks {key}")
    if tensors[key].dtype.kind != "f":
        raise PolicyError(f"{path}: {key} holds {tensors[key].dtype}; expected floating-point numbers")
    values = tensors[key].astype(float)
    if not (np.abs(values) <= np.finfo(np.float32).max).all():
        raise PolicyError(f"{path}: {key} holds values that are not finite, or too large for single precision")
    return values


def checked_checksum(policy: str, found: str, wanted: str | None) -> str:
    """The sha256 of a policy's weights, if it is the one that is asked for.

    Args:
        policy: Its name or path.
        found: That its weights have.
        wanted: That they must have; None takes them as they are.

    Returns:
        `found`.

    Raises:
        PolicyError: If they differ.
    """
    if wanted not in (None, found):
        raise PolicyError(f"policy {policy!r} has checksum {found}, but {wanted} is asked for")
    return found
