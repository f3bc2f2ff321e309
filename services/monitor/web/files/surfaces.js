// SPDX-License-Identifier: Apache-2.0
// Surfaces of triangles, and how a triangle is filled in a picture with a depth for each pixel.

export const SHADES = 64; // of a colour
const OBJECT_ROUND = 20; // corners of a circle

export const rgb = (r, g, b) => ((255 << 24) | (Math.round(b) << 16) | (Math.round(g) << 8) | Math.round(r)) >>> 0;

// The surfaces of the robot, as services/monitor/web/surfaces.py encodes them.
export function surfacesIn(data) {
  const length = new DataView(data).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
  let at = 4 + length;
  const take = (kind, count) => {
    const found = new kind(data, at, count);
    at += 4 * count;
    return found;
  };
  return header.map((one) => {
    const vertices = take(Float32Array, 3 * one.vertices);
    const normals = take(Float32Array, 3 * one.vertices);
    return surface(one.link, one.part, one.color, vertices, normals, take(Uint32Array, 3 * one.triangles));
  });
}

function surface(link, part, color, vertices, normals, triangles) {
  return { link, part, color, vertices, normals, triangles, shades: shadesOf(color), screen: new Float32Array((4 * vertices.length) / 3) };
}

// The colour in every brightness, as pixels.
export function shadesOf(color) {
  const shades = new Uint32Array(SHADES);
  for (let i = 0; i < SHADES; i++) {
    const bright = i / (SHADES - 1);
    const white = 90 * Math.max(0, bright - 0.75) ** 1.5;
    shades[i] = rgb(...color.map((channel) => Math.min(255, channel * (0.22 + 0.95 * bright) + white)));
  }
  return shades;
}

// The surface of an object of the world.
export function surfaceOf({ kind, size, color }) {
  if (kind === "box") {
    const [vertices, normals, triangles] = [[], [], []];
    for (let axis = 0; axis < 3; axis++) {
      for (const side of [-1, 1]) {
        const first = vertices.length / 3;
        const [a, b] = side > 0 ? [(axis + 1) % 3, (axis + 2) % 3] : [(axis + 2) % 3, (axis + 1) % 3];
        for (const [s, t] of [[-1, -1], [1, -1], [1, 1], [-1, 1]]) {
          const [corner, normal] = [[0, 0, 0], [0, 0, 0]];
          corner[axis] = (side * size[axis]) / 2;
          corner[a] = (s * size[a]) / 2;
          corner[b] = (t * size[b]) / 2;
          normal[axis] = side;
          vertices.push(...corner);
          normals.push(...normal);
        }
        triangles.push(first, first + 1, first + 2, first, first + 2, first + 3);
      }
    }
    return surface(0, -1, color, Float32Array.from(vertices), Float32Array.from(normals), Uint32Array.from(triangles));
  }
  const [radius, half] = [size[0], kind === "sphere" ? 0 : size[1] / 2];
  const flat = kind === "cylinder";
  const profile = flat ? [[0, -1, 0, -1], [1, -1, 0, -1], [1, -1, 1, 0], [1, 1, 1, 0], [1, 1, 0, 1], [0, 1, 0, 1]] : [];
  for (let i = 0; !flat && i <= OBJECT_ROUND / 2; i++) {
    const angle = Math.PI * ((2 * i) / OBJECT_ROUND - 0.5);
    profile.push([Math.cos(angle), Math.sin(angle), Math.cos(angle), Math.sin(angle)]);
  }
  const [vertices, normals, triangles] = [[], [], []];
  for (let i = 0; i <= OBJECT_ROUND; i++) {
    const [c, s] = [Math.cos((2 * Math.PI * i) / OBJECT_ROUND), Math.sin((2 * Math.PI * i) / OBJECT_ROUND)];
    profile.forEach(([r, z, nr, nz], j) => {
      vertices.push(radius * r * c, radius * r * s, flat ? half * z : radius * z + Math.sign(z) * half);
      normals.push(nr * c, nr * s, nz);
      const first = i * profile.length + j;
      const beside = first + profile.length;
      if (i < OBJECT_ROUND && j < profile.length - 1) triangles.push(first, beside, beside + 1, first, beside + 1, first + 1);
    });
  }
  return surface(0, -1, color, Float32Array.from(vertices), Float32Array.from(normals), Uint32Array.from(triangles));
}

// Fill a triangle that faces the camera: rows from top to bottom, depth and shade linear in the picture.
export function fill({ pixels, depth, image: { width, height } }, screen, a, b, c, shades) {
  if (screen[a + 2] < 0 || screen[b + 2] < 0 || screen[c + 2] < 0) return; // behind the camera
  const [ax, ay, bx, by, cx, cy] = [screen[a], screen[a + 1], screen[b], screen[b + 1], screen[c], screen[c + 1]];
  const area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay);
  if (area >= 0) return; // seen from behind
  const top = Math.max(0, Math.ceil(Math.min(ay, by, cy) - 0.5));
  const bottom = Math.min(height - 1, Math.floor(Math.max(ay, by, cy) - 0.5));
  if (top > bottom) return;
  const [az, al] = [screen[a + 2], screen[a + 3]];
  const [zb, zc, lb, lc] = [screen[b + 2] - az, screen[c + 2] - az, screen[b + 3] - al, screen[c + 3] - al];
  const zx = (zb * (cy - ay) - zc * (by - ay)) / area;
  const zy = (zc * (bx - ax) - zb * (cx - ax)) / area;
  const lx = (lb * (cy - ay) - lc * (by - ay)) / area;
  const ly = (lc * (bx - ax) - lb * (cx - ax)) / area;
  for (let y = top; y <= bottom; y++) {
    const row = y + 0.5;
    let left = Infinity;
    let right = -Infinity;
    if (ay > row !== by > row) {
      const x = ax + ((row - ay) * (bx - ax)) / (by - ay);
      if (x < left) left = x;
      if (x > right) right = x;
    }
    if (by > row !== cy > row) {
      const x = bx + ((row - by) * (cx - bx)) / (cy - by);
      if (x < left) left = x;
      if (x > right) right = x;
    }
    if (cy > row !== ay > row) {
      const x = cx + ((row - cy) * (ax - cx)) / (ay - cy);
      if (x < left) left = x;
      if (x > right) right = x;
    }
    const first = Math.max(0, Math.ceil(left - 0.5));
    const last = Math.min(width - 1, Math.ceil(right - 0.5) - 1);
    let z = az + zx * (first + 0.5 - ax) + zy * (row - ay);
    let light = al + lx * (first + 0.5 - ax) + ly * (row - ay);
    for (let x = first, at = y * width + first; x <= last; x++, at++) {
      if (z > depth[at]) {
        depth[at] = z;
        pixels[at] = shades[light < 0 ? 0 : light > SHADES - 1 ? SHADES - 1 : light | 0];
      }
      z += zx;
      light += lx;
    }
  }
}
