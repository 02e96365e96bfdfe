# SPDX-License-Identifier: Apache-2.0
"""Proximal policy optimisation of any task, with memory by a flag.

    python learning/ppo.py stable_grasp --seed 0
    python learning/ppo.py examples/stable_grasp.py:StableGrasp

A task is one of the catalogue, or a class of `tangere.VectorSceneEnv` in a file or a module. With
r = π(a|o)/π_old(a|o) and the advantage A of generalised advantage estimation, minibatches of

    L = mean( max(-A r, -A clip(r, 1 ± ε)) ) + ½ c_v mean (V - R)² ,
    A_t = δ_t + γ λ (1 - end_t) A_{t+1},   δ_t = ρ_t + γ V_{t+1} - V_t,   R = A + V

are taken by Adam, a few passes over each batch of E environments × T actions. Observations and
returns are normalised while training goes on, and clipped to 10. An episode that runs out of time
goes on in the value of its last observation, one that ends does not. Policies are Gaussian; their
means act in tests.

With `--last_gamma` the horizon 1 / (1 - γ) grows or shrinks by the same factor at every update, to
that of this γ at the end. `--imitate s`: in the first share s of all updates the policy plays, but
learns what the script would have done where it came to, |mean - a_script|² in place of the first
term of L. A class needs `scripted_action()` for it. `TASKS` has the settings of each task; every
one is an option as well.
"""

from __future__ import annotations

import argparse
import copy
import json
import sys
import time
from typing import Any

import numpy as np
import torch
from protocol import (
    CHOICE_EPISODES,
    CHOICE_SEED,
    TEST_SEED,
    make_vec,
    merit,
    play,
    provenance,
)
from skins import SKINS, skin_scene
from torch import nn
from tracking import Log, add_log

import tangere

COMMON = {
    "steps": 2_000_000, "envs": 256, "length": 32, "passes": 4, "minibatch": 512, "rate": 3e-4,
    "gamma": 0.99, "last_gamma": 0.0, "imitate": 0.0, "trace": 0.95, "clip": 0.2, "value": 0.5,
    "entropy": 0.0, "norm": 0.5,
    "deviation": 1.0, "recurrent": False, "squash": False, "convolve": True,
}  # fmt: skip
INSERTION = {"steps": 40_960, "envs": 64, "minibatch": 256, "deviation": 0.2, "imitate": 0.5,
             "recurrent": True}
# learning/README.md says where they differ from the paper's.
TASKS: dict[str, dict[str, Any]] = {
    "stable_grasp": {"steps": 8_192, "envs": 32, "length": 64, "passes": 10, "minibatch": 256,
                     "deviation": 0.5, "gamma": 0.9},
    "cap_opening": {"steps": 1_500_000, "imitate": 0.8, "minibatch": 2048, "rate": 1e-3,
                    "deviation": 0.3, "recurrent": True},
    "cap_opening_blind": {"steps": 4_000_000, "imitate": 0.3, "minibatch": 1024, "rate": 5e-4,
                          "deviation": 0.5},
    "insertion": INSERTION | {"steps": 102_400, "deviation": 0.5, "imitate": 0.0},
    "insertion_translation": INSERTION,
    "insertion_rotation": INSERTION | {"steps": 122_880, "deviation": 0.5, "imitate": 0.3},
    "box_pushing": {"squash": True, "convolve": False, "passes": 10, "minibatch": 1024,
                    "rate": 1e-3, "deviation": 0.5},
}  # fmt: skip
MOST_DRIVE = 0.999  # |a| of a squashed action, as in the reward of box pushing


class Running:
    """Mean and variance of all rows so far, per place, or per channel of an image (c, h, w)."""

    def __init__(self, shape: tuple[int, ...]):
        self.axes = (0, 2, 3) if len(shape) == 3 else (0,)
        inner = (shape[0], 1, 1) if len(shape) == 3 else shape
        self.count, self.mean, self.square = 1e-4, np.zeros(inner), np.ones(inner) * 1e-4

    def add(self, rows: np.ndarray) -> None:
        """Chan's update: joins the moments of two sets."""
        n, mean = rows.size / self.mean.size, rows.mean(self.axes, keepdims=True)[0]
        spread = rows.var(self.axes, keepdims=True)[0] * n
        total, off = self.count + n, mean - self.mean
        self.square = self.square + spread + off**2 * self.count * n / total
        self.mean, self.count = self.mean + off * n / total, total

    def shown(self, rows: np.ndarray) -> np.ndarray:
        std = np.sqrt(self.square / self.count + 1e-8)
        mean, share = self.mean.astype(np.float32), (1 / std).astype(np.float32)
        return np.clip((rows - mean) * share, -10, 10).astype(np.float32)


