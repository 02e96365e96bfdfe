# SPDX-License-Identifier: Apache-2.0
"""What fresh episodes came to, with Wilson's 95 % interval of the rate p of successes among n:

    (p + z²/2n ± z √(p(1-p)/n + z²/4n²)) / (1 + z²/n),   z = 1.96
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

TEST_SEED = 1000003  # of episodes that policies are tested on; no data set is made with it


def success_summary(solved: Any, returns: Any, actions: Any) -> dict[str, Any]:
    """Of n episodes, each (n): whether it was solved, its return, how many actions it took."""
    episodes, successes, z = len(solved), int(np.sum(solved)), 1.96
    rate = successes / episodes
    middle = rate + z * z / (2 * episodes)
    half = z * math.sqrt(rate * (1 - rate) / episodes + z * z / (4 * episodes**2))
    scale = 1 + z * z / episodes
    return {
        "episodes": episodes,
        "successes": successes,
        "success_rate": rate,
        "interval": [(middle - half) / scale, (middle + half) / scale],
        "mean_return": float(np.mean(returns)),
        "mean_actions": float(np.mean(actions)),
    }
