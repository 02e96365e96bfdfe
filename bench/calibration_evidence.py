#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Prints the tables of docs/calibration.md#friction, #shear and #errors-of-the-depth, and of cells
in docs/layer.md: what friction moves in a fit of a press, what is found of a press that is sheared
at a speed, how many intervals contain the truth where depths are noisy, and forces of a layer by
the width of its cells.

    bench/calibration_evidence.py friction | shear | depth | cells

Simulated presses are the truth, so nothing but the program and h5py is needed."""

import argparse
import json
import math
import pathlib
import subprocess
import tempfile

import h5py
import numpy as np

TANGERE = pathlib.Path(__file__).resolve().parent.parent / "build/release/tangere"
MODULUS, TAU, BALL, DEPTH, ROWS = 4.28e5, 0.02, 7.5e-3, 1e-3, 40


def run(folder, *words):
    return subprocess.run([TANGERE, *words], cwd=folder, check=True, capture_output=True,
                          text=True).stdout


def skin(more, rows=36, cols=47, height=9.2e-3, width=7e-3, layer=""):
    return (f'type="rect_array" resolution="{rows} {cols}" rect_pos0="{-height} {width} 0" '
            f'rect_pos1="{height} {-width} 0" axis0="0 -1 0" axis1="1 0 0" {more}>{layer}'
            '</tactile>')


def layout(folder, text):
    (folder / "skin.xml").write_text(f'<sensor unit="m-kg"><tactile name="gel" {text}</sensor>')


def simulated_press(folder, text, speed):
    """Writes press.csv, in and out at a speed [m/s], of a sensor whose readings are simulated."""
    way = np.linspace(2e-5, DEPTH, ROWS)
    depth = np.concatenate([way, way[::-1][1:]])
    simulated(folder, text, np.zeros_like(depth), depth, DEPTH / ROWS / speed)


def simulated(folder, text, shear, depth, timestep):
    """Writes press.csv of a ball at each row's place [m], with `timestep` [s] between rows."""
    (folder / "press.xml").write_text(f"""
<tangere model="press"><option unit="m-kg" gravity="0 0 0" timestep="{timestep}"/>
<robot><link name="plate"><joint name="plate" type="fixed"/>
<body name="plate" type="cuboid" size="0.01 0.01 0.01"/></link></robot>
<robot><link name="ball"><joint name="ball" type="translational"/>
<body name="ball" type="sphere" radius="{BALL}" pos="0 0 {BALL}"/></link></robot>
<actuator><motor joint="ball" ctrl="position" P="1e9"/></actuator>
<initial><joint name="ball" q="{shear[0]} 0 {-depth[0]}"/></initial>
<sensor><tactile name="gel" body="plate" pressure_sign="1" {text}</sensor></tangere>""")
    zero = np.zeros_like(depth)
    np.savetxt(folder / "u.csv", np.c_[shear, zero, -depth], delimiter=",")
    run(folder, "simulate", "press.xml", "-o", "press.h5", "--overwrite", "--quiet",
        "--steps", str(len(depth)), "--controls", "u.csv")
    with h5py.File(folder / "press.h5") as file:
        force = file["tactile/gel/force"][:, 0].sum((1, 2))  # along axis0, axis1 = x, and z
        table = np.c_[file["time"][1:], -file["q"][1:, 0, 2], force[:, 2],
                      file["q"][1:, 0, 0], force[:, 1]]
    columns = 5 if shear.any() else 3
    np.savetxt(folder / "press.csv", table[:, :columns], delimiter=",", comments="",
               header=",".join(["time", "depth", "force", "shear", "shear_force"][:columns]))


def fit(folder, ball, *more):
    return json.loads(run(folder, "calibrate", "press.csv", "--sensor", "skin.xml", "--ball",
                          str(ball), "--json", "--quiet", *more))


def friction(folder):
    print("| speed | E | by friction | τ | by friction |\n|---|---|---|---|---|")
    attributes = 'thickness="4e-3" mu="0.6"'
    for speed in (1e-3, 1e-2):
        simulated_press(folder, skin(f'modulus="{MODULUS}" relaxation="{TAU}" {attributes}'), speed)
        layout(folder, skin(f'modulus="4e5" {attributes}'))
        found = fit(folder, BALL)
        cells = []
        for name, truth, scale, unit in (("modulus", MODULUS, 1e-6, "MPa"),
                                         ("relaxation", TAU, 1e3, "ms")):
            value = next(n["value"] for n in found["numbers"] if n["number"] == name)
            moved = next(n["value"] for n in found["friction"]["moved"] if n["number"] == name)
            cells += [f"{scale * value:.4g} {unit}, {100 * (value / truth - 1):+.1f} %",
                      f"{100 * moved / value:+.1f} %"]
        print(f"| {1e3 * speed:.0f} mm/s | " + " | ".join(cells) + " |")


