# SPDX-License-Identifier: Apache-2.0
"""A clone with memory, which asks the script what to do in the states that it came to (DAgger).

    build/release/tangere generate box_pushing -o out/pushes --episodes 5000 --seed 1
    python learning/dagger.py out/pushes

The clone sees an episode from its first row on: observations go to 128 numbers, those to a GRU, and
both to an action. It does not see its own actions: a clone that does learns to repeat them. It
learns in rounds of minibatches of whole episodes,

    L = mean over the rows of |π(o_0 … o_t) - a_script|² ,

at first from the episodes of mask/train that succeeded. Before each later round the clone plays
fresh episodes, and the script says for every state what it would do there. From then on half of a
minibatch are such episodes (Ross, Gordon, Bagnell 2011). `--visits 0` is cloning from the data set
alone. The test is that of bc.py.
"""

from __future__ import annotations

import argparse
import json
import sys
import time

import numpy as np
import torch
from protocol import Played, add_choice, play, provenance, source, wilson
from torch import nn
from tracking import Log, add_log

import tangere
from tangere.data import Episodes

WIDTH = 128
VISIT_SEED = 3000003  # of the episodes that clones play while they learn


class Recurrent(nn.Module):
    """Rows of observations, (n, T, inputs), to actions (n, T, na) within their bounds."""

    def __init__(self, inputs: int, action: tangere.TensorSpec):
        super().__init__()
        self.see = nn.Sequential(nn.Linear(inputs, WIDTH), nn.ELU())
        self.memory = nn.GRU(WIDTH, WIDTH, batch_first=True)
        self.act = nn.Sequential(
            nn.Linear(2 * WIDTH, WIDTH), nn.ELU(), nn.Linear(WIDTH, int(np.prod(action.shape)))
        )
        self.middle, self.half = (action.low + action.high) / 2, (action.high - action.low) / 2

    def forward(self, rows: torch.Tensor, state: torch.Tensor | None = None):
        seen = self.see(rows)
        known, state = self.memory(seen, state)
        drive = torch.tanh(self.act(torch.cat([known, seen], -1)))
        return self.middle + self.half * drive, state


def flat(obs: dict[str, np.ndarray], keys: list[str]) -> np.ndarray:
    """(n, inputs) of (n, …) of every key. Of n numbers of a key each counts min(1, 4/√n)."""
    parts = [obs[key].reshape(len(obs[key]), -1) for key in keys]
    return np.concatenate([p * min(1, 4 / p.shape[1] ** 0.5) for p in parts], 1, dtype=np.float32)


class Rows:
    """Episodes to learn from: observations, actions of the script, and which rows there are."""

    def __init__(self, count: int, horizon: int, inputs: int, actions: int):
        self.seen = torch.zeros(count, horizon, inputs)
        self.wanted = torch.zeros(count, horizon, actions)
        self.there = torch.zeros(count, horizon)
        self.count = 0

    def add(self, seen: np.ndarray, wanted: np.ndarray, there: np.ndarray) -> None:
        """(n, T, …) each, with T up to the horizon."""
        which = (slice(self.count, self.count + len(seen)), slice(0, seen.shape[1]))
        for kept, values in ((self.seen, seen), (self.wanted, wanted), (self.there, there)):
            kept[which] = torch.from_numpy(np.asarray(values, np.float32).copy())
        self.count += len(seen)

    def some(self, n: int, draw: np.random.Generator) -> list[torch.Tensor]:
        chosen = torch.from_numpy(draw.integers(self.count, size=n))
        return [self.seen[chosen], self.wanted[chosen], self.there[chosen]]


def stored_rows(episodes: Episodes, keys: list[str], task: tangere.TaskSpec) -> Rows:
    """The episodes of mask/train that succeeded."""
    solved = set(episodes.succeeded())
    chosen = [i for i in episodes.mask("train") if i in solved]
    if not chosen:
        raise SystemExit(f"{episodes.path}: no episode of mask/train succeeded")
    rows = None
    for i in chosen:
        arrays = episodes[i]
        seen = flat({k: arrays[k] / np.asarray(episodes.scale[k]) for k in keys}, keys)
        wanted = np.asarray(arrays["actions"]).reshape(len(seen), -1)
        rows = rows or Rows(len(chosen), task.horizon, seen.shape[1], wanted.shape[1])
        rows.add(seen[None], wanted[None], np.ones((1, len(seen))))
    return rows


class Player:
    """A clone's actions in closed loop; with `record` also what it saw and the script's actions."""

    def __init__(self, clone: Recurrent, keys: list[str], record: bool = False):
        self.clone, self.keys, self.record = clone, keys, record

    @torch.no_grad()
    def __call__(self, env, obs, t: int) -> np.ndarray:
        if t == 0:
            self.state, self.seen, self.wanted = None, [], []
        seen = flat(obs, self.keys)
        if self.record:
            self.seen.append(seen)
            self.wanted.append(env.scripted_action().reshape(env.num_envs, -1))
        action, self.state = self.clone(torch.from_numpy(seen[:, None]), self.state)
        return action[:, 0].numpy().reshape(env.num_envs, *env.task.action.shape)


