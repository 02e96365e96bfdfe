#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Fields of a soft layer and of springs against finite elements and a real sensor: the tables of
docs/layer.md.

    PYTHONPATH=build/release/python build/venv/bin/python bench/layer_evidence.py
    … bench/layer_evidence.py --write     # puts them into the page

Truth is tests/data/gel (its README is in tests/data): normal forces and motions on a gel of 20.75
by 25.25 by 4 mm by finite elements. The forces of a GelSight Mini are those that Helmut et al.
measured (FEATS, arXiv 2411.03315). Nothing is fitted but the stiffness of the springs, on one ball.
"""

from __future__ import annotations

import argparse
import re
import time
import warnings
from pathlib import Path

import numpy as np

import tangere

ROOT = Path(__file__).parents[1]
PAGE, DATA = ROOT / "docs/layer.md", ROOT / "tests/data/gel"
ROWS, COLS, TAXEL = 24, 32, 0.75e-3  # [m]
PER = 2  # points along the side of a taxel
SIZE, POINTS = (ROWS * TAXEL, COLS * TAXEL), (ROWS * PER, COLS * PER)
E, NU, THICKNESS = 0.428e6, 0.475, 4e-3  # [Pa], [m] of the truth, and as FEATS identified
SPRINGS = 2.8e8  # [N/m³]: fits the totals of the ball of 7.5 mm best
K = 2.3 * E / THICKNESS  # [N/m³] as springs of this material
MARGIN = 3.2e-3  # [m]: a GelSight Mini's gel has 20.75 × 25.25 mm
MEASURED = {0.5e-3: 1.6503, 1e-3: 5.9641, 1.5e-3: 13.5257, 2e-3: 23.2532}  # depth [m]: force [N]

BALL, BALLS = [("sphere", 'radius="0.0075"', 0.0, 0.0075)], [
    ("sphere", 'radius="0.003"', x, 0.003) for x in (-0.0035, 0.0035)
]
PUNCH = [("cylinder", 'length="0.01" radius="0.004"', 0.0, 0.005)]
CASES = [
    ("ball of 7.5 mm", BALL, 0.25e-3, "ball75_0250"),
    ("ball of 7.5 mm", BALL, 0.5e-3, "ball75_0500"),
    ("ball of 7.5 mm", BALL, 1e-3, "ball75_1000"),
    ("ball of 7.5 mm", BALL, 1.5e-3, "ball75_1500"),
    ("two balls of 3 mm", BALLS, 0.5e-3, "balls3_0500"),
    ("two balls of 3 mm", BALLS, 1e-3, "balls3_1000"),
    ("flat punch of 4 mm", PUNCH, 0.25e-3, "punch4_0250"),
]  # fmt: skip


def gel(
    bodies: list,
    skin: str,
    size: tuple[float, float],
    points: tuple[int, int],
    friction: str = 'mu="0" kt="0"',
    contact: str = "",
) -> tangere.Scene:
    """Bodies that slide along z and touch a gel with their lowest points at q = 0."""
    rows, cols = points
    pitch = size[0] / rows, size[1] / cols
    x, y = size[0] / 2 - pitch[0] / 2, size[1] / 2 - pitch[1] / 2
    links = "".join(
        f'<robot><link name="b{k}"><joint name="b{k}" type="prismatic" axis="0 0 1" '
        f'pos="{at} 0 {height}"/><body name="b{k}" type="{shape}" {numbers} density="1000"/></link>'
        "</robot>"
        for k, (shape, numbers, at, height) in enumerate(bodies)
    )
    text = f"""<tangere><option unit="m-kg" gravity="0 0 0" timestep="1e-3"/>
