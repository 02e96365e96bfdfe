# SPDX-License-Identifier: Apache-2.0
"""Offline learning from mixed data: cloning, TD3 with cloning, and implicit Q-learning.

    build/release/tangere generate box_pushing -o out/mixed --episodes 1000 --seed 1 \
        --noise 0.3 --mix random=0.5
    python learning/offline.py out/mixed --method iql

All episodes are learned from, good and bad; no episode is played before the test. With rows
(o, a, r, o'), an end only where the task ends an episode, and target networks Q', V':

    bc:  π minimises |π(o) - a|²
    td3: Q → r + γ min Q'(o', π'(o') + noise);  π maximises λ Q(o, π(o)) - |π(o) - a|²,
         λ = α / mean |Q(o, π(o))|                                        (Fujimoto, Gu 2021)
    iql: V is the τ-expectile of min Q'(o, a);  Q → r + γ V(o');
         π minimises exp(β (min Q'(o, a) - V(o))) |π(o) - a|²             (Kostrikov et al. 2022)

Rewards are divided by their standard deviation. The test also plays random actions and the script:
the normalised score of a return is (return - random) / (script - random), in percent.
"""

from __future__ import annotations

import argparse
import copy
import json
import sys
import time

import numpy as np
import torch
from protocol import TEST_SEED, play, provenance, source
from torch import nn
from tracking import Log, add_log

import tangere
from tangere.data import Episodes

GAMMA, FOLLOW = 0.99, 0.005  # discount; share of a target network that is replaced at each update
ALPHA, TARGET_NOISE, NOISE_BOUND = 2.5, 0.2, 0.5  # of td3
POLICY_EVERY = {"bc": 1, "td3": 2, "iql": 1}  # updates
EXPECTILE, BETA, MOST_WEIGHT = 0.7, 3.0, 100.0  # of iql


def net(inputs: int, outputs: int) -> nn.Module:
    return nn.Sequential(
        nn.Linear(inputs, 256), nn.ReLU(), nn.Linear(256, 256), nn.ReLU(), nn.Linear(256, outputs)
    )


class Twin(nn.Module):
    """Two estimates of the value of an action; the lower one counts."""

    def __init__(self, inputs: int):
        super().__init__()
        self.a, self.b = net(inputs, 1), net(inputs, 1)

    def both(self, obs, action):
        x = torch.cat([obs, action], 1)
        return self.a(x)[:, 0], self.b(x)[:, 0]

    def forward(self, obs, action):
        return torch.minimum(*self.both(obs, action))


def rows_of(episodes: Episodes, keys: list[str]) -> dict[str, torch.Tensor]:
    """All rows of all training episodes: obs, next (n, inputs), action (n, na), reward, end (n)."""

    def flat(arrays: dict[str, np.ndarray]) -> np.ndarray:
        parts = [arrays[k] / np.asarray(episodes.scale[k]) for k in keys]
        return np.concatenate([p.reshape(len(p), -1) for p in parts], axis=1).astype(np.float32)

    parts: dict[str, list[np.ndarray]] = {}
    for index in episodes.mask("train"):
        arrays = episodes[index]
        obs = flat(arrays)
        end = np.zeros(len(obs), np.float32)
        end[-1] = episodes.terminated(index)
        after = np.concatenate([obs[1:], flat(episodes.final(index))])
        for name, values in (("obs", obs), ("next", after), ("action", arrays["actions"]),
                             ("reward", arrays["rewards"]), ("end", end)):  # fmt: skip
            parts.setdefault(name, []).append(np.asarray(values, np.float32))
    rows = {name: torch.from_numpy(np.concatenate(values)) for name, values in parts.items()}
    rows["reward"] = rows["reward"] / rows["reward"].std()
    return rows


