# SPDX-License-Identifier: Apache-2.0
"""What Python adds to a step of 1024 environments, as a share of the whole, and rows read a second.

    PYTHONPATH=build/release/python build/venv/bin/python bench/python_overhead.py [TASK]

Alternates between the call into C++ alone and the whole of VectorTaskEnv.step(), from the same
states, and prints CPU seconds of both.
"""

import sys
import time

import numpy as np

import tangere

task = sys.argv[1] if len(sys.argv) > 1 else "box_pushing"
env = tangere.make_vec(task, 1024, threads=1)
env.reset(seed=0)
actions = np.zeros((1024, *env.task.action.shape))


def cpu(call, times: int = 10) -> float:
    begin = time.process_time()
    for _ in range(times):
        call()
    return (time.process_time() - begin) / times


def rest() -> None:  # all of step() but the call into C++
    env._env.rewards(), env._env.terminated(), env._env.truncated()
    env._observe(), env._info()


alone, more = [], []
for _ in range(8):
    alone.append(cpu(lambda: env._env.step(actions)))
    more.append(cpu(rest))
step, added = np.median(alone), np.median(more)
share = step / (step + added)
print(f"{task}: step {1e3 * step:.2f} ms, Python adds {1e3 * added:.2f} ms: {share:.3f} of C++")