<robot><link name="plate"><joint name="plate" type="fixed" pos="0 0 -0.005"/>
<body name="plate" type="cuboid" size="{size[0]} {size[1]} 0.01" density="1000"/></link></robot>
{links}
<contact>{contact}</contact>
<sensor><tactile name="gel" body="plate" type="rect_array" rect_pos0="{-x} {-y} 0.005"
 rect_pos1="{x} {y} 0.005" axis0="1 0 0" axis1="0 1 0" resolution="{rows} {cols}" {friction}
 {skin}</tactile></sensor></tangere>"""
    with warnings.catch_warnings():  # nothing but the sensor touches the bodies
        warnings.simplefilter("ignore")
        return tangere.Scene.from_string(text)


def layer(cell: float, margin: float, feedback: str = "false", load: str = "depth") -> str:
    return (
        f'modulus="{E}" thickness="{THICKNESS}"><layer poisson="{NU}" cell="{cell}" '
        f'margin="{margin}" feedback="{feedback}" load="{load}"/><markers/>'
    )


def read(scene: tangere.Scene, depth: float, reading: str = "gel") -> np.ndarray:
    """(rows, cols, 3) of the points."""
    model = tangere.Model(scene)
    batch = tangere.Batch(model, 1, precision="double")
    batch.set_state(np.full(model.nq, -depth), np.zeros(model.nv))
    return batch.tactile(reading)[0]


def taxels(x: np.ndarray, per: int = PER) -> np.ndarray:
    """(ROWS, per, COLS, per, 3) of a gel of the truth's size: taxels of per × per points."""
    return x.reshape(ROWS, per, COLS, per, 3)


def error(found: np.ndarray, truth: np.ndarray) -> float:
    return float(np.linalg.norm(found - truth) / np.linalg.norm(truth))


