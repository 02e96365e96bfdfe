# SPDX-License-Identifier: Apache-2.0
"""Behaviour cloning from a data set, and its success in closed loop beside the demonstrator's.

    build/release/tangere generate stable_grasp -o out/grasps --episodes 5000 --seed 1
    python learning/bc.py out/grasps

Trains on the episodes that succeeded, those of mask/train, and plays 1000 fresh episodes, the same
for clone and demonstrator.
"""

from __future__ import annotations

import argparse
import json
import time

import numpy as np
import torch
from protocol import Played, add_choice, play, provenance, source, wilson
from torch import nn
from tracking import Log, add_log

import tangere
from tangere.data import Episodes, Windows


STATE_UNIT = 0.1  # [m, rad]: what q is divided by with --state


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
    parts = [*(v / STATE_UNIT if k == "q" else v for k, v in obs.items()), past]
    return torch.from_numpy(np.concatenate([v.reshape(len(v), -1) for v in parts], axis=1))


def train(windows: Windows, clone: Clone, args: argparse.Namespace) -> None:
    """Least squares to the actions of the data set."""
    optimiser = torch.optim.AdamW(clone.parameters(), lr=args.rate, weight_decay=1e-4)
    steps = args.epochs * -(-len(windows) // args.batch)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    log = Log(args.log)
    for epoch in range(args.epochs):
        for rows in windows.batches(args.batch, seed=args.seed * 1000 + epoch):
            past = rows["past_actions"] if args.recall else rows["past_actions"][:, :0]
            seen = flat(rows["obs"], past).to(args.device)
            wanted = torch.from_numpy(rows["actions"][:, 0]).to(args.device)
            loss = (clone(seen) - wanted).square().mean()
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()
        log(epoch + 1, loss=loss)


def closed_loop(windows: Windows, clone: Clone, args: argparse.Namespace) -> Played:
    """The clone in the test episodes of its task."""
    episodes = args.episodes
    env = tangere.make_vec(
        windows.episodes.task, episodes, autoreset="disabled",
        keys=[key for key in windows.keys if key != "q"], threads=args.threads,
    )  # fmt: skip
    history: list[dict[str, np.ndarray]] = []
    past: list[np.ndarray] = []

    def choose(env, obs, t):
        if args.state:
            obs = obs | {"q": env.state()[0].astype(np.float32)}
        if t == 0:
            history[:] = [obs] * (windows.before + 1)
            past[:] = [np.zeros((episodes, *env.task.action.shape), np.float32)] * windows.before
        history[:] = [*history[1:], obs]
        stacked = {k: np.stack([h[k] for h in history], axis=1) for k in windows.keys}
        recalled = past if past and args.recall else [np.zeros((episodes, 0), np.float32)]
        with torch.no_grad():
            seen = flat(stacked, np.stack(recalled, axis=1))
            action = clone(seen.to(args.device)).cpu().numpy()
        past[:] = [*past, action][len(past) + 1 - windows.before :] if windows.before else []
        return action

    return play(env, args.play_seed, choose)


def settings() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", help="a folder of tangere generate")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--epochs", type=int, default=40)
    parser.add_argument("--batch", type=int, default=256)
    parser.add_argument("--rate", type=float, default=1e-3)
    parser.add_argument("--width", type=int, default=256)
    parser.add_argument("--before", type=int, default=0, help="rows of history")
    parser.add_argument("--recall", action="store_true", help="the actions between them, too")
    parser.add_argument("--without", nargs="*", default=[], help="observations to leave out")
    parser.add_argument("--state", action="store_true", help="show q, which no robot sees")
    parser.add_argument("--all", action="store_true", help="learn from failed episodes too")
    parser.add_argument("--episodes", type=int, default=1000, help="to play")
    parser.add_argument("--threads", type=int, default=None, help="of the simulation")
    parser.add_argument("--device", default="cpu", help="where the network is: cpu, cuda")
    parser.add_argument("--json", action="store_true")
    add_choice(parser)
    add_log(parser)
    return parser.parse_args()


def main() -> None:
    args = settings()
    torch.set_num_threads(1)
    torch.manual_seed(args.seed)

    episodes = Episodes(args.data)
    if episodes.task not in tangere.task_names():
        raise SystemExit(
            f"{args.data} is of {episodes.task or 'a scene alone'}; expected a data set of one of "
            f"{tangere.task_names()}: the clone and the script play this task"
        )
    shown = [key for key in episodes.keys if key not in ("q", "v")]
    keys = [key for key in shown if key not in args.without]
    if not keys or len(keys) + len(args.without) != len(shown):
        raise SystemExit(f"--without {args.without}; the data set shows {shown}")
    keys += ["q"] if args.state else []
    windows = Windows(episodes, keys, before=args.before, only_success=not args.all)
    task = tangere.task_spec(windows.episodes.task)
    begin, clock = time.process_time(), time.perf_counter()
    first = windows[0]
    inputs = sum(v.size for v in first["obs"].values())
    inputs += first["past_actions"].size if args.recall else 0
    clone = Clone(inputs, first["actions"].shape[1], args.width, task.action.low, task.action.high)
    clone.to(args.device)
    train(windows, clone, args)
    cost = {"train_cpu_s": time.process_time() - begin,
            "train_wall_s": time.perf_counter() - clock}  # fmt: skip
    env = tangere.make_vec(
        task.name, args.episodes, autoreset="disabled", threads=args.threads
    )
    script = play(env, args.play_seed, lambda env, _obs, _t: env.scripted_action()).summary()
    result = closed_loop(windows, clone, args).summary()
    if args.json:
        print(json.dumps({"program": "bc", "settings": vars(args),
                          **provenance(args.device), **cost,
                          "task": task.name, "keys": keys, "data": source(windows.episodes.masks),
                          "rows": len(windows), "script": script, "test": result}))  # fmt: skip
        return
    low, high = wilson(result["success"], args.episodes)
    print(
        f"{task.name} {'+'.join(keys)}, seed {args.seed}: clone {result['success']:.3f} "
        f"({low:.3f} to {high:.3f}), script {script['success']:.3f}, ratio "
        f"{result['success'] / max(script['success'], 1e-9):.3f}; {len(windows)} rows, "
        f"{cost['train_cpu_s']:.0f} CPU s"
    )


if __name__ == "__main__":
    main()
