# SPDX-License-Identifier: Apache-2.0
"""Arrays of other libraries as NumPy arrays, for functions that need only their numbers."""

from __future__ import annotations

from typing import Any

import numpy as np


def numbers(value: Any) -> np.ndarray:
    """The numbers of any array. Those of a PyTorch tensor come without its gradients."""
    return np.asarray(value.detach().cpu() if hasattr(value, "detach") else value)


def is_picture(values: np.ndarray) -> bool:
    """Whether an array keeps its type in observations: bytes of a picture, int16 of its bodies."""
    return values.dtype in (np.uint8, np.int16) and values.ndim > 1


def singles(values: Any) -> np.ndarray:
    """A new array of float32. A number that is too large for it becomes infinite, without NumPy's
    warning: the caller says what is wrong."""
    with np.errstate(over="ignore"):
        return np.array(values, np.float32)
