#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes pebble.obj, in metres: a closed surface, longer than it is wide, with one blunt end.

    python3 scenes/meshes/make_pebble.py > scenes/meshes/pebble.obj

A point lies where |x/a|^e + |y/b|^e + |z/b|^e = 1. Its y and z then grow with x.
"""
import math

A, B, POWER, TAPER = 29e-3, 21.5e-3, 2.4, 4.0  # half axes [m], e, growth of the width [1/m]
AROUND, RINGS = 28, 18


def point(down, around):
    """Returns the point in the direction of two angles: from the z axis, and around it."""
    d = (math.sin(down) * math.cos(around), math.sin(down) * math.sin(around), math.cos(down))
    length = sum(abs(c / half) ** POWER for c, half in zip(d, (A, B, B))) ** (-1 / POWER)
    x = d[0] * length
    return x, d[1] * length * (1 + TAPER * x), d[2] * length * (1 + TAPER * x)


def main():
    points = [point(0, 0)]
    for ring in range(1, RINGS):
        down = math.pi * ring / RINGS
        points += [point(down, 2 * math.pi * k / AROUND) for k in range(AROUND)]
    points.append(point(math.pi, 0))
    faces = []
    last, bottom = len(points) - 1, 1 + (RINGS - 2) * AROUND
    for k in range(AROUND):
        n = (k + 1) % AROUND
        faces.append((0, 1 + k, 1 + n))
        for ring in range(RINGS - 2):
            upper, lower = 1 + ring * AROUND, 1 + (ring + 1) * AROUND
            faces += [(upper + k, lower + k, lower + n), (upper + k, lower + n, upper + n)]
        faces.append((last, bottom + n, bottom + k))
    print("# A pebble, made by make_pebble.py")
    for p in points:
        print("v " + " ".join(f"{c:.6f}" for c in p))
    for face in faces:
        print("f " + " ".join(str(k + 1) for k in face))


if __name__ == "__main__":
    main()
