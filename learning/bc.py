# SPDX-License-Identifier: Apache-2.0
"""Behaviour cloning from a data set, and its success in closed loop beside the demonstrator's.

    build/release/tangere generate stable_grasp -o out/grasps --episodes 5000 --seed 1
    python learning/bc.py out/grasps

Trains on the episodes that succeeded, those of mask/train, and plays 1000 fresh episodes, the same
for clone and demonstrator. Prints one line a seed; --json adds all settings.
"""

from __future__ import annotations

import argparse
import json
import time

import numpy as np
import torch
from torch import nn

import tangere
from tangere.data import Windows

TEST_SEED = 1000003  # of the episodes that are played; no data set should be made with it


class Clone(nn.Module):
    """Observations, flattened and stacked over rows, to an action within its bounds."""

    def __init__(self, inputs: int, actions: int, width: int, low: float, high: float):
        super().__init__()
        self.net = nn.Sequential(
            nn.Linear(inputs, width), nn.ELU(), nn.Linear(width, width), nn.ELU(),
            nn.Linear(width, actions),
        )  # fmt: skip
        self.middle, self.half = (low + high) / 2, (high - low) / 2

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return self.middle + self.half * torch.tanh(self.net(x))


def flat(obs: dict[str, np.ndarray], past: np.ndarray) -> torch.Tensor:
    """(n, rows, …) of every key, and the actions between them, (n, rows - 1, na) → (n, inputs)."""
    parts = [*obs.values(), past]
    return torch.from_numpy(np.concatenate([v.reshape(len(v), -1) for v in parts], axis=1))


def train(
    windows: Windows, clone: Clone, recall: bool, epochs: int, batch: int, rate: float, seed: int
) -> None:
    optimiser = torch.optim.AdamW(clone.parameters(), lr=rate, weight_decay=1e-4)
    steps = epochs * -(-len(windows) // batch)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    for epoch in range(epochs):
        for rows in windows.batches(batch, seed=seed * 1000 + epoch):
            past = rows["past_actions"] if recall else rows["past_actions"][:, :0]
            seen = flat(rows["obs"], past)
            loss = (clone(seen) - torch.from_numpy(rows["actions"][:, 0])).square().mean()
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()


def play(task: str, episodes: int, choose, keys=None) -> np.ndarray:
    """(episodes) bool: which were solved. `choose(env, obs, t)` returns the actions."""
    env = tangere.make_vec(task, episodes, seed=TEST_SEED, autoreset="disabled", keys=keys)
    obs, _ = env.reset()
    over = np.zeros(episodes, bool)
    solved = np.zeros(episodes, bool)
    for t in range(env.task.horizon):
        obs, _, terminated, truncated, info = env.step(choose(env, obs, t))
        solved |= ~over & info["success"]
        over |= terminated | truncated
        if over.all():
            break
    return solved


def closed_loop(
    task: str, windows: Windows, clone: Clone, recall: bool, episodes: int
) -> np.ndarray:
    history: list[dict[str, np.ndarray]] = []
    past: list[np.ndarray] = []

    def choose(env, obs, t):
        if t == 0:
            history[:] = [obs] * (windows.before + 1)
            past[:] = [np.zeros((episodes, *env.task.action.shape), np.float32)] * windows.before
        history[:] = [*history[1:], obs]
        stacked = {k: np.stack([h[k] for h in history], axis=1) for k in windows.keys}
        between = np.stack(past, axis=1) if past and recall else np.zeros((episodes, 0), np.float32)
        with torch.no_grad():
            action = clone(flat(stacked, between)).numpy()
        past[:] = [*past, action][len(past) + 1 - windows.before :] if windows.before else []
        return action

    return play(task, episodes, choose, windows.keys)


def interval(rate: float, n: int) -> float:
    """Half of Wilson's 95 % interval."""
    z = 1.96
    return z * np.sqrt(rate * (1 - rate) / n + z * z / (4 * n * n)) / (1 + z * z / n)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", help="a folder of tangere generate")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--epochs", type=int, default=40)
    parser.add_argument("--batch", type=int, default=256)
    parser.add_argument("--rate", type=float, default=1e-3)
    parser.add_argument("--width", type=int, default=256)
    parser.add_argument("--before", type=int, default=0, help="rows of history")
    parser.add_argument("--recall", action="store_true", help="the actions between them, too")
    parser.add_argument("--without", nargs="*", default=[], help="observations to leave out")
    parser.add_argument("--all", action="store_true", help="learn from failed episodes too")
    parser.add_argument("--episodes", type=int, default=1000, help="to play")
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args()
    torch.set_num_threads(1)

    windows = Windows(asked.data, before=asked.before, only_success=not asked.all)
    keys = [key for key in windows.keys if key not in asked.without]
    if keys != windows.keys:
        windows = Windows(asked.data, keys, before=asked.before, only_success=not asked.all)
    task = tangere.task_spec(windows.episodes.task)
    script = play(task.name, asked.episodes, lambda env, _obs, _t: env.scripted_action())
    runs = []
    for seed in range(asked.seeds):
        torch.manual_seed(seed)
        begin = time.process_time()
        first = windows[0]
        inputs = sum(v.size for v in first["obs"].values())
        inputs += first["past_actions"].size if asked.recall else 0
        bounds = task.action.low, task.action.high
        clone = Clone(inputs, first["actions"].shape[1], asked.width, *bounds)
        train(windows, clone, asked.recall, asked.epochs, asked.batch, asked.rate, seed)
        trained = time.process_time() - begin
        solved = closed_loop(task.name, windows, clone, asked.recall, asked.episodes)
        runs.append({"seed": seed, "rate": solved.mean(), "train_cpu_s": trained})
        print(
            f"{task.name} {'+'.join(keys)}: clone {solved.mean():.3f} ± "
            f"{interval(solved.mean(), len(solved)):.3f}, script {script.mean():.3f}, "
            f"ratio {solved.mean() / script.mean():.3f}; {len(windows)} rows, {trained:.0f} CPU s"
        )
    if asked.json:
        print(json.dumps({"task": task.name, "keys": keys, "settings": vars(asked),
                          "script": script.mean(), "runs": runs}))  # fmt: skip


if __name__ == "__main__":
    main()