def fields() -> str:
    """The table of normal fields."""
    lines = ["| body, depth | springs | cells of 0.75 mm | 0.375 mm | contact, 0.75 mm |",
             "|---|---|---|---|---|"]  # fmt: skip
    _, bodies, depth, data = CASES[-1]
    finer = (f"punch, {2 * PER} × {2 * PER} points", bodies, depth, data, 2 * PER)
    for name, bodies, depth, data, per in [*((*case, PER) for case in CASES), finer]:
        truth = np.loadtxt(DATA / f"{data}.txt", skiprows=1).reshape(ROWS, COLS)
        area, points, cells = (TAXEL / per) ** 2, (ROWS * per, COLS * per), []
        for skin in (f'kn="{SPRINGS * area}">', layer(0.75e-3, 1e-3), layer(0.375e-3, 1e-3),
                     layer(0.75e-3, 1e-3, "true")):  # fmt: skip
            found = taxels(read(gel(bodies, skin, SIZE, points), depth), per).sum((1, 3))[..., 2]
            total = found.sum() / truth.sum() - 1
            cells.append(f"{100 * error(found, truth):.1f} % ({100 * total:+.0f} %)")
        lines.append(f"| {name}, {1e3 * depth:g} mm | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def motions() -> str:
    """The table of the surface's motion, two taxels or more from the contact."""
    lines = ["| body, depth | lateral | bulge |", "|---|---|---|"]
    for name, bodies, depth, data in CASES:
        path = DATA / f"{data}_motion.txt"
        if not path.exists():
            continue
        truth = 1e-3 * np.loadtxt(path, skiprows=1).reshape(ROWS, COLS, 3)
        near = np.loadtxt(DATA / f"{data}.txt", skiprows=1).reshape(ROWS, COLS) != 0
        padded = np.pad(near, 2)
        near = np.any([padded[i:i + ROWS, j:j + COLS] for i in range(5) for j in range(5)], 0)
        scene = gel(bodies, layer(0.75e-3, 1e-3), SIZE, POINTS)
        found = taxels(read(scene, depth, "gel.surface")).mean((1, 3))
        parts = (f"{100 * error(found[~near][:, p], truth[~near][:, p]):.0f} %"
                 for p in ([0, 1], [2]))  # fmt: skip
        lines.append(f"| {name}, {1e3 * depth:g} mm | " + " | ".join(parts) + " |")
    return "\n".join(lines)


def forces() -> str:
    """The table of a GelSight Mini's forces."""
    lines = ["| depth | measured | layer | error |", "|---|---|---|---|"]
    for depth, force in MEASURED.items():
        scene = gel(BALL, layer(0.8e-3, MARGIN), (0.0186, 0.0143), (47, 36))
        found = float(read(scene, depth)[..., 2].sum())
        lines.append(f"| {1e3 * depth:g} mm | {force:.3f} N | {found:.3f} N | "
                     f"{100 * (found / force - 1):+.1f} % |")  # fmt: skip
    return "\n".join(lines)


def readings() -> str:
    """The table of what a reading costs."""
    lines = ["| pad | pressing points | layer | with `load` | springs |", "|---|---|---|---|---|"]
    rub, pads = 'mu="1" kt="0.01"', []
    touch = f'<surface_contact body1="b0" body2="plate" kn="{SPRINGS}" kt="0" mu="0"/>'
    for points, cell, depths in (((24, 32), 0.75e-3, (0.35e-3, 0.7e-3, 1e-3)),
                                 ((48, 64), 0.75e-3, (0.35e-3, 0.7e-3, 1e-3))):  # fmt: skip
        for depth in depths:
            times, pressing = [], 0
            area = SIZE[0] * SIZE[1] / (points[0] * points[1])
            for skin in (layer(cell, MARGIN), layer(cell, MARGIN, load="contact"),
                         f'kn="{SPRINGS * area}">'):  # fmt: skip
                model = tangere.Model(gel(BALL, skin, SIZE, points, rub, touch))
                batch = tangere.Batch(model, 1, precision="double")
                batch.set_state(np.full(model.nq, -depth), np.full(model.nv, 0.01))
                pressing = pressing or int((batch.tactile("gel")[0][..., 2] > 0).sum())
                best = np.inf
                for _ in range(5):
                    start = time.process_time()
                    for _ in range(200):
                        batch.tactile("gel")
                    best = min(best, (time.process_time() - start) / 200)
                times.append(f"{1e6 * best:.0f} µs")
            name = f"{points[0]} × {points[1]} points"
            lines.append(f"| {'' if name in pads else name} | {pressing} | {' | '.join(times)} |")
            pads.append(name)
    return "\n".join(lines)


def contacts() -> str:
    """The table of what a step costs with layers as contacts."""
    gels = (ROOT / "scenes/gel_grasp.xml").read_text()
    springs = re.sub(r"<layer .*/>", "", gels).replace("</contact>", "".join(
        f'<surface_contact body1="rod" body2="{side}_finger" kn="{K}" ks="{0.4 * K}" mu="1" '
        f'kt="{2e-3 * K}" damping="{12.5 * K}"/>' for side in ("left", "right")
    ) + "</contact>")  # fmt: skip
    lines = ["| contact of `scenes/gel_grasp.xml` | CPU time of a step |", "|---|---|"]
    for name, text in (("springs", springs), ("layers", gels)):
        scene = tangere.Scene.from_string(text)
        model = tangere.Model(scene)
        batch = tangere.Batch(model, 1)
        controls = np.array([[0.0, 0.8, 0.8]])
        for _ in range(100):
            batch.step(controls)
        start = time.process_time()
        for _ in range(400):
            batch.step(controls)
        cost = (time.process_time() - start) / 400
        lines.append(f"| {name} | {1e3 * cost:.2f} ms |")
    return "\n".join(lines)


TABLES = {"fields": fields, "motions": motions, "forces": forces, "contacts": contacts,
          "readings": readings}  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", help="put the tables into docs/layer.md")
    write = parser.parse_args().write
    page = PAGE.read_text()
    for name, make in TABLES.items():
        table = make()
        print(table + "\n")
        begin = f"<!-- {name}: made by bench/layer_evidence.py -->\n"
        end = f"\n<!-- end of {name} -->"
        before, _, rest = page.partition(begin)
        page = before + begin + "\n" + table + "\n" + rest[rest.index(end):]
    if write:
        PAGE.write_text(page)


if __name__ == "__main__":
    main()
