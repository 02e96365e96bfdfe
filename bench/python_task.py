# SPDX-License-Identifier: Apache-2.0
"""Tasks written in Python against their C++ brothers, on one thread: steps and data sets.

    PYTHONPATH=build/release/python build/venv/bin/python bench/python_task.py

Alternates between the two on equal work: `ball_rolling_small`, with a field of 32 × 32 points in
every observation, and `stable_grasp`, with random shifts. Prints CPU milliseconds of a step of 1024
environments and their ratio. Then the same function plays 512 episodes of the first task: in Python
without storing, and into data sets of both. Prints seconds, CPU seconds (writing and the C++
command included) and what the median of five runs makes of them. It needs PyTorch, with which
`stable_grasp` computes.
"""

import resource
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import tangere
import tangere.data

sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))
from stable_grasp import StableGrasp  # noqa: E402

ENVS, EPISODES, AT_ONCE = 1024, 512, 128


class Rolling(tangere.VectorSceneEnv):
    scene = tangere.scenes()["rolling_ball_small"]
    steps_per_action, horizon = 5, 70

    def restart(self, envs):
        if not hasattr(self, "goal"):
            self.goal = np.zeros((self.num_envs, 2))
        self.goal[envs] = self.batch.q[envs, 3:5] + self.uniform(envs, [-0.01] * 2, 0.01)

    def observe(self):
        q = self.batch.q
        field = self.batch.tactile("pad")
        return {"pad": q[:, :3], "goal": self.goal - q[:, 3:5], "tactile": field}

    def reward(self, actions):
        distance = self.goal - self.batch.q[:, 3:5]
        return -(distance**2).sum(1) / 1e-4 - 0.01 * (actions**2).sum(1)


def cpu(env, actions) -> float:
    begin = time.process_time()
    env.step(actions)
    return 1e3 * (time.process_time() - begin)


def compare(kind, brother, low, high, count, skipped):
    """Prints the times of a step with uniform actions, (na) bounds. The first ones do not count."""
    words = {"threads": 1, "seed": 1}
    ours, theirs = kind(ENVS, **words), tangere.make_vec(brother, ENVS, **words)
    ours.reset(), theirs.reset()
    times = []
    for _ in range(count):
        actions = np.random.default_rng(len(times)).uniform(low, high, (ENVS, len(low)))
        times.append((cpu(ours, actions), cpu(theirs, actions)))
    mine, other = np.mean(times[skipped:], axis=0)
    print(f"{brother}: Python {mine:.2f} ms, C++ {other:.2f} ms: {other / mine:.2f} of its rate")


compare(Rolling, "ball_rolling_small", [-0.3] * 3, [0.1] * 3, 60, 20)  # then pads touch
compare(StableGrasp, "stable_grasp", [-0.5], [0.5], 20, 0)


def choose(obs, episodes, actions):
    """Rolls the ball to the goal under a light press."""
    return np.concatenate([20 * obs["goal"], np.full((len(episodes), 1), -0.2)], 1)


def step_alone(folder):
    env = Rolling(AT_ONCE, threads=1, seed=1, autoreset="same_step")
    obs, _ = env.reset()
    for _ in range(EPISODES // AT_ONCE * env.horizon):
        obs = env.step(choose(obs, env.episodes, env.lengths))[0]


def store(folder):
    words = {"policy": choose, "seed": 1, "threads": 1, "num_envs": AT_ONCE}
    tangere.data.generate(Rolling, folder + "/set", EPISODES, **words)


def store_brother(folder):
    words = {"policy": choose, "seed": 1, "threads": 1, "normalise": False}
    tangere.data.generate("ball_rolling_small", folder + "/set", EPISODES, **words)


def seconds(work) -> tuple[float, float]:
    """Of the clock, and of processors with those of child processes."""

    def used():
        uses = [resource.getrusage(w) for w in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
        return sum(u.ru_utime + u.ru_stime for u in uses)

    with tempfile.TemporaryDirectory() as folder:
        begin, before = time.perf_counter(), used()
        work(folder)
        return time.perf_counter() - begin, used() - before


runs = np.array([[seconds(w) for w in (step_alone, store, store_brother)] for _ in range(5)])
for name, (clock, cpu) in zip(
    ("stepping alone", "data set of the Python task", "of the C++ task"),
    np.median(runs, axis=0),
    strict=True,
):
    rate = EPISODES / clock
    print(
        f"{name}: {clock:.2f} s, CPU {cpu:.2f} s, {rate:.0f} episodes/s, "
        f"{rate * Rolling.horizon:.0f} env-steps/s"
    )
