// SPDX-License-Identifier: Apache-2.0
// Triangles of the shapes: corners with normals, and indices. Lengths in metres, body frame.
class Solid {
  constructor() { this.positions = []; this.normals = []; this.indices = []; }

  corner(position, normal) {
    this.positions.push(...position);
    this.normals.push(...normal);
    return this.positions.length / 3 - 1;
  }

  // A strip of rings: ring(k) gives [radius, z, normal along the radius, normal along z].
  turn(rings, sides = 48) {
    const first = this.positions.length / 3;
    for (const [radius, z, out, up] of rings)
      for (let s = 0; s <= sides; ++s) {
        const angle = 2 * Math.PI * s / sides, x = Math.cos(angle), y = Math.sin(angle);
        this.corner([radius * x, radius * y, z], [out * x, out * y, up]);
      }
    for (let r = 0; r + 1 < rings.length; ++r)
      for (let s = 0; s < sides; ++s) {
        const a = first + r * (sides + 1) + s, b = a + sides + 1;
        this.indices.push(a, a + 1, b, b, a + 1, b + 1);
      }
    return this;
  }

  // Half a ball of rings from latitude `low` to `high`, its centre at z.
  cap(radius, z, low, high, count = 16) {
    const rings = [];
    for (let k = 0; k <= count; ++k) {
      const angle = low + (high - low) * k / count, c = Math.cos(angle), s = Math.sin(angle);
      rings.push([radius * c, z + radius * s, c, s]);
    }
    return this.turn(rings);
  }

  // The farthest corner from the origin.
  radius() {
    let most = 0;
    const at = this.positions;
    for (let i = 0; i < at.length; i += 3)
      most = Math.max(most, Math.hypot(at[i], at[i + 1], at[i + 2]));
    return most;
  }
}

const kQuarter = Math.PI / 2;
const ball = (radius) => new Solid().cap(radius, 0, -kQuarter, kQuarter, 32);

function cuboid(size) {
  const solid = new Solid();
  for (let axis = 0; axis < 3; ++axis)
    for (const side of [-1, 1]) {
      const n = [0, 0, 0], u = (axis + 1) % 3, v = (axis + 2) % 3, face = [];
      n[axis] = side;
      for (const [a, b] of [[-1, -1], [1, -1], [1, 1], [-1, 1]]) {
        const p = [0, 0, 0];
        p[axis] = side * size[axis] / 2; p[u] = a * size[u] / 2; p[v] = b * size[v] / 2;
        face.push(solid.corner(p, n));
      }
      const [a, b, c, d] = side > 0 ? face : face.reverse();
      solid.indices.push(a, b, c, a, c, d);
    }
  return solid;
}

function cylinder(length, radius) {
  const h = length / 2;
  return new Solid().turn([[0, -h, 0, -1], [radius, -h, 0, -1]])
    .turn([[radius, -h, 1, 0], [radius, h, 1, 0]]).turn([[radius, h, 0, 1], [0, h, 0, 1]]);
}

function capsule(length, radius) {
  const h = length / 2;
  return new Solid().cap(radius, -h, -kQuarter, 0).turn([[radius, -h, 1, 0], [radius, h, 1, 0]])
    .cap(radius, h, 0, kQuarter);
}

// Each triangle with its own normal: edges stay edges.
function mesh(vertices, triangles) {
  const solid = new Solid(), at = (k) => Array.from(vertices.subarray(3 * k, 3 * k + 3));
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [0, 1, 2].map((k) => at(triangles[t + k]));
    const n = unit(cross(sub(b, a), sub(c, a)));
    solid.indices.push(...[a, b, c].map((p) => solid.corner(p, n)));
  }
  return solid;
}

// Triangles whose corners have normals.
function smooth(vertices, normals, triangles) {
  const solid = new Solid();
  solid.positions.push(...vertices);
  solid.normals.push(...normals);
  solid.indices.push(...triangles);
  return solid;
}

// A body that has points alone: a small ball at each.
function dots(points) {
  let reach = 0;
  for (let i = 0; i < points.length; ++i) reach = Math.max(reach, Math.abs(points[i]));
  const solid = new Solid(), one = new Solid().cap(reach / 15 || 1e-3, 0, -kQuarter, kQuarter, 8);
  for (let i = 0; i < points.length; i += 3) {
    const first = solid.positions.length / 3;
    for (let k = 0; k < one.positions.length; k += 3)
      solid.corner([0, 1, 2].map((c) => one.positions[k + c] + points[i + c]),
        one.normals.slice(k, k + 3));
    for (const index of one.indices) solid.indices.push(first + index);
  }
  return solid;
}

// The triangles of a body of the data; null for a plane, which has no end and is drawn as ground.
function solidOf(body) {
  switch (body.kind) {
    case "sphere": return ball(body.radius);
    case "cuboid": return cuboid(body.size);
    case "cylinder": return cylinder(body.length, body.radius);
    case "capsule": return capsule(body.length, body.radius);
    case "mesh": return mesh(body.vertices, body.triangles);
    case "abstract": return dots(body.points);
    case "plane": return null;
    default: return smooth(body.vertices, body.normals, body.triangles);
  }
}

// An arrow of length 1 along z with its tip at 1; stretched by the renderer.
function arrow() {
  return new Solid().turn([[0, 0, 0, -1], [0.32, 0, 0, -1]], 12)
    .turn([[0.32, 0, 1, 0], [0.32, 1, 1, 0]], 12)
    .turn([[0.32, 1, 0, -1], [1, 1, 0, -1]], 12).turn([[1, 1, 0.8, 0.6], [0, 2, 0.8, 0.6]], 12);
}
