# SPDX-License-Identifier: Apache-2.0
"""Simulated seconds per CPU second of the rolling ball at 1 % error of the field, on one thread.

    python3 bench/equal_error.py [--tangere build/release/tangere] [--turns 5]

Plays scenes/rolling_ball.xml in turns with the published setting (BDF2, 5 ms, solved to 1e-9) and
with two that reach 1 % (docs/accuracy.md), for one environment and 1024, with pads of
20 x 20 and 200 x 200 points read every 25 ms. The least CPU time of all turns counts. Errors are
those of `tangere bench --error`.
"""

import argparse
import json
import re
import subprocess
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SECONDS = 1.75
SETTINGS = {
    "BDF2, 5 ms, tol 1e-9": ('timestep="5e-3" integrator="BDF2"', 5, 'tol="1e-9"'),
    "BDF2, 5 ms": ('timestep="5e-3" integrator="BDF2"', 5, None),
    "SDIRK2, 12.5 ms": ('timestep="12.5e-3" integrator="SDIRK2"', 2, None),
    "SDIRK2, accuracy 0.03": ('timestep="25e-3" integrator="SDIRK2"', 1, 'accuracy="0.03"'),
}


def scene_of(name: str, points: int) -> str:
    option, every, solver = SETTINGS[name]
    text = (ROOT / "scenes" / "rolling_ball.xml").read_text()
    text = re.sub(r'timestep="5e-3" integrator="BDF2"', option, text)
    text = text.replace('resolution="200 200"', f'resolution="{points} {points}"')
    text = text.replace('every="5"', f'every="{every}"')
    if solver:
        text = text.replace("<ground ", f"<solver_option {solver}/>\n  <ground ", 1)
    return text


def bench(tangere: Path, scene: Path, *more: str) -> dict:
    command = [str(tangere), "bench", str(scene), "--threads", "1", "--repeat", "1", "--json"]
    run = subprocess.run([*command, *more], capture_output=True, text=True, check=True)
    return json.loads(run.stdout)


def compare(args: argparse.Namespace, scenes: dict[str, Path], envs: int, points: int) -> None:
    more = ["--envs", str(envs), "--frames", "compact"]
    least = dict.fromkeys(scenes, float("inf"))
    for _ in range(args.turns):
        for name, scene in scenes.items():
            seconds = bench(args.tangere, scene, *more)["runs"][0]["cpu_seconds"]
            least[name] = min(least[name], seconds)
    print(f"{envs} environments, {points} x {points} points, compact, mixed")
    first = next(iter(least.values()))
    for name, seconds in least.items():
        print(f"  {name:<22} {SECONDS * envs / seconds:8.0f}   {first / seconds:.2f} x", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tangere", type=Path, default=ROOT / "build" / "release" / "tangere")
    parser.add_argument("--turns", type=int, default=5)
    parser.add_argument("--envs", type=int, nargs="+", default=[1, 1024])
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        for points in (20, 200):
            scenes = {}
            for i, name in enumerate(SETTINGS):
                scenes[name] = Path(temporary) / f"{points}_{i}.xml"
                scenes[name].write_text(scene_of(name, points))
            for name, scene in scenes.items():
                found = bench(args.tangere, scene, "--envs", "16", "--error")["own_error"]
                print(f"{points} x {points} points, {name}: error {100 * found['error']:.2g} %")
            for envs in args.envs:
                compare(args, scenes, envs, points)


if __name__ == "__main__":
    main()
