# SPDX-License-Identifier: Apache-2.0
"""Clones of stable grasp and of insertion that see pictures: of the gels, or of a camera.

    python learning/pictures.py out/pictures --see flow
    python learning/pictures.py out/pictures --see left.rgb_marker right.rgb_marker
    python learning/pictures.py out/pictures --see eye flow
    python learning/pictures.py out/inserts --task insertion --see flow

The tasks are those of picture_tasks.py: pads with gels and cameras. A rule plays the task once and
stores what all of them see. A clone has one network whatever it sees: every kind is cut into
13 × 10 patches, which become 16 numbers each, summed over kinds; then come two layers of 256. In
insertion it has four rows of history, and the actions between them. It learns from the episodes
that succeeded and plays 1000 fresh ones. It needs h5py.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any, Sequence

import numpy as np
import torch
from picture_tasks import POINTS, TASKS, keys, playing
from protocol import Played, add_choice, play, provenance, source, wilson
from torch import nn
from tracking import Log, add_log

from tangere.data import Episodes, Windows, generate

FOR_SCALES = 2048  # rows from which means and deviations of pictures are taken, at most


class Clone(nn.Module):
    """Every kind of observation in 13 × 10 patches; the sum of 16 numbers of each; two layers."""

    def __init__(
        self, rows: dict[str, torch.Tensor], history: int, recalled: int, actions: int,
        width: int = 256,
    ):  # fmt: skip
        """`rows`: of the data set, (n, channels, rows, cols) each. Pictures are shown without their
        mean, and divided by how much they vary about it. `history`: rows of an input. `recalled`:
        numbers of the actions between them."""
        super().__init__()
        self.seen = list(rows)
        self.cuts = nn.ModuleList()
        self.means: dict[str, torch.Tensor] = {}
        self.scales: dict[str, torch.Tensor] = {}
        for key, given in rows.items():
            channels, *size = given.shape[1:]
            picture = key != "flow"
            self.means[key] = given.mean(0) if picture else torch.zeros(())
            self.scales[key] = (given - self.means[key]).std() if picture else torch.ones(())
            cut = tuple(n // p for n, p in zip(size, POINTS, strict=True))
            self.cuts.append(nn.Conv2d(channels, 16, cut, stride=cut))
        inputs = history * 16 * POINTS[0] * POINTS[1] + recalled
        self.net = nn.Sequential(
            nn.Linear(inputs, width), nn.ELU(), nn.Linear(width, width), nn.ELU(),
            nn.Linear(width, actions), nn.Tanh(),
        )  # fmt: skip

    def forward(self, obs: dict[str, torch.Tensor], past: torch.Tensor) -> torch.Tensor:
        """`obs`: (n, history, channels, rows, cols) each; `past`: (n, history - 1, na)."""
        patches = [
            cut((obs[key].flatten(0, 1) - self.means[key]) / self.scales[key])
            for key, cut in zip(self.seen, self.cuts, strict=True)
        ]
        features = nn.functional.elu(torch.stack(patches).sum(0))
        return self.net(torch.cat([features.reshape(len(past), -1), past.flatten(1)], 1))


def shown(obs: dict[str, np.ndarray], seen: Sequence[str]) -> dict[str, torch.Tensor]:
    """(n, history, channels, rows, cols)."""
    rows = {key: torch.from_numpy(np.ascontiguousarray(obs[key])).float() for key in seen}
    return {key: r if key == "flow" else r.movedim(-1, 2) for key, r in rows.items()}


def train(windows: Windows, clone: Clone, args: argparse.Namespace) -> None:
    """Least squares to the actions of the data set."""
    optimiser = torch.optim.AdamW(clone.parameters(), lr=args.rate, weight_decay=1e-4)
    steps = args.epochs * -(-len(windows) // args.batch)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    log = Log(args.log)
    for epoch in range(args.epochs):
        for rows in windows.batches(args.batch, seed=args.seed * 1000 + epoch):
            chosen = clone(shown(rows["obs"], clone.seen), torch.from_numpy(rows["past_actions"]))
            loss = (chosen - torch.from_numpy(rows["actions"][:, 0])).square().mean()
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()
        log(epoch + 1, loss=loss)


def tested(clone: Clone, args: argparse.Namespace) -> Played:
    """The clone in the test episodes."""
    task = playing(args.task, clone.seen)
    env = task(args.episodes, threads=args.threads, autoreset="disabled")
    history: list[dict[str, np.ndarray]] = []
    past: list[np.ndarray] = []

    def choose(_env: Any, obs: dict[str, np.ndarray], t: int) -> np.ndarray:
        if t == 0:
            history[:] = [obs] * (task.before + 1)
            past[:] = [np.zeros((args.episodes, len(env.bounds[0])), np.float32)] * task.before
        history[:] = [*history[1:], obs]
        stacked = {k: np.stack([h[k] for h in history], axis=1) for k in clone.seen}
        recalled = np.stack(past, 1) if past else np.zeros((args.episodes, 0, 1), np.float32)
        with torch.no_grad():
            chosen = [
                clone(shown({k: v[part] for k, v in stacked.items()}, clone.seen),
                      torch.from_numpy(recalled[part]))
                for part in np.array_split(np.arange(args.episodes), -(-args.episodes // 250))
            ]  # fmt: skip
        action = torch.cat(chosen).numpy()
        past[:] = [*past, action][1:] if past else []
        return action

    return play(env, args.play_seed, choose)


def settings() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path, help="folder of the data set, made if it is missing")
    parser.add_argument("--task", choices=list(TASKS), default="stable_grasp")
    parser.add_argument("--see", nargs="+", default=["flow"], help="observations of the clone")
    parser.add_argument("--demos", type=int, default=1000, help="episodes of a new data set")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--epochs", type=int, default=40)
    parser.add_argument("--batch", type=int, default=256)
    parser.add_argument("--rate", type=float, default=1e-3)
    parser.add_argument("--episodes", type=int, default=1000, help="to play")
    parser.add_argument("--threads", type=int, default=None, help="of the simulation")
    parser.add_argument("--json", action="store_true")
    add_choice(parser)
    add_log(parser)
    args = parser.parse_args()
    if set(args.see) - set(keys(args.task)):
        parser.error(f"--see {args.see}; {args.task} has {keys(args.task)}")
    return args


def main() -> None:
    args = settings()
    torch.set_num_threads(1)
    torch.manual_seed(args.seed)
    task = TASKS[args.task]
    if not (args.data / "robomimic.hdf5").exists():
        args.data.parent.mkdir(parents=True, exist_ok=True)
        generate(task, args.data, args.demos, policy=task.script, seed=1, threads=args.threads,
                 options=["--overwrite"])  # fmt: skip
    begin, clock = time.process_time(), time.perf_counter()
    episodes = Episodes(args.data)
    windows = Windows(episodes, args.see, before=task.before, only_success=True)
    single = Windows(episodes, args.see, only_success=True)
    chosen = np.linspace(0, len(single) - 1, min(len(single), FOR_SCALES)).astype(int)
    rows = shown(single.gather(chosen)["obs"], args.see)
    actions = task.actions or 1
    clone = Clone({key: r[:, 0] for key, r in rows.items()}, task.before + 1,
                  task.before * actions, actions)  # fmt: skip
    train(windows, clone, args)
    cost = {"train_cpu_s": time.process_time() - begin,
            "train_wall_s": time.perf_counter() - clock}  # fmt: skip
    result = tested(clone, args).summary()
    by_script = len(episodes.succeeded()) / len(episodes)  # in those of the data set
    if args.json:
        said = vars(args) | {"data": str(args.data)}
        print(json.dumps({"program": "pictures", "settings": said, **provenance(), **cost,
                          "keys": args.see, "data": source(episodes.masks), "rows": len(windows),
                          "script": {"success": by_script}, "test": result}))  # fmt: skip
        return
    low, high = wilson(result["success"], args.episodes)
    print(f"{args.task} by {'+'.join(args.see)}, seed {args.seed}: clone {result['success']:.3f} "
          f"({low:.3f} to {high:.3f}), script {by_script:.3f}; {len(windows)} rows, "
          f"{cost['train_cpu_s']:.0f} CPU s")  # fmt: skip


if __name__ == "__main__":
    main()
