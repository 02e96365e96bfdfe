// SPDX-License-Identifier: Apache-2.0
// Vectors are arrays of three, matrices Float32Arrays of sixteen, column by column.
const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const scale = (s, a) => [s * a[0], s * a[1], s * a[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) =>
  [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const norm = (a) => Math.hypot(a[0], a[1], a[2]);
const unit = (a) => scale(1 / (norm(a) || 1), a);

// The frame of a body from x y z qw qx qy qz.
function poseMatrix(p, at) {
  const [x, y, z, w, i, j, k] = p.subarray(at, at + 7);
  return new Float32Array([
    1 - 2 * (j * j + k * k), 2 * (i * j + k * w), 2 * (i * k - j * w), 0,
    2 * (i * j - k * w), 1 - 2 * (i * i + k * k), 2 * (j * k + i * w), 0,
    2 * (i * k + j * w), 2 * (j * k - i * w), 1 - 2 * (i * i + j * j), 0,
    x, y, z, 1]);
}

// m x for a point, and for a direction.
const turned = (m, a) => [0, 1, 2].map((r) => m[r] * a[0] + m[4 + r] * a[1] + m[8 + r] * a[2]);
const moved = (m, a) => add(turned(m, a), [m[12], m[13], m[14]]);

function product(a, b) {
  const c = new Float32Array(16);
  for (let col = 0; col < 4; ++col)
    for (let row = 0; row < 4; ++row)
      for (let k = 0; k < 4; ++k) c[4 * col + row] += a[4 * k + row] * b[4 * col + k];
  return c;
}

function perspective(angle, aspect, near, far) {
  const f = 1 / Math.tan(angle / 2), m = new Float32Array(16);
  m[0] = f / aspect; m[5] = f;
  m[10] = (far + near) / (near - far); m[11] = -1; m[14] = 2 * far * near / (near - far);
  return m;
}

function orthographic(half, near, far) {
  const m = new Float32Array(16);
  m[0] = m[5] = 1 / half;
  m[10] = -2 / (far - near); m[14] = -(far + near) / (far - near); m[15] = 1;
  return m;
}

function lookAt(eye, target, up) {
  const back = unit(sub(eye, target)), right = unit(cross(up, back)), top = cross(back, right);
  return new Float32Array([
    right[0], top[0], back[0], 0, right[1], top[1], back[1], 0, right[2], top[2], back[2], 0,
    -dot(right, eye), -dot(top, eye), -dot(back, eye), 1]);
}

// Two unit vectors across n.
function across(n) {
  const first = unit(cross(n, Math.abs(n[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0]));
  return [first, cross(n, first)];
}

// A length of 1, 2 or 5 times a power of ten, at most x.
function roundLength(x) {
  const power = 10 ** Math.floor(Math.log10(x)), digit = x / power;
  return power * (digit >= 5 ? 5 : digit >= 2 ? 2 : 1);
}

// A number with its unit, in the prefix that suits it.
function withUnit(x, name) {
  const size = Math.abs(x);
  const [factor, prefix] = size === 0 || size >= 0.1 ? [1, ""]
    : size >= 1e-4 ? [1e3, "m"] : size >= 1e-7 ? [1e6, "µ"] : [1e9, "n"];
  return `${Number((x * factor).toPrecision(3))} ${prefix}${name}`;
}
