# SPDX-License-Identifier: Apache-2.0
"""Where the goals of speed stand: every figure of bench/results/goals.md.

    build/venv/bin/pip install $(sed -n 's/^#bench //p' python/requirements.txt)
    build/venv/bin/python bench/goals.py [--only mujoco piles chains boxes elastic meshes writing
                                         stiff] [--turns 5] [--tangere build/release/tangere]

What is compared runs in turns on one thread. CPU time counts; a ratio is the median of those of all
turns. MuJoCo is the wheel that python/requirements.txt pins. Two goals have programs of their own:
build/release/gradient_benchmark (tactile) and build/release/articulated_benchmark.
"""

import argparse
import json
import math
import re
import resource
import statistics
import subprocess
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

import mujoco_peer
import pile_peer

ROOT = Path(__file__).resolve().parent.parent
TASKS = ("stable_grasp", "box_pushing", "cap_opening", "insertion")


class Bench:
    """Runs the command and returns numbers of its runs."""

    def __init__(self, tangere: Path, folder: Path, turns: int) -> None:
        self.tangere, self.folder, self.turns = tangere, folder, turns

    def run(self, scene: Path, environments: int, *options: str) -> dict:
        command = [str(self.tangere), "bench", str(scene), "--envs", str(environments), "--json"]
        command += ["--threads", "1", "--repeat", "1", "--frames", "none", *options]
        out = subprocess.run(command, capture_output=True, text=True)
        return json.loads(out.stdout)["runs"][0]

    def microseconds(self, scene: Path, environments: int, *options: str) -> float:
        """CPU time of a step of an environment; the least of three runs."""
        runs = [self.run(scene, environments, *options) for _ in range(3)]
        return min(1e6 / run["env_steps_per_cpu_second"] for run in runs)

    def compare(self, measures: list[Callable[[], float]]) -> list[tuple[float, float]]:
        """The median of each measure, and of its ratios to the first."""
        rows = [[measure() for measure in measures] for _ in range(self.turns)]
        return [
            (
                statistics.median(row[k] for row in rows),
                statistics.median(row[k] / row[0] for row in rows),
            )
            for k in range(len(measures))
        ]

    def write(self, name: str, text: str) -> Path:
        path = self.folder / name
        path.write_text(text)
        return path


def growth(costs: dict[int, float]) -> str:
    """The exponents of n between neighbouring sizes."""
    sizes = list(costs)
    return ", ".join(
        f"{a} to {b}: n^{math.log(costs[b] / costs[a]) / math.log(b / a):.2f}"
        for a, b in zip(sizes, sizes[1:])
    )


def mujoco(bench: Bench) -> None:
    print("MuJoCo's CPU time over ours (goals: 1.8 and 2 alone, 4 and 5 in a batch)")
    scenes = [
        mujoco_peer.scene_of(bench.folder, "plain.xml", lambda text: text),
        mujoco_peer.scene_of(bench.folder, "long.xml", mujoco_peer.longer),
    ]
    for environments in (1, 256):
        for field in (False, True):
            peers: list[mujoco_peer.MuJoCo | mujoco_peer.Ours] = [
                mujoco_peer.MuJoCo(environments, field)
            ]
            peers += [mujoco_peer.Ours(bench.tangere, s, environments, field) for s in scenes]
            (_, _), (_, plain), (_, long) = bench.compare([p.run for p in peers])
            what = "20 x 20 points" if field else "no field"
            print(
                f"  {environments:4d}, {what:<15} BDF2 5 ms {1 / plain:.2f}, "
                f"SDIRK2 12.5 ms {1 / long:.2f}",
                flush=True,
            )


def pile_seconds(bench: Bench, scene: Path, environments: int, steps: int) -> float:
    return pile_peer.ours(bench.tangere, scene, environments, steps)[0]


def piles(bench: Bench) -> None:
    print("Our CPU time over MuJoCo's in piles (goals: 1 alone, 0.5 of 16)")
    alone: dict[int, float] = {}
    steps = 400
    for boxes in (10, 20, 50):
        scene = bench.write("pile.xml", pile_peer.scene(boxes))
        peer = pile_peer.MuJoCo(boxes, steps)
        ours = [partial(pile_seconds, bench, scene, n, steps) for n in (1, 16)]
        rows = bench.compare([peer.run, *ours])
        alone[boxes] = rows[1][0]
        print(f"  {boxes:3d} boxes: alone {rows[1][1]:.2f}, of 16 {rows[2][1]:.2f}", flush=True)
    print(f"  growth alone (goal: n^1.2) {growth(alone)}")


