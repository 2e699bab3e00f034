"""Elementary functions that round alike on every processor.

numpy has vector kernels of its own for many of them and takes those that the processor can run: its tanh and its
complex product round otherwise with AVX2 than without, exp, sin, cos and arctan2 otherwise with AVX-512 than without.
The last bit of one number changes all that a crowd does after it. These here are the C library's, as MuJoCo's are, one
number after the other; about 50 ns each. Sums, products, quotients, roots and `np.hypot` round alike anyhow. Matrix
products do not, whose kernel is BLAS's choice; `np.einsum` without `optimize` has one order.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray


def _each(function: Callable[[float], float], values: ArrayLike) -> NDArray[np.float64]:
    values = np.asarray(values, dtype=float)
    return np.array(list(map(function, values.ravel().tolist())), dtype=float).reshape(values.shape)


def exp(values: ArrayLike) -> NDArray[np.float64]:
    """The exponential function.

    Args:
        values: Of any shape, at most 709; beyond, the C library reports an OverflowError.

    Returns:
        The same shape.
    """
    return _each(math.exp, values)


def tanh(values: ArrayLike) -> NDArray[np.float64]:
    """Hyperbolic tangent.

    Args:
        values: Of any shape.

    Returns:
        The same shape.
    """
    return _each(math.tanh, values)


def sin(values: ArrayLike) -> NDArray[np.float64]:
    """Sine.

    Args:
        values: Of any shape, finite [rad].

    Returns:
        The same shape.
    """
    return _each(math.sin, values)


def cos(values: ArrayLike) -> NDArray[np.float64]:
    """Cosine.

    Args:
        values: Of any shape, finite [rad].

    Returns:
        The same shape.
    """
    return _each(math.cos, values)


def arccos(values: ArrayLike) -> NDArray[np.float64]:
    """Angle of a cosine.

    Args:
        values: Of any shape, in [-1, 1].

    Returns:
        The same shape, in [0, pi] [rad].
    """
    return _each(math.acos, values)


def arctan2(y: ArrayLike, x: ArrayLike) -> NDArray[np.float64]:
    """Angle of a point from the x axis.

    Args:
        y: Of any shape.
        x: Of a shape that broadcasts with it.

    Returns:
        The shape of both together, in [-pi, pi] [rad].
    """
    y, x = np.asarray(y, dtype=float), np.asarray(x, dtype=float)
    if y.shape != x.shape:
        y, x = np.broadcast_arrays(y, x)
    return np.array(list(map(math.atan2, y.ravel().tolist(), x.ravel().tolist())), dtype=float).reshape(y.shape)