class Learner:
    """One update of a method from one minibatch."""

    def __init__(self, method: str, inputs: int, actions: int, rate: float, updates: int):
        self.method = method
        self.policy, self.value = net(inputs, actions), net(inputs, 1)
        self.twin = Twin(inputs + actions)
        self.twin_target, self.policy_target = map(copy.deepcopy, (self.twin, self.policy))
        self.optimisers = {
            name: torch.optim.Adam(getattr(self, name).parameters(), lr=rate)
            for name in ("policy", "twin", "value")
        }
        self.schedule = torch.optim.lr_scheduler.CosineAnnealingLR(
            self.optimisers["policy"], updates // POLICY_EVERY[method]
        )
        self.updates = 0
        self.losses: dict[str, torch.Tensor] = {}  # of the last update

    def act(self, obs: torch.Tensor) -> torch.Tensor:
        return torch.tanh(self.policy(obs))

    def update(self, rows: dict[str, torch.Tensor]) -> None:
        self.updates += 1
        off = (self.act(rows["obs"]) - rows["action"]).square().mean(1)
        if self.method == "bc":
            self._descend("policy", off.mean())
        elif self.method == "td3":
            self._td3(rows, off)
        else:
            self._iql(rows, off)

    def _td3(self, rows, off: torch.Tensor) -> None:
        with torch.no_grad():
            after = torch.tanh(self.policy_target(rows["next"]))
            noise = (torch.randn_like(after) * TARGET_NOISE).clamp(-NOISE_BOUND, NOISE_BOUND)
            worth = self.twin_target(rows["next"], (after + noise).clamp(-1, 1))
        self._fit_twin(rows, worth)
        if self.updates % POLICY_EVERY[self.method] == 0:
            value = self.twin.a(torch.cat([rows["obs"], self.act(rows["obs"])], 1))[:, 0]
            weight = ALPHA / value.abs().mean().detach()
            self._descend("policy", off.mean() - weight * value.mean())
            self._follow(self.policy_target, self.policy)
        self._follow(self.twin_target, self.twin)

    def _iql(self, rows, off: torch.Tensor) -> None:
        with torch.no_grad():
            worth = self.twin_target(rows["obs"], rows["action"])
        better = worth - self.value(rows["obs"])[:, 0]
        side = torch.where(better > 0, EXPECTILE, 1 - EXPECTILE)
        self._descend("value", (side * better.square()).mean())
        with torch.no_grad():
            after = self.value(rows["next"])[:, 0]
        self._fit_twin(rows, after)
        weight = (BETA * better.detach()).exp().clamp(max=MOST_WEIGHT)
        self._descend("policy", (weight * off).mean())
        self._follow(self.twin_target, self.twin)

    def _fit_twin(self, rows, worth: torch.Tensor) -> None:
        target = rows["reward"] + GAMMA * (1 - rows["end"]) * worth
        a, b = self.twin.both(rows["obs"], rows["action"])
        self._descend("twin", (a - target).square().mean() + (b - target).square().mean())

    def _descend(self, name: str, loss: torch.Tensor) -> None:
        self.losses[name] = loss.detach()
        self.optimisers[name].zero_grad()
        loss.backward()
        self.optimisers[name].step()
        if name == "policy":
            self.schedule.step()

    @staticmethod
    @torch.no_grad()
    def _follow(target: nn.Module, source_net: nn.Module) -> None:
        for old, new in zip(target.parameters(), source_net.parameters()):
            old.lerp_(new, FOLLOW)


def settings() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", help="a folder of tangere generate")
    parser.add_argument("--method", choices=["bc", "td3", "iql"], default="iql")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--updates", type=int, default=20000)
    parser.add_argument("--batch", type=int, default=256)
    parser.add_argument("--rate", type=float, default=3e-4)
    parser.add_argument("--episodes", type=int, default=1000, help="to play")
    parser.add_argument("--threads", type=int, default=None)
    parser.add_argument("--json", action="store_true")
    add_log(parser)
    return parser.parse_args()


def main() -> None:
    args = settings()
    torch.set_num_threads(1)
    torch.manual_seed(args.seed)

    episodes = Episodes(args.data)
    keys = [key for key in episodes.keys if key not in episodes.privileged]
    task = tangere.task_spec(episodes.task)
    if (task.action.low, task.action.high) != (-1.0, 1.0):
        raise SystemExit(f"{task.name}: actions are not within [-1, 1]")
    rows = rows_of(episodes, keys)
    draw = np.random.default_rng(args.seed)
    begin, clock = time.process_time(), time.perf_counter()
    learner = Learner(args.method, rows["obs"].shape[1], rows["action"].shape[1], args.rate,
                      args.updates)  # fmt: skip
    log = Log(args.log)
    for k in range(args.updates):
        chosen = torch.from_numpy(draw.integers(len(rows["reward"]), size=args.batch))
        learner.update({name: values[chosen] for name, values in rows.items()})
        if k % 100 == 99:
            log(k + 1, **learner.losses)
        if k % 2000 == 1999:
            print(f"update {k + 1}", file=sys.stderr, flush=True)
    cost = {"train_cpu_s": time.process_time() - begin,
            "train_wall_s": time.perf_counter() - clock}  # fmt: skip

    def clone(env, obs, t):
        flat = np.concatenate([obs[k].reshape(env.num_envs, -1) for k in keys], axis=1)
        with torch.no_grad():
            return learner.act(torch.from_numpy(flat)).numpy()

    env = tangere.make_vec(
        task.name, args.episodes, autoreset="disabled", keys=keys, threads=args.threads
    )
    script = play(env, TEST_SEED, lambda env, _obs, _t: env.scripted_action()).summary()
    at_random = np.random.default_rng(TEST_SEED)
    blind = play(env, TEST_SEED, lambda env, _obs, _t: at_random.uniform(
        -1, 1, (env.num_envs, *task.action.shape))).summary()  # fmt: skip
    result = play(env, TEST_SEED, clone).summary()
    score = 100 * (result["return"] - blind["return"]) / (script["return"] - blind["return"])
    if args.json:
        print(json.dumps({"program": "offline", "settings": vars(args), **provenance(), **cost,
                          "task": task.name, "keys": keys, "data": source(episodes.masks),
                          "rows": len(rows["reward"]), "script": script, "random": blind,
                          "test": result | {"score": score}}))  # fmt: skip
        return
    print(f"{task.name}, {args.method}, seed {args.seed}: score {score:.1f}, success "
          f"{result['success']:.3f}, script {script['success']:.3f}; {len(rows['reward'])} rows, "
          f"{cost['train_cpu_s']:.0f} CPU s")  # fmt: skip


if __name__ == "__main__":
    main()
