// SPDX-License-Identifier: Apache-2.0
// Vectors [x, y, z]; poses, rows of [R | p] as one list of 12 numbers; hulls in the plane.

export const STILL = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]; // the pose of what stands in the root frame
export const radians = (angle) => (Math.PI * angle) / 180;
export const degrees = (angle) => (180 * angle) / Math.PI;
export const mean = (numbers) => numbers.reduce((sum, one) => sum + one, 0) / (numbers.length || 1);
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scaled = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

// The point p of a body with the pose m.
export const applied = (m, p) => [0, 4, 8].map((row) => m[row] * p[0] + m[row + 1] * p[1] + m[row + 2] * p[2] + m[row + 3]);

export function unit(v) {
  const length = Math.hypot(...v);
  return v.map((one) => one / length);
}

// The convex hull of points in the plane (monotone chain).
export function outlineOf(points) {
  const sorted = [...points].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  const half = (list) => {
    const chain = [];
    for (const p of list) {
      while (chain.length > 1 && turn(chain[chain.length - 2], chain[chain.length - 1], p) <= 0) chain.pop();
      chain.push(p);
    }
    return chain.slice(0, -1);
  };
  return [...half(sorted), ...half(sorted.reverse())];
}

const turn = (o, a, b) => (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]);
