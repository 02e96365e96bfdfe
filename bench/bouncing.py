# SPDX-License-Identifier: Apache-2.0
"""The bouncing test of SimBenchmark: error of the energy against time of one thread.

    PYTHONPATH=build/release/python build/venv/bin/python bench/bouncing.py

49 balls of 10 kg and 0.1 m fall from a height of 5 m, without friction and without loss, for 20 s.
The error is the mean over all steps of the squared difference between their energy and m g H of all
of them [J^2]. Here the ground is a spring, so its energy counts as well. Each ball is an
environment: nothing acts between them. Published rows are those of the benchmark's
data/bouncing/sample.csv, measured by its authors on their machine.
"""

import argparse

import numpy as np
from simbenchmark import line, published, setting, timed

import tangere

BALLS, MASS, RADIUS, HEIGHT, GRAVITY, SECONDS = 49, 10.0, 0.1, 5.0, 9.8, 20.0
SCENE = """<tangere model="bouncing">
  <option unit="m-kg" gravity="0 0 -{gravity}" timestep="{step}" integrator="{scheme}"/>
  <ground pos="0 0 0" normal="0 0 1"/>
  <robot>
    <link name="ball">
      <joint name="ball" type="free3d" pos="0 0 {height}"/>
      <body name="ball" type="sphere" radius="{radius}" density="{density}"/>
    </link>
  </robot>
  <contact>
    <ground_contact body="ball" kn="{kn}" kt="0" mu="0" damping="0" law="linear"/>
  </contact>
</tangere>"""
# Engine and the columns dt, error, time of rows with restitution 1 and without
# stabilisation.
PUBLISHED = [
    ("RaiSim", 1e-3, 0.0186204, 0.223834),
    ("RaiSim", 1e-2, 185.953, 0.0252268),
    ("ODE", 1e-3, 185.027, 1.85601),
    ("ODE", 1e-2, 18808.3, 0.188425),
    ("Bullet", 1e-3, 75245.4, 0.851648),
    ("Bullet", 1e-2, 7.40664e6, 0.102335),
    ("DART", 1e-3, 72274.4, 3.2084),
    ("DART", 1e-2, 7.37588e6, 0.338765),
]


def energy(run: tangere.Run, kn: float) -> np.ndarray:
    """(F) of all balls [J], the spring's included."""
    height, speed = HEIGHT + run.q[:, :, 2], np.linalg.norm(run.v[:, :, :3], axis=2)
    depth = np.minimum(height - RADIUS, 0)
    return (MASS * GRAVITY * height + 0.5 * MASS * speed**2 + 0.5 * kn * depth**2).sum(axis=1)


def play(scheme: str, step: float, accuracy: float, kn: float) -> tuple[float, float]:
    """Error [J^2] and the least CPU time of three runs [s]."""
    density = MASS / (4 / 3 * np.pi * RADIUS**3)
    text = SCENE.format(gravity=GRAVITY, step=step, scheme=scheme, height=HEIGHT, radius=RADIUS,
                        density=density, kn=kn)
    model = tangere.Model(tangere.Scene.from_string(text, "bouncing"))
    steps = round(SECONDS / step)
    run, seconds = timed(model, BALLS, np.zeros((steps, BALLS, 0)), accuracy)
    return float(np.mean((energy(run, kn) - BALLS * MASS * GRAVITY * HEIGHT) ** 2)), seconds


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kn", type=float, default=1e7, help="stiffness of the ground [N/m]")
    args = parser.parse_args()
    print(f"{'':<34}{'error [J^2]':>13}{'time [s]':>13}")
    for scheme, step, accuracy in [
        ("BDF1", 1e-3, 0), ("SDIRK2", 1e-3, 0), ("SDIRK2", 1e-4, 0), ("SDIRK3", 1e-3, 0),
        ("SDIRK3", 1e-4, 0), ("SDIRK2", 1e-2, 1e-3), ("SDIRK2", 1e-2, 1e-5),
        ("SDIRK3", 1e-2, 1e-3), ("SDIRK3", 1e-2, 1e-5), ("SDIRK3", 4e-3, 1e-5),
        ("SDIRK3", 2e-3, 1e-6),
    ]:  # fmt: skip
        line(setting(scheme, step, accuracy), *play(scheme, step, accuracy, args.kn))
    for engine, step, error, seconds in PUBLISHED:
        line(published(engine, step), error, seconds)


if __name__ == "__main__":
    main()
