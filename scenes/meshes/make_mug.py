#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes mug.obj, in metres: a cup with a handle, made of the places where a function is zero.

    python3 scenes/meshes/make_mug.py > scenes/meshes/mug.obj

The function is below zero inside. A grid of cubes is cut into tetrahedra, six a cube, and the
surface crosses each in one triangle or two. Neighbours share their corners, so the surface is
closed.
"""
import itertools
import math

STEP = 4.5e-3  # edge of a cube [m]
RADIUS, WALL, HEIGHT, BOTTOM = 22e-3, 6e-3, 45e-3, 7e-3
RING, TUBE = 14e-3, 4.5e-3  # of the handle
LOW, CUBES = (-26.6e-3, -26.6e-3, -28.6e-3), (16, 12, 13)


def inside(x, y, z):
    """Returns a number that is below zero in the mug, near its surface the distance [m]."""
    across = math.hypot(x, y)
    outer = max(across - RADIUS, abs(z) - HEIGHT / 2)
    hollow = max(across - (RADIUS - WALL), -HEIGHT / 2 + BOTTOM - z)
    cup = max(outer, -hollow)
    ring = math.hypot(math.hypot(x - RADIUS, z) - RING, y) - TUBE
    handle = max(ring, -(across - (RADIUS - WALL / 2)))  # ends within the wall
    return min(cup, handle)


def main():
    values, vertices, faces, numbers = {}, [], [], {}

    def place(node):
        return tuple(LOW[c] + STEP * node[c] for c in range(3))

    def value(node):
        if node not in values:
            v = inside(*place(node))
            values[node] = v if abs(v) > 0.05 * STEP else math.copysign(0.05 * STEP, v)
        return values[node]

    def vertex(a, b):
        key = (min(a, b), max(a, b))
        if key not in numbers:
            low, high = key
            share = value(low) / (value(low) - value(high))
            p, q = place(low), place(high)
            vertices.append([p[c] + share * (q[c] - p[c]) for c in range(3)])
            numbers[key] = len(vertices)
        return numbers[key]

    def add(corners, towards):
        """Adds a face whose corners are anticlockwise seen from `towards`."""
        a, b, c = (vertices[k - 1] for k in corners[:3])
        u, v = [b[i] - a[i] for i in range(3)], [c[i] - a[i] for i in range(3)]
        normal = (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])
        if sum(normal[i] * (towards[i] - a[i]) for i in range(3)) < 0:
            corners = corners[::-1]
        for k in range(1, len(corners) - 1):
            faces.append((corners[0], corners[k], corners[k + 1]))

    for cube in itertools.product(*(range(n) for n in CUBES)):
        for order in itertools.permutations(range(3)):
            corner, tetrahedron = list(cube), [cube]
            for axis in order:
                corner[axis] += 1
                tetrahedron.append(tuple(corner))
            below = [n for n in tetrahedron if value(n) < 0]
            above = [n for n in tetrahedron if value(n) >= 0]
            if not below or not above:
                continue
            if len(below) == 2:
                (a, b), (c, d) = below, above
                cut = [vertex(a, c), vertex(a, d), vertex(b, d), vertex(b, c)]
            elif len(below) == 1:
                cut = [vertex(below[0], n) for n in above]
            else:
                cut = [vertex(n, above[0]) for n in below]
            add(cut, place(above[0]))
    print("# A mug, by make_mug.py")
    for v in vertices:
        print("v {:.6f} {:.6f} {:.6f}".format(*v))
    for f in faces:
        print("f {} {} {}".format(*f))


main()