def shear(folder):
    """A press by 0.5 mm and a shear by 0.6 mm, fitted from a layout with other numbers."""
    truth = {"modulus": MODULUS, "ks": 6e7, "mu": 0.5, "relaxation": TAU, "zero": 2e-5}
    names = " ".join(f'{k}="{v}"' for k, v in truth.items() if k != "zero")
    way = np.concatenate([np.linspace(2e-5, 5e-4, 20), np.full(34, 5e-4)])
    moved = np.clip(2e-5 * (np.arange(len(way)) - 23), 0, 6e-4)
    print("| speed | E | zero | ks | mu | τ |\n|---|---|---|---|---|---|")
    for speed in (0, 1e-3, 1e-2):
        layer_skin = skin(f'thickness="4e-3" {names}')
        simulated(folder, layer_skin, moved, way + truth["zero"], 2.5e-5 / (speed or 1e-6))
        table = np.loadtxt(folder / "press.csv", delimiter=",", skiprows=1)
        table[:, 1] -= truth["zero"]
        np.savetxt(folder / "press.csv", table[:, 0 if speed else 1:], delimiter=",", comments="",
                   header=("time," if speed else "") + "depth,force,shear,shear_force")
        layout(folder, skin('modulus="3e5" thickness="4e-3" ks="3e7" mu="1"'))
        found = {n["number"]: n["value"] for n in fit(folder, BALL)["numbers"]}
        cells = [f"{1e-6 * found['modulus']:.4g} MPa, "
                 f"{100 * (found['modulus'] / MODULUS - 1):+.2f} %",
                 f"{1e6 * found['zero']:.2f} µm", f"{found['ks']:.4g} N/m³", f"{found['mu']:.4f}",
                 f"{1e3 * found['relaxation']:.4g} ms" if "relaxation" in found else ""]
        print(f"| {f'{1e3 * speed:.0f} mm/s' if speed else 'slow'} | " + " | ".join(cells) + " |")


def depth(folder):
    """20 recordings of a sine with noisy depths and forces: intervals that contain the truth."""
    recordings, steps, random = 20, 20, np.random.default_rng(1)
    layout(folder, skin('modulus="3e5" thickness="4e-3" mu="0"', 19, 25))
    way = 5e-4 - 4e-4 * np.cos(2 * np.pi * np.arange(80 * steps + 1) / 80 / steps)
    truth = {"modulus": MODULUS, "relaxation": TAU, "zero": 0}
    simulated(folder, skin(f'modulus="{MODULUS}" thickness="4e-3" mu="0" relaxation="{TAU}"', 19,
                           25), np.zeros_like(way), way, 5e-3 / steps)
    exact = np.loadtxt(folder / "press.csv", delimiter=",", skiprows=1)[steps::steps]
    print("| depths | fit | E | zero | τ | mean E | mean τ |\n|---|---|---|---|---|---|---|")
    for noise in (2e-6, 5e-6):
        tables = []
        for _ in range(recordings):
            noisy = exact.copy()
            noisy[:, 1] += random.normal(0, noise, len(noisy))
            noisy[:, 2] += random.normal(0, 2e-3 * exact[:, 2].max(), len(noisy))
            tables.append(noisy)
        for title, more in (("none", ["--depth-error", "0"]), ("estimated", []),
                            ("given", ["--depth-error", str(noise)])):
            inside, values = dict.fromkeys(truth, 0), {name: [] for name in truth}
            for table in tables:
                np.savetxt(folder / "press.csv", table, delimiter=",", header="time,depth,force",
                           comments="")
                for n in fit(folder, BALL, *more)["numbers"]:
                    inside[n["number"]] += n["low"] <= truth[n["number"]] <= n["high"]
                    values[n["number"]].append(n["value"])
            mean = [100 * (np.mean(values[name]) / truth[name] - 1)
                    for name in ("modulus", "relaxation")]
            print(f"| {1e6 * noise:.0f} µm | {title} | " +
                  " | ".join(f"{inside[name]}" for name in ("modulus", "zero", "relaxation")) +
                  f" | {mean[0]:+.2f} % | {mean[1]:+.1f} % |")


def cells(folder):
    print("| gel, ball, depth | √(R d) | finest | t/10 | t/5 | t/3 |\n|---|---|---|---|---|---|")
    for t, ball, half, finest, depths in ((4e-3, 3e-3, 6e-3, 20, (2e-4, 4e-4, 1e-3)),
                                          (2e-3, 1.5e-3, 4e-3, 15, (1e-4, 5e-4))):
        for depth in depths:
            (folder / "press.csv").write_text(f"depth,force\n{depth},1\n")
            force = []
            for part in (finest, 10, 5, 3):
                cell = t / part
                n = round(2 * half / (cell / 2)) + 1
                side = (n - 1) / 2 * cell / 2
                layout(folder, skin(f'modulus="2e5" thickness="{t}"', n, n, side, side,
                                    f'<layer cell="{cell}"/>'))
                number = fit(folder, ball, "--fit", "modulus")["numbers"][0]
                force.append(1 / number["value"])
            print(f"| {1e3 * t:g} mm, {1e3 * ball:g} mm, {1e3 * depth:g} mm "
                  f"| {1e3 * math.sqrt(ball * depth):.2f} mm | t/{finest} | " +
                  " | ".join(f"{100 * (f / force[0] - 1):+.1f} %" for f in force[1:]) + " |")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("table", choices=("friction", "shear", "depth", "cells"))
    with tempfile.TemporaryDirectory() as name:
        {"friction": friction, "shear": shear, "depth": depth,
         "cells": cells}[parser.parse_args().table](pathlib.Path(name))