def visit(env, clone: Recurrent, keys: list[str], first_episode: int, into: Rows) -> Played:
    """The clone plays; `into` gets what it saw and what the script would have done."""
    player = Player(clone, keys, record=True)
    played = play(env, VISIT_SEED, player, first_episode)
    seen, wanted = np.stack(player.seen, 1), np.stack(player.wanted, 1)
    there = np.arange(seen.shape[1]) < played.actions[:, None]
    into.add(seen, wanted, there)
    return played


def learn(clone: Recurrent, optimiser, schedule, sources: list[Rows], args, draw) -> float:
    """One round; returns the mean loss. Each source gives the same share of a minibatch."""
    total = 0.0
    for _ in range(args.updates):
        parts = [rows.some(args.batch // len(sources), draw) for rows in sources]
        seen, wanted, there = (torch.cat(part) for part in zip(*parts))
        off = (clone(seen)[0] - wanted).square().mean(-1)
        loss = (off * there).sum() / there.sum()
        optimiser.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(clone.parameters(), 1.0)
        optimiser.step()
        schedule.step()
        total += float(loss.detach()) / args.updates
    return total


def settings() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", help="a folder of tangere generate")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--rounds", type=int, default=30)
    parser.add_argument("--updates", type=int, default=60, help="of a round")
    parser.add_argument("--batch", type=int, default=32, help="episodes of a minibatch")
    parser.add_argument("--rate", type=float, default=2e-3, help="at first; falls as a cosine")
    parser.add_argument("--visits", type=int, default=300, help="episodes before a round")
    parser.add_argument("--alone", type=int, default=2, help="rounds before the first visits")
    parser.add_argument("--without", nargs="*", default=[], help="observations to leave out")
    parser.add_argument("--episodes", type=int, default=1000, help="to play")
    parser.add_argument("--threads", type=int, default=None, help="of the simulation")
    parser.add_argument("--json", action="store_true")
    add_choice(parser)
    add_log(parser)
    return parser.parse_args()


def trained(args: argparse.Namespace, episodes: Episodes, keys: list[str]):
    """The clone, the rows of the data set; of each round its loss and what its visits solved."""
    task = tangere.task_spec(episodes.task)
    stored = stored_rows(episodes, keys, task)
    inputs, actions = stored.seen.shape[2], stored.wanted.shape[2]
    clone = Recurrent(inputs, task.action)
    optimiser = torch.optim.AdamW(clone.parameters(), lr=args.rate, weight_decay=1e-4)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, args.rounds * args.updates)
    draw, curve, sources, env = np.random.default_rng(args.seed), [], [stored], None
    if args.visits:
        env = tangere.make_vec(task.name, args.visits, autoreset="disabled", keys=keys,
                               threads=args.threads)  # fmt: skip
        later = max(0, args.rounds - args.alone)
        visited = Rows(later * args.visits, task.horizon, inputs, actions)
    log = Log(args.log)
    for k in range(args.rounds):
        solved = None
        if env is not None and k >= args.alone:
            first = (args.seed * args.rounds + k) * args.visits
            solved = visit(env, clone, keys, first, visited).summary()["success"]
            sources = [stored, visited]
        loss = learn(clone, optimiser, schedule, sources, args, draw)
        curve.append([k, loss, solved])
        log(k + 1, loss=loss, **({} if solved is None else {"success": solved}))
        said = "" if solved is None else f", {solved:.3f} of its visits were solved"
        print(f"round {k}: loss {loss:.4f}{said}", file=sys.stderr, flush=True)
    return clone, stored, curve


def main() -> None:
    args = settings()
    torch.set_num_threads(1)
    torch.manual_seed(args.seed)
    episodes = Episodes(args.data)
    shown = [k for k in episodes.keys if k not in ("q", "v", *episodes.privileged)]
    keys = [key for key in shown if key not in args.without]
    if not episodes.task or not keys or len(keys) + len(args.without) != len(shown):
        raise SystemExit(f"--without {args.without}; the data set of a task shows {shown}")
    begin, clock = time.process_time(), time.perf_counter()
    clone, stored, curve = trained(args, episodes, keys)
    cost = {"train_cpu_s": time.process_time() - begin,
            "train_wall_s": time.perf_counter() - clock}  # fmt: skip
    env = tangere.make_vec(episodes.task, args.episodes, autoreset="disabled",
                           threads=args.threads)  # fmt: skip
    script = play(env, args.play_seed, lambda env, _obs, _t: env.scripted_action()).summary()
    result = play(env, args.play_seed, Player(clone, keys)).summary()
    rows = int(stored.there.sum())
    if args.json:
        print(json.dumps({"program": "dagger", "settings": vars(args), **provenance(), **cost,
                          "task": episodes.task, "keys": keys, "data": source(episodes.masks),
                          "rows": rows, "curve": curve, "script": script,
                          "test": result}))  # fmt: skip
        return
    low, high = wilson(result["success"], args.episodes)
    print(
        f"{episodes.task} {'+'.join(keys)}, seed {args.seed}: clone {result['success']:.3f} "
        f"({low:.3f} to {high:.3f}), script {script['success']:.3f}, ratio "
        f"{result['success'] / max(script['success'], 1e-9):.3f}; {rows} rows, "
        f"{cost['train_cpu_s']:.0f} CPU s"
    )


if __name__ == "__main__":
    main()
