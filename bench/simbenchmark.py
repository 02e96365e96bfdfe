# SPDX-License-Identifier: Apache-2.0
"""What bouncing.py and rolling.py share: timed runs of a batch, and the lines of a table."""

import time

import numpy as np

import tangere


def timed(
    model: tangere.Model, environments: int, controls: np.ndarray, accuracy: float
) -> tuple[tangere.Run, float]:
    """A run on one thread, and the least CPU time of three such runs [s]."""
    seconds = np.inf
    for _ in range(3):
        batch = tangere.Batch(model, environments, threads=1, accuracy=accuracy)
        begin = time.process_time()
        run = batch.run(controls)
        seconds = min(seconds, time.process_time() - begin)
    assert (run.status >= 0).all()
    return run, seconds


def setting(scheme: str, step: float, accuracy: float) -> str:
    return f"{scheme}, {1e3 * step:g} ms" + (f", accuracy {accuracy:g}" if accuracy else "")


def published(engine: str, step: float) -> str:
    return f"{engine}, {1e3 * step:g} ms (published)"


def line(name: str, *numbers: float) -> None:
    print(f"{name:<34}" + "".join(f"{x:13.3g}" for x in numbers), flush=True)
