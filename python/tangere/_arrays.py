# SPDX-License-Identifier: Apache-2.0
"""Arrays of other libraries as NumPy arrays, for functions that need only their numbers."""

from __future__ import annotations

from typing import Any

import numpy as np


def numbers(value: Any) -> np.ndarray:
    """The numbers of any array. Those of a PyTorch tensor come without its gradients."""
    return np.asarray(value.detach().cpu() if hasattr(value, "detach") else value)
