# SPDX-License-Identifier: Apache-2.0
"""The rolling test of SimBenchmark: error of two velocities against time of one thread.

    PYTHONPATH=build/release/python build/venv/bin/python bench/rolling.py

25 balls of 1 kg and 0.5 m lie on a box of 10 kg, which a force of 150 N pushes over the ground for
4 s. The friction of box and ground is 0.4, that of balls and box 0.8. So the box slides, and the
balls roll on it. The error is the mean over all steps of |v - v'|^2 of the box plus that of a ball
[m^2/s^2], where v' are the velocities of rigid bodies. Here contacts are springs, and the box
cannot turn. Published rows are those of the benchmark's data/rolling/sample.csv for
a force that is not parallel to an axis, measured by its authors on their machine.
"""

import argparse

import numpy as np
from simbenchmark import line, published, setting, timed

import tangere

BOX, BALL, RADIUS, GRAVITY, FORCE, SECONDS = 10.0, 1.0, 0.5, 9.81, 150.0, 4.0
DIRECTION = np.array([0.5, 0.866025403784439, 0.0])
ROWS = 5
KT, DAMPING = 1e5, 1e-3  #: friction of a contact that sticks [N s/m]; damping of kn [s]
SCENE = """<tangere model="rolling">
  <option unit="m-kg" gravity="0 0 -{gravity}" timestep="{step}" integrator="{scheme}"/>
  <ground pos="0 0 0" normal="0 0 1"/>
  <robot>
    <link name="box">
      <joint name="box" type="translational" pos="0 0 0.5"/>
      <body name="box" type="cuboid" size="20 20 1" density="{box_density}"
            general_contact_resolution="2 2 2"/>
    </link>
  </robot>
  {balls}
  <actuator><motor joint="box" ctrl="force" ctrl_range="-{force} {force}"/></actuator>
  <contact>
    <ground_contact body="box" kn="{kn}" kt="{kt}" mu="0.4" damping="{damping}"/>
    {contacts}
  </contact>
</tangere>"""
BALL_TEXT = """<robot><link name="{name}">
    <joint name="{name}" type="free3d" pos="{x} {y} 1.5"/>
    <body name="{name}" type="sphere" radius="{radius}" density="{density}"/>
  </link></robot>"""
CONTACT = """<general_primitive_contact general_body="{name}" primitive_body="box" kn="{kn}"
      kt="{kt}" mu="0.8" damping="{damping}" law="linear"/>"""
# Engine and the columns dt, error, time of rows without stabilisation.
PUBLISHED = [
    ("RaiSim", 1e-3, 4.12e-07, 0.243),
    ("RaiSim", 1e-2, 4.21e-07, 0.0293),
    ("Bullet", 1e-3, 6.43e-09, 0.594),
    ("MuJoCo, Newton", 1e-3, 0.00705, 0.851),
    ("MuJoCo, Newton", 1e-2, 0.213, 0.0682),
    ("ODE, quick step", 1e-3, 3.14, 0.749),
    ("DART, Dantzig", 1e-3, 3.14, 2.86),
]


def exact() -> tuple[float, float]:
    """Accelerations of the box and of a ball that rolls on it [m/s^2]."""
    n = ROWS**2
    sliding = 0.4 * (BOX + n * BALL) * GRAVITY
    push = (FORCE - sliding) / BOX / (3.5 / BALL + n / BOX)  # of the box on a ball
    return (FORCE - sliding - n * push) / BOX, push / BALL


def scene(scheme: str, step: float, kn: float) -> str:
    names = [f"ball_{i}_{j}" for i in range(ROWS) for j in range(ROWS)]
    balls = "\n  ".join(
        BALL_TEXT.format(name=name, x=2.0 * (k // ROWS) - 4, y=2.0 * (k % ROWS) - 4, radius=RADIUS,
                         density=BALL / (4 / 3 * np.pi * RADIUS**3))
        for k, name in enumerate(names)
    )
    contacts = "\n    ".join(CONTACT.format(name=name, kn=kn, kt=KT, damping=DAMPING * kn)
                             for name in names)
    return SCENE.format(gravity=GRAVITY, step=step, scheme=scheme, box_density=BOX / 400,
                        force=FORCE, balls=balls, contacts=contacts, kn=kn, kt=KT,
                        damping=DAMPING * kn)


def play(scheme: str, step: float, kn: float, accuracy: float) -> tuple[float, float, float]:
    """Error [m^2/s^2], the same after the first second, and the CPU time [s]."""
    model = tangere.Model(tangere.Scene.from_string(scene(scheme, step, kn), "rolling"))
    steps = round(SECONDS / step)
    controls = np.broadcast_to(DIRECTION, (steps, 1, 3)).copy()
    run, seconds = timed(model, 1, controls, accuracy)
    box, ball = exact()
    t = step * np.arange(1, steps + 1)[:, None]
    off_box = run.v[:, 0, 0:3] - t * box * DIRECTION
    off_ball = run.v[:, 0, 3:6] - t * ball * DIRECTION
    error = np.sum(off_box**2 + off_ball**2, 1)
    return float(np.mean(error)), float(np.mean(error[t[:, 0] > 1])), seconds


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kn", type=float, default=1e6, help="stiffness of contacts [N/m]")
    args = parser.parse_args()
    print(f"{'':<34}{'error':>13}{'after 1 s':>13}{'time [s]':>13}")
    for scheme, step, accuracy in [
        ("BDF1", 1e-3, 0), ("BDF2", 1e-3, 0), ("SDIRK2", 1e-3, 0), ("BDF1", 1e-2, 0),
        ("SDIRK2", 1e-2, 0), ("SDIRK3", 1e-2, 1e-3),
    ]:  # fmt: skip
        line(setting(scheme, step, accuracy), *play(scheme, step, args.kn, accuracy))
    for engine, step, error, seconds in PUBLISHED:
        line(published(engine, step), error, np.nan, seconds)


if __name__ == "__main__":
    main()