def chain(links: int) -> str:
    """A chain that falls from level, hinged about two axes in turn."""
    text = [
        f'<tangere model="chain_{links}"><option unit="m-kg" gravity="0 0 -9.8" '
        'timestep="5e-3" integrator="BDF2"/><robot>'
    ]
    for k in range(links):
        parent = f' parent="l{k - 1}"' if k else ""
        text.append(
            f'<link name="l{k}"{parent}><joint name="l{k}" type="revolute" damping="1e-3" '
            f'axis="0 {1 - k % 2} {k % 2}" pos="{0.05 if k else 0} 0 0"/><body type="cuboid" '
            'pos="0.025 0 0" size="0.05 0.02 0.02" density="1000"/></link>'
        )
    return "\n".join([*text, "</robot></tangere>"])


def chains(bench: Bench) -> None:
    print("Chains [us a step] (goal: n^1.2)")
    for environments in (1, 16):
        costs = {}
        for links in (10, 20, 50, 100):
            scene = bench.write("chain.xml", chain(links))
            costs[links] = bench.microseconds(scene, environments, "--steps", "300")
        print(f"  of {environments}: {costs_text(costs)}; {growth(costs)}", flush=True)


def costs_text(costs: dict[int, float]) -> str:
    return ", ".join(f"{n}: {cost:.1f}" for n, cost in costs.items())


def free_boxes(boxes: int) -> str:
    """Boxes far from each other that rest on the ground."""
    side = math.ceil(boxes**0.5)
    text = [
        '<tangere model="boxes"><option unit="m-kg" gravity="0 0 -9.8" timestep="5e-3" '
        'integrator="BDF2"/><ground pos="0 0 0" normal="0 0 1"/><default><ground_contact kn="5e3" '
        'kt="5" mu="0.6" damping="100"/></default>'
    ]
    for i in range(boxes):
        text.append(
            f'<robot><link name="b{i}"><joint name="b{i}" type="free3d" pos="{0.1 * (i % side)} '
            f'{0.1 * (i // side)} 0.021"/><body name="b{i}" type="cuboid" density="600" '
            'size="0.04 0.04 0.04"/></link></robot>'
        )
    text += ["<contact>", *(f'<ground_contact body="b{i}"/>' for i in range(boxes))]
    return "\n".join([*text, "</contact></tangere>"])


def resident_megabytes(command: list[str]) -> float:
    run = subprocess.run(["/usr/bin/time", "-f", "%M", *command], capture_output=True, text=True)
    return int(run.stderr.split()[-1]) / 1024


def boxes(bench: Bench) -> None:
    print("Free boxes [us a step] and resident memory of 16 [MB] (goal: n^1.2)")
    costs, memory = {}, {}
    base = 0.0
    for count in (1, 2, 10, 50, 200):
        scene = bench.write("boxes.xml", free_boxes(count))
        command = [str(bench.tangere), "bench", str(scene), "--envs", "16", "--threads", "1"]
        command += ["--steps", "50", "--repeat", "1", "--frames", "none", "-q"]
        memory[count] = resident_megabytes(command)
        if count > 1:
            costs[count] = bench.microseconds(scene, 1, "--steps", "200")
        base = base or memory[count]
    grown = {n: max(memory[n] - base, 0.1) for n in (10, 50, 200)}
    print(f"  alone: {costs_text(costs)}; {growth(costs)}")
    print(f"  memory: {costs_text(memory)}; beyond that of one box: {growth(grown)}", flush=True)


def elastic(bench: Bench) -> None:
    print("Scenes with elastic friction over their viscous sisters, 64 environments (goal: 1.25)")
    for task in TASKS:
        scenes = [ROOT / "scenes" / f"{task}{end}.xml" for end in ("", "_elastic")]
        rows = bench.compare([partial(bench.microseconds, s, 64) for s in scenes])
        print(f"  {task:<13} {rows[1][1]:.2f}", flush=True)


