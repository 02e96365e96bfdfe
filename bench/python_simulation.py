# SPDX-License-Identifier: Apache-2.0
"""What steps of `tangere.torch.Simulation` cost beside plain steps in C++, and its gradients.

    PYTHONPATH=build/release/python build/venv/bin/python bench/python_simulation.py
"""

from __future__ import annotations

import argparse
import time

import numpy as np
import torch

import tangere
import tangere.torch

# Both solve their steps to one tolerance, which the scene says. The pad presses the ball.
SIDE = {"none": 0, "20 x 20": 20}


def scene(side: int) -> tangere.Scene:
    builder = tangere.SceneBuilder.from_file(tangere.scenes()["rolling_ball_small"])
    builder.solver_option(tol=1e-9)
    pad = builder.find("tactile", name="pad")
    if side:
        pad.set(resolution=(side, side))
    return builder.scene()


def least(times: int, run) -> float:
    """Least processor time of some runs [s]."""
    best = np.inf
    for _ in range(times):
        before = time.process_time()
        run()
        best = min(best, time.process_time() - before)
    return best


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--envs", type=int, default=1024)
    parser.add_argument("--steps", type=int, default=50)
    parser.add_argument("--times", type=int, default=5)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    envs, steps = arguments.envs, arguments.steps
    print("| field | C++ [step/s] | no_grad | recorded |\n|---|---|---|---|")
    for name, side in SIDE.items():
        of, read = scene(side), ["pad"] if side else []
        model = tangere.Model(of)
        u = np.tile([0.0, 0.0, -0.2], (steps, envs, 1))
        q = np.array(tangere.Batch(model, envs).q)
        q[:, 2] -= 0.0155

        def plain():
            batch = tangere.Batch(model, envs, threads=1)
            batch.set_state(q, np.zeros_like(batch.v))
            batch.run(u, every=1, fields=read)

        sim = tangere.torch.Simulation(
            of, envs, steps, read=read, threads=1, precision="mixed", tape_bytes=8e9
        )
        controls = torch.tensor(u[0, 0])

        def played():
            s = sim.reset(q=torch.from_numpy(q))
            for _ in range(steps):
                s = sim.step(s, controls)

        def unrecorded():
            with torch.no_grad():
                played()

        seconds = [least(arguments.times, run) for run in (plain, unrecorded, played)]
        rate = envs * steps / np.array(seconds)
        print(f"| {name} | {rate[0]:.0f} | {rate[1] / rate[0]:.2f} | {rate[2] / rate[0]:.2f} |")
    gradients(arguments.times)


def gradients(times: int) -> None:
    envs, calls, every = 256, 20, 5
    sim = tangere.torch.Simulation(
        scene(20), envs, calls, every=every, read=["pad"], threads=1, tape_bytes=8e9
    )
    q = sim.reset().q
    q[:, 2] -= 0.0155

    def forward(u):
        s, loss = sim.reset(q=q), 0
        for t in range(calls):
            s = sim.step(s, u[t])
            loss = loss + s["pad"].square().sum() + s.v.square().sum()
        return loss

    def one_way():
        with torch.no_grad():
            forward(torch.tensor([0.0, 0.0, -0.2]).expand(calls, envs, 3))

    def both():
        u = torch.tensor([0.0, 0.0, -0.2]).expand(calls, envs, 3).clone().requires_grad_()
        forward(u).backward()

    a, b = least(times, one_way), least(times, both)
    print(f"forward {a:.2f} s, forward and backward {b:.2f} s: {b / a:.2f} times")


if __name__ == "__main__":
    main()