class Eyes:
    """Observations of the task as two normalised arrays: an image (E, c, h, w) and the rest (E, n).

    Flow and fields become channels if the task is seen by a convolution, else numbers: those that
    have the size of the first one, of 6 × 6 pixels and more. In images of 20 × 20 pixels and more,
    the forces of 2 × 2 pixels are summed: most of those pixels are empty. Of a field that is seen
    as n numbers each counts 4/√n, so that it does not outweigh the goal. `shapes`: those of the
    observations, by name.
    """

    def __init__(self, shapes: dict[str, tuple[int, ...]], convolve: bool, device: str = "cpu"):
        self.device = device
        self.channels_last = {name: shape[-1:] == (3,) for name, shape in shapes.items()}
        pixels = {
            name: shape[-3:-1] if self.channels_last[name] else shape[-2:]
            for name, shape in shapes.items()
            if convolve and len(shape) >= 3
        }
        large = [name for name, size in pixels.items() if min(size) >= 6]
        self.images = [name for name in large if pixels[name] == pixels[large[0]]]
        self.flat = [name for name in shapes if name not in self.images]
        sizes = {name: int(np.prod(shape)) for name, shape in shapes.items()}
        self.share = np.concatenate(
            [np.full(sizes[n], min(1, 4 / sizes[n] ** 0.5), np.float32) for n in self.flat]
            or [np.zeros(0, np.float32)]
        )
        zeros = {name: np.zeros((1, *shape), np.float32) for name, shape in shapes.items()}
        image, rest = self._arrays(zeros)
        self.shapes = (image.shape[1:], rest.shape[1:])
        self.running = (Running(self.shapes[0]), Running(self.shapes[1]))

    def _arrays(self, obs: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        n = len(next(iter(obs.values())))
        parts = []
        for name in self.images:  # (E, c, h, w), (E, h, w, 3) or (E, k, h, w, 3)
            image = np.moveaxis(obs[name], -1, -3) if self.channels_last[name] else obs[name]
            if min(image.shape[-2:]) >= 20:
                image = image[..., ::2, :] + image[..., 1::2, :]
                image = image[..., ::2] + image[..., 1::2]
            parts.append(image.reshape(n, -1, *image.shape[-2:]))
        image = np.concatenate(parts, 1) if parts else np.zeros((n, 0, 1, 1), np.float32)
        rest = [obs[name].reshape(n, -1) for name in self.flat]
        return image, np.concatenate(rest, 1) if rest else np.zeros((n, 0), np.float32)

    def __call__(self, obs: dict[str, np.ndarray], learn: bool = False) -> list[torch.Tensor]:
        arrays = self._arrays(obs)
        if learn:
            for running, rows in zip(self.running, arrays):
                if rows.size:
                    running.add(rows)
        shown = [r.shown(rows) for r, rows in zip(self.running, arrays)]
        shown[1] *= self.share
        return [torch.from_numpy(rows).to(self.device) for rows in shown]


def layer(module: nn.Module, gain: float) -> nn.Module:
    nn.init.orthogonal_(module.weight, gain)
    nn.init.zeros_(module.bias)
    return module


class Body(nn.Module):
    """Observations to 64 numbers: two layers, or a shallow convolution before them."""

    def __init__(self, shapes: tuple[tuple[int, ...], tuple[int, ...]]):
        super().__init__()
        (channels, height, width), (rest,) = shapes
        self.see, seen = None, 0
        if channels:
            stride, pool = (2, nn.Identity()) if channels > 4 else (1, nn.MaxPool2d(2))
            self.see = nn.Sequential(
                layer(nn.Conv2d(channels, 32, 5, stride, 2), 2**0.5), nn.ReLU(), pool,
                layer(nn.Conv2d(32, 16, 3), 2**0.5), nn.ReLU(), nn.Flatten(),
            )  # fmt: skip
            seen = self.see(torch.zeros(1, channels, height, width)).shape[1]
        self.think = nn.Sequential(
            layer(nn.Linear(seen + rest, 64), 2**0.5), nn.ELU(),
            layer(nn.Linear(64, 64), 2**0.5), nn.ELU(),
        )  # fmt: skip

    def forward(self, image: torch.Tensor, rest: torch.Tensor) -> torch.Tensor:
        return self.think(rest if self.see is None else torch.cat([self.see(image), rest], 1))


class Agent(nn.Module):
    """Means of actions and values. Without images or memory, actor and critic share nothing."""

    def __init__(self, shapes, actions: int, deviation: float, recurrent: bool):
        super().__init__()
        self.body = Body(shapes)
        shared = self.body.see is not None or recurrent
        self.other = None if shared else Body(shapes)
        self.memory = nn.GRUCell(64 + actions, 64) if recurrent else None
        self.mean, self.worth = layer(nn.Linear(64, actions), 0.01), layer(nn.Linear(64, 1), 1)
        self.log_deviation = nn.Parameter(torch.full((actions,), float(np.log(deviation))))

    def forward(self, image, rest, state, past):
        """(n, …), state (n, 64), the action before, (n, na) → mean, value (n), next state."""
        h = self.body(image, rest)
        if self.memory is not None:
            h = state = self.memory(torch.cat([h, past], 1), state)
        other = h if self.other is None else self.other(image, rest)
        return self.mean(h), self.worth(other)[:, 0], state

    def sequence(self, image, rest, state, past, begins):
        """(T, n, …), `begins` (T, n): where an episode starts → mean (T, n, na), value (T, n)."""
        T, n = image.shape[:2]
        h = self.body(image.flatten(0, 1), rest.flatten(0, 1))
        if self.memory is not None:
            gates, states = torch.cat([h.view(T, n, -1), past], 2), []
            for t in range(T):
                state = self.memory(gates[t], state * ~begins[t, :, None])
                states.append(state)
            h = torch.stack(states).flatten(0, 1)
        other = h if self.other is None else self.other(image.flatten(0, 1), rest.flatten(0, 1))
        return self.mean(h).view(T, n, -1), self.worth(other).view(T, n)


def log_likelihood(actions: torch.Tensor, mean: torch.Tensor, log_deviation: torch.Tensor):
    z = (actions - mean) / log_deviation.exp()
    return (-0.5 * z.square() - log_deviation - 0.5 * np.log(2 * np.pi)).sum(-1)


def with_skin(args: argparse.Namespace, skin: str) -> dict[str, Any]:
    """Options of environments whose pads have a skin."""
    return {} if skin == "springs" else {"scene": skin_scene(args.task, skin)}


class Actor:
    """A policy's means in the test of protocol.py."""

    def __init__(self, agent: Agent, eyes: Eyes, squash: bool):
        self.agent, self.eyes, self.squash = agent, eyes, squash

    def __call__(self, env, obs, t: int) -> np.ndarray:
        if t == 0:
            at = self.eyes.device
            self.state = torch.zeros(env.num_envs, 64, device=at)
            self.past = torch.zeros(env.action_space.shape, device=at)
        with torch.no_grad():
            self.past, _, self.state = self.agent(*self.eyes(obs), self.state, self.past)
        return driven(self.past, self.squash)


def driven(drawn: torch.Tensor, squash: bool) -> np.ndarray:
    """What the environment is given; it clips to [-1, 1]."""
    return (torch.tanh(drawn).clamp(-MOST_DRIVE, MOST_DRIVE) if squash else drawn).cpu().numpy()


class Collector:
    """Plays E environments and keeps what the next update needs, T actions at a time."""

    def __init__(self, args: argparse.Namespace, agent: Agent, eyes: Eyes):
        self.args, self.agent, self.eyes = args, agent, eyes
        self.env = make_vec(args.task, args.envs, seed=1 + args.seed, autoreset="same_step",
                            threads=args.threads, **with_skin(args, args.skin))  # fmt: skip
        obs, _ = self.env.reset()
        self.obs = eyes(obs, learn=True)
        self.state = torch.zeros(args.envs, 64, device=eyes.device)
        self.past = torch.zeros(self.env.action_space.shape, device=eyes.device)
        self.begins = torch.ones(args.envs, dtype=torch.bool, device=eyes.device)
        self.discounted, self.returns = np.zeros(args.envs), np.zeros(args.envs)
        self.scale = Running((1,))
        self.gamma, self.imitating = args.gamma, False

    @torch.no_grad()
    def collect(self) -> tuple[dict[str, torch.Tensor], torch.Tensor, list[tuple[float, bool]]]:
        """(T, E, …) by name, the memory before them, and (return, success) of ended episodes."""
        args, rows, first, ended_episodes = self.args, [], self.state, []
        for _ in range(args.length):
            self.state = self.state * ~self.begins[:, None]
            mean, value, after = self.agent(*self.obs, self.state, self.past)
            drawn = torch.randn(mean.shape).to(mean.device)  # the same on every device
            action = mean + self.agent.log_deviation.exp() * drawn
            row = {"image": self.obs[0], "rest": self.obs[1], "past": self.past, "action": action,
                   "begins": self.begins, "value": value,
                   "chance": log_likelihood(action, mean, self.agent.log_deviation)}  # fmt: skip
            if self.imitating:
                script = torch.from_numpy(self.env.scripted_action()).float()
                row["script"] = script.to(self.eyes.device)
            obs, reward, terminated, truncated, info = self.env.step(driven(action, args.squash))
            ended = terminated | truncated
            self.returns += reward
            self.discounted = self.discounted * self.gamma + reward
            self.scale.add(self.discounted[:, None])
            scaled = reward / np.sqrt(self.scale.square[0] / self.scale.count + 1e-8)
            scaled = np.clip(scaled, -10, 10)
            cut = np.flatnonzero(truncated & ~terminated)
            if len(cut):  # out of time: what would have come counts
                last = [info["final_obs"][e] for e in cut]
                seen = self.eyes({k: np.stack([o[k] for o in last]) for k in last[0]})
                worth = self.agent(*seen, after[cut], action[cut])[1].cpu().numpy()
                scaled[cut] += self.gamma * worth
            if ended.any():
                solved = info["final_info"]["success"]
                these = np.flatnonzero(ended)
                ended_episodes += [(self.returns[e], bool(solved[e])) for e in these]
            self.returns[ended] = self.discounted[ended] = 0
            self.obs, self.state = self.eyes(obs, learn=True), after
            self.begins = torch.from_numpy(ended).to(self.eyes.device)
            self.past = action * ~self.begins[:, None]
            gained = torch.from_numpy(scaled).float().to(self.eyes.device)
            rows.append(row | {"reward": gained, "end": self.begins})
        batch = {name: torch.stack([row[name] for row in rows]) for name in rows[0]}
        state = self.state * ~self.begins[:, None]
        batch["advantage"] = self._advantages(batch, self.agent(*self.obs, state, self.past)[1])
        return batch, first, ended_episodes

    def _advantages(self, batch: dict[str, torch.Tensor], value: torch.Tensor) -> torch.Tensor:
        advantage, found = torch.zeros_like(value), []
        for t in reversed(range(len(batch["value"]))):
            on = (~batch["end"][t]).float()
            delta = batch["reward"][t] + self.gamma * value * on - batch["value"][t]
            advantage = delta + self.gamma * self.args.trace * on * advantage
            value = batch["value"][t]
            found.append(advantage)
        return torch.stack(found[::-1])


def improve(agent: Agent, optimiser, batch, first: torch.Tensor, args, draw: np.random.Generator):
    """A few passes over the batch. With memory, minibatches are whole environments."""
    T, E = batch["value"].shape
    if agent.memory is None:  # every row on its own: T × E sequences of one action
        batch = {k: v.reshape(1, T * E, *v.shape[2:]) for k, v in batch.items()}
        first, T, E = first.new_zeros(T * E, 64), 1, T * E
    target = batch["advantage"] + batch["value"]
    size = max(1, args.minibatch // T)
    for _ in range(args.passes):
        order = torch.from_numpy(draw.permutation(E)).to(first.device)
        for chosen in order.split(size):
            part = {k: v[:, chosen] for k, v in batch.items()}
            mean, value = agent.sequence(
                part["image"], part["rest"], first[chosen], part["past"], part["begins"]
            )
            chance = log_likelihood(part["action"], mean, agent.log_deviation)
            ratio = (chance - part["chance"]).exp()
            a = part["advantage"]
            a = (a - a.mean()) / (a.std() + 1e-8)
            loss = torch.max(-a * ratio, -a * ratio.clamp(1 - args.clip, 1 + args.clip)).mean()
            if "script" in part:
                loss = (mean - part["script"]).square().mean()
            loss = loss + 0.5 * args.value * (value - target[:, chosen]).square().mean()
            loss = loss - args.entropy * agent.log_deviation.sum()
            optimiser.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(agent.parameters(), args.norm)
            optimiser.step()


def settings() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("task", help="a name, or FILE.py:CLASS or MODULE:CLASS of your own")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--threads", type=int, default=None)
    parser.add_argument("--device", default="cpu", help="where the networks are: cpu, cuda")
    parser.add_argument("--episodes", type=int, default=1000, help="to test on")
    parser.add_argument("--choices", type=int, default=5, help="policies to choose from")
    parser.add_argument("--without", action="append", default=[], metavar="KEY",
                        help="an observation that the policy does not see")  # fmt: skip
    parser.add_argument("--skin", choices=SKINS, default="springs",
                        help="of the pads, in training and choice")  # fmt: skip
    parser.add_argument("--play-skin", choices=SKINS, action="append", default=[],
                        help="of another test")  # fmt: skip
    parser.add_argument("--json", action="store_true")
    add_log(parser)
    for name, value in COMMON.items():
        flag = isinstance(value, bool)
        kind = {"action": argparse.BooleanOptionalAction} if flag else {"type": type(value)}
        parser.add_argument(f"--{name}", default=None, **kind)
    args = parser.parse_args()
    for name, value in (COMMON | TASKS.get(args.task, {})).items():
        if getattr(args, name) is None:
            setattr(args, name, value)
    if args.steps < args.envs * args.length:
        parser.error(f"--steps {args.steps}; an update takes {args.envs * args.length}")
    return args


def seen_shapes(env: Any, args: argparse.Namespace) -> dict[str, tuple[int, ...]]:
    """Shapes of what the policy sees, by name."""
    shapes = {name: box.shape for name, box in env.single_observation_space.items()}
    for name in args.without:
        if shapes.pop(name, None) is None or not shapes:
            raise SystemExit(f"ppo.py: --without {name}; the policy sees {list(shapes)}")
    if args.imitate and not hasattr(env, "scripted_action"):
        raise SystemExit(f"ppo.py: --imitate: {args.task} has no scripted_action()")
    return shapes


def main() -> None:
    args = settings()
    torch.set_num_threads(1)
    torch.manual_seed(args.seed)
    begin, clock = time.process_time(), time.perf_counter()
    choice = make_vec(args.task, CHOICE_EPISODES, autoreset="disabled", threads=args.threads,
                      **with_skin(args, args.skin))  # fmt: skip
    eyes = Eyes(seen_shapes(choice, args), args.convolve, args.device)
    agent = Agent(eyes.shapes, choice.single_action_space.shape[0], args.deviation,
                  args.recurrent)  # fmt: skip
    agent.to(args.device)
    optimiser = torch.optim.Adam(agent.parameters(), lr=args.rate, eps=1e-5)
    collector, draw = Collector(args, agent, eyes), np.random.default_rng(args.seed)
    log = Log(args.log)
    updates, curve, chosen = args.steps // (args.envs * args.length), [], []
    best, kept = (-np.inf,), (agent, eyes)
    grown = (1 - args.last_gamma) / (1 - args.gamma) if args.last_gamma else 1.0
    for k in range(updates):
        optimiser.param_groups[0]["lr"] = args.rate * (1 - k / updates)
        collector.imitating = k < args.imitate * updates
        collector.gamma = 1 - (1 - args.gamma) * (grown ** (k / updates))
        batch, first, ended = collector.collect()
        improve(agent, optimiser, batch, first, args, draw)
        steps = (k + 1) * args.envs * args.length
        if ended:
            curve.append([steps, *np.mean(ended, axis=0).round(4).tolist()])
            log(steps, train_return=curve[-1][1], train_success=curve[-1][2])
        if (k + 1) * args.choices // updates == k * args.choices // updates:
            continue
        played = play(choice, CHOICE_SEED, Actor(agent, eyes, args.squash)).summary()
        chosen.append([steps, played["return"], played["success"]])
        log(steps, **played)
        if merit(played) > best:
            best = merit(played)
            kept = copy.deepcopy((agent, eyes))
        reached = ", ".join(f"{name} {value:.4g}" for name, value in played.items())
        print(f"{steps} steps, {time.process_time() - begin:.0f} CPU s: {reached}",
              file=sys.stderr, flush=True)  # fmt: skip
    cost = {"train_cpu_s": time.process_time() - begin,
            "train_wall_s": time.perf_counter() - clock}  # fmt: skip
    results = {}
    for skin in dict.fromkeys([args.skin, *args.play_skin]):
        env = make_vec(args.task, args.episodes, autoreset="disabled", threads=args.threads,
                       **with_skin(args, skin))  # fmt: skip
        results[skin] = play(env, TEST_SEED, Actor(*kept, args.squash)).summary()
    result = results.pop(args.skin)
    if args.json:
        print(json.dumps({"program": "ppo", "settings": vars(args),
                          **provenance(args.device), **cost,
                          "steps": updates * args.envs * args.length,
                          "curve": curve[:: max(1, len(curve) // 100)], "choice": chosen,
                          "test": result, "tests": results}))  # fmt: skip
        return
    for skin, other in results.items():
        print(f"with {skin}: {other}")
    print(f"{args.task}, seed {args.seed}: {result}; {cost['train_cpu_s']:.0f} CPU s, "
          f"{cost['train_wall_s']:.0f} s on the clock")  # fmt: skip


if __name__ == "__main__":
    main()