def ball_of_triangles(rounds: int = 3) -> str:
    """An icosahedron whose triangles are cut in four so often, on the unit sphere, as OBJ."""
    t = (1 + 5**0.5) / 2
    corners = [(a, b * t, 0.0) for a in (-1, 1) for b in (-1, 1)]
    points = [p[k:] + p[:k] for k in range(3) for p in corners]
    near = min(math.dist(points[0], p) for p in points[1:]) * 1.01
    count = len(points)
    faces = [
        (i, j, k)
        for i in range(count)
        for j in range(i)
        for k in range(j)
        if max(math.dist(points[a], points[b]) for a, b in ((i, j), (j, k), (k, i))) < near
    ]
    for _ in range(rounds):
        middle: dict[tuple[int, int], int] = {}

        def between(a: int, b: int, of: dict[tuple[int, int], int] = middle) -> int:
            key = (min(a, b), max(a, b))
            if key not in of:
                of[key] = len(points)
                points.append(tuple(0.5 * (x + y) for x, y in zip(points[a], points[b])))
            return of[key]

        cut = []
        for a, b, c in faces:
            ab, bc, ca = between(a, b), between(b, c), between(c, a)
            cut += [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
        faces = cut
    lines = []
    unit = [[x / math.hypot(*p) for x in p] for p in points]
    for p in unit:
        lines.append("v {:.9f} {:.9f} {:.9f}".format(*(0.02 * x for x in p)))
    for a, b, c in faces:
        u, v, w = unit[a], unit[b], unit[c]
        normal = (
            (v[1] - u[1]) * (w[2] - u[2]) - (v[2] - u[2]) * (w[1] - u[1]),
            (v[2] - u[2]) * (w[0] - u[0]) - (v[0] - u[0]) * (w[2] - u[2]),
            (v[0] - u[0]) * (w[1] - u[1]) - (v[1] - u[1]) * (w[0] - u[0]),
        )
        outward = sum(n * x for n, x in zip(normal, u)) > 0
        lines.append(f"f {a + 1} {b + 1} {c + 1}" if outward else f"f {a + 1} {c + 1} {b + 1}")
    return "\n".join(lines) + "\n"


def meshes(bench: Bench) -> None:
    print("A ball of 1 280 triangles over a sphere, under the pad (goal: 3)")
    text = (ROOT / "scenes" / "rolling_ball_small.xml").read_text()
    sphere = bench.write("sphere.xml", text)
    bench.write("ball.obj", ball_of_triangles())
    body = 'type="sphere" radius="0.02"'
    assert body in text
    mesh = 'type="mesh" filename="ball.obj" transform_type="OBJ_TO_JOINT" resolution="64"'
    other = bench.write("mesh.xml", text.replace(body, mesh))
    for environments in (1, 16):
        for steps in ("200", "350"):
            rows = bench.compare(
                [
                    partial(bench.microseconds, s, environments, "--steps", steps)
                    for s in (sphere, other)
                ]
            )
            print(f"  {steps} steps of {environments}: {rows[1][1]:.2f}", flush=True)


def write_rows(bench: Bench, folder: Path, episodes: int, compress: str) -> tuple[float, float]:
    """Returns the rows of a CPU second, and the megabytes of 16 episodes."""
    command = [str(bench.tangere), "generate", str(ROOT / "scenes" / "rolling_ball.xml"), "-o"]
    command += [str(folder), "--episodes", str(episodes), "--threads", "1", "--json"]
    command += ["--compress", compress]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    out = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    size = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
    return json.loads(out)["rows"] / seconds, size * 16 / episodes / 1e6


def writing(bench: Bench) -> None:
    print("generate, 64 episodes of the ball with 200 x 200 points (goals: 5 k rows/s, 25 MB a 16)")
    for compress in ("none", "lz4", "deflate"):
        runs = [
            write_rows(bench, bench.folder / f"{compress}{turn}", 64, compress)
            for turn in range(bench.turns)
        ]
        rate = statistics.median(run[0] for run in runs)
        print(f"  {compress:<8}{rate:.0f} rows/s, {runs[0][1]:.1f} MB for 16 episodes", flush=True)


def stiffer(text: str, factors: dict[str, float]) -> str:
    """Multiplies coefficients of contacts; readings stay as they are."""

    def scaled(found: re.Match) -> str:
        tag = found.group(0)
        for name, factor in factors.items():
            tag = re.sub(
                rf'\b{name}="([^"]+)"', lambda m: f'{name}="{float(m.group(1)) * factor:g}"', tag
            )
        return tag

    return re.sub(r"<(?:general_primitive|ground)_contact[^>]*>", scaled, text)


def without_variation(text: str) -> str:
    """Takes out what draws coefficients, which would replace the stiffer ones."""
    return re.sub(r'\s*<\w+ [^>]*field="k[nt]"[^>]*/>', "", text)


def stiff(bench: Bench) -> None:
    print("Time of stiffer contacts over that of the scene, 16 environments (goal: 2.5)")
    ways = {"kn x 1e3": {"kn": 1e3}, "kt x 1e2": {"kt": 1e2}, "both x 1e2": {"kn": 1e2, "kt": 1e2}}
    for name in ("rolling_ball_small", *TASKS):
        text = without_variation((ROOT / "scenes" / f"{name}.xml").read_text())
        scenes = [bench.write("plain.xml", text)]
        scenes += [bench.write(f"{k}.xml", stiffer(text, f)) for k, f in enumerate(ways.values())]
        rows = bench.compare([partial(bench.microseconds, s, 16) for s in scenes])
        found = ", ".join(f"{way} {row[1]:.2f}" for way, row in zip(ways, rows[1:]))
        print(f"  {name:<18} {found}", flush=True)


def main() -> None:
    parts = {f.__name__: f for f in (mujoco, piles, chains, boxes, elastic, meshes, writing, stiff)}
    options = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    options.add_argument("--only", nargs="+", choices=list(parts), default=list(parts))
    options.add_argument("--turns", type=int, default=5)
    options.add_argument("--tangere", type=Path, default=ROOT / "build" / "release" / "tangere")
    given = options.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for name in given.only:
            parts[name](Bench(given.tangere, Path(folder), given.turns))


if __name__ == "__main__":
    main()
