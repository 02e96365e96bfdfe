#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Fits channels to the recordings of an eFlesh skin, and writes R² into docs/channels.md.

python3 bench/magnet_channels.py EFLESH_FOLDER TANGERE [--write]

EFLESH_FOLDER is a clone of github.com/notvenky/eFlesh. Its recordings have one row of readings and
one of poses at about the same time: 15 magnetic channels, and x, y, z of the probe [mm].
"""
import argparse
import bisect
import csv
import json
import pathlib
import subprocess
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
DATA = "characterization/datasets"
RANDOM = "spatial_resolution/20250316_155729_probe"
LEVEL = "spatial_resolution/20250317_134149_probe"
PRESSES = [f"normal_force/20250401_{n}_probe" for n in ("014340", "015037", "015717")]
MIDDLE, HIGHEST, TOP = (289, -100), 146.0, 286.1  # [mm] of the skin; of the first touch
BALL, FLAT = ("--ball", "0.008"), ("--flat", "0.05")
SKIN = """<sensor unit="m-kg">
  <tactile name="lattice_guess" type="rect_array" resolution="31 31" per="area" kn="1e7"
           rect_pos0="-0.015 0.015 0" rect_pos1="0.015 -0.015 0" axis0="0 -1 0" axis1="1 0 0"/>
</sensor>
"""


def rows_of(path):
    with open(path) as file:
        return [[float(x) for x in row] for row in csv.reader(file)]


def paired(folder):
    """Pairs readings with the pose that is nearest in time."""
    states, readings = rows_of(folder / "states.csv"), rows_of(folder / "sensor_post_baselines.csv")
    times = [s[0] for s in states]
    for r in readings:
        at = bisect.bisect_left(times, r[0])
        both = [k for k in (at - 1, at) if 0 <= k < len(times)]
        yield states[min(both, key=lambda k: abs(times[k] - r[0]))], r[1:]


def write_table(folder, path, middle, highest):
    with open(path, "w") as out:
        out.write("depth_mm,x_mm,y_mm," + ",".join(f"channel_{k}" for k in range(15)) + "\n")
        for pose, channels in paired(folder):
            place = [pose[1] - middle[0], pose[2] - middle[1]]
            out.write(",".join(f"{v:.9g}" for v in [highest - pose[3], *place, *channels]) + "\n")


def fit(tangere, folder, table, nodes, check, indenter):
    call = [tangere, "calibrate", table, "--sensor", "skin.xml", *indenter, "--channels", "map.xml",
            "--nodes", f"{nodes},{nodes}", "--check", check, "--overwrite", "--json"]
    done = subprocess.run(call, cwd=folder, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def scores(answer):
    def cell(s):
        return f"{s['whole']:.3f} ({s['mean']:.3f}, {min(s['each']):.3f})"

    return f"{cell(answer['held_out'])} | {cell(answer['other'])}"


def table_of(eflesh, tangere):
    lines = ["| recording | nodes | R² held out: all (mean, least) | other recording |",
             "|---|---|---|---|"]
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        (folder / "skin.xml").write_text(SKIN)
        write_table(eflesh / DATA / RANDOM, folder / "random.csv", MIDDLE, HIGHEST)
        write_table(eflesh / DATA / LEVEL, folder / "level.csv", MIDDLE, HIGHEST)
        for nodes in (1, 2, 3, 4, 5):
            answer = fit(tangere, folder, "random.csv", nodes, "level.csv", BALL)
            cells = f"{nodes} × {nodes} | {scores(answer)}"
            lines.append(f"| 31 × 31 places, random depths | {cells} |")
        for k, press in enumerate(PRESSES):
            write_table(eflesh / DATA / press, folder / f"press{k}.csv", (315, -100), TOP)
        answer = fit(tangere, folder, "press0.csv", 1, "press1.csv", FLAT)
        lines.append(f"| one place, pressed 12 mm | 1 × 1 | {scores(answer)} |")
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("eflesh", type=pathlib.Path)
    parser.add_argument("tangere", type=pathlib.Path)
    parser.add_argument("--write", action="store_true", help="write the table into the page")
    a = parser.parse_args()
    table = table_of(a.eflesh, str(a.tangere.resolve()))
    print(table)
    if a.write:
        page = ROOT / "docs/channels.md"
        text = page.read_text()
        begin = "<!-- channels: made by bench/magnet_channels.py -->\n"
        end = "\n<!-- end of channels"
        first = text.index(begin) + len(begin)
        page.write_text(f"{text[:first]}\n{table}\n{text[text.index(end):]}")


if __name__ == "__main__":
    main()
