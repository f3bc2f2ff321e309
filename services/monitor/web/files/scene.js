// SPDX-License-Identifier: Apache-2.0
// Draws the robot in perspective, shaded, by a depth buffer in JavaScript: it needs no graphics card, and a frame costs milliseconds.

import { applied, cross, dot, outlineOf, radians, STILL, sub, unit } from "./geometry.js";
import { drawPath } from "./path.js";
import { fill, rgb, SHADES, shadesOf, surfaceOf, surfacesIn } from "./surfaces.js";

const FIELD_OF_VIEW = 42; // degrees, of the smaller side
const LIGHT = unit([-0.55, 0.8, 0.5]); // where the light comes from: to the right, up and back as the camera sees it
const RESOLUTIONS = [0.5, 0.75, 1, 1.5, 2]; // pixels that are computed for each of the page's, along a side
const ENOUGH = 9; // ms of a frame below which a finer picture is computed
const TOO_MUCH = 20; // ms of a frame above which a coarser one is
const TINT = 0.4; // share of an agent's colour in that of its part
const FILLED = 0.86; // of the picture
const TRAIL = 60; // places of a hand

export class SceneView {
  constructor(canvas) {
    this.canvas = canvas;
    this.buffer = document.createElement("canvas");
    this.surfaces = [];
    this.things = new Map(); // surfaces of objects, by their shape as text
    this.trails = {};
    this.resolution = 2; // index
    this.cost = 0; // ms
    this.camera = null;
    this.listen();
  }

  // The robot: `eye` and `target` are the camera's place and what it sees.
  async open(robot) {
    this.robot = robot;
    this.trails = {};
    this.home = { eye: robot.eye, target: robot.target };
    this.turn("oblique");
    this.shown = null;
    const answer = await fetch("surfaces");
    if (!answer.ok) throw new Error(answer.statusText);
    this.surfaces = surfacesIn(await answer.arrayBuffer());
    this.paint(this.colors || {});
    this.redraw();
  }

  // Let the parts that agents move, `colors` by name, have something of their colours.
  paint(colors) {
    this.colors = colors;
    for (const one of this.surfaces) {
      const tint = colors[this.robot.parts[one.part]?.name];
      one.shades = shadesOf(tint ? one.color.map((channel, i) => (1 - TINT) * channel + TINT * tint[i]) : one.color);
    }
  }

  // Move the camera so that it sees these points, from where it looks now.
  fit(points) {
    if (this.isMoved || !this.camera || !points.length) return;
    const [width, height] = [this.canvas.clientWidth || 1, this.canvas.clientHeight || 1];
    const axes = cameraAxes(this.camera);
    const slope = Math.tan(radians(FIELD_OF_VIEW / 2));
    const limits = [slope * Math.max(1, width / height), slope * Math.max(1, height / width)].map((one) => one * FILLED);
    const target = [0, 1, 2].map((i) => {
      const along = points.map((p) => p[i]);
      return (Math.min(...along) + Math.max(...along)) / 2;
    });
    let distance = 0;
    for (const p of points) {
      const d = sub(p, target);
      for (const i of [0, 1]) distance = Math.max(distance, dot(d, axes[2]) + Math.abs(dot(d, axes[i])) / limits[i]);
    }
    Object.assign(this.camera, { target, distance });
    this.redraw();
  }

  turn(name) {
    const { eye, target } = this.home;
    const [dx, dy, dz] = sub(eye, target);
    const distance = Math.hypot(dx, dy, dz);
    const front = this.robot.icub ? 180 : 0; // degrees: the side on which the robot has its front
    const views = {
      oblique: [Math.atan2(dy, dx), Math.asin(dz / distance)],
      front: [radians(front), radians(4)],
      top: [radians(front), radians(88)],
      side: [radians(front + 90), radians(6)],
    };
    const [azimuth, elevation] = views[name];
    this.camera = { azimuth, elevation, distance: this.camera?.distance || distance, target: this.camera?.target || [...target] };
    this.isMoved = false;
  }

  listen() {
    let start = null;
    this.canvas.addEventListener("pointerdown", (event) => {
      if (!this.camera) return;
      start = { x: event.clientX, y: event.clientY, ...this.camera };
      this.canvas.setPointerCapture(event.pointerId);
    });
    this.canvas.addEventListener("pointermove", (event) => {
      if (!start) return;
      this.isMoved = true;
      this.camera.azimuth = start.azimuth - 0.008 * (event.clientX - start.x);
      this.camera.elevation = Math.min(1.55, Math.max(-0.6, start.elevation + 0.006 * (event.clientY - start.y)));
      this.redraw();
    });
    for (const name of ["pointerup", "pointercancel"]) this.canvas.addEventListener(name, () => (start = null));
    this.canvas.addEventListener(
      "wheel",
      (event) => {
        if (!this.camera) return;
        event.preventDefault();
        this.isMoved = true;
        const farthest = 6 * Math.hypot(...sub(this.home.eye, this.home.target));
        this.camera.distance = Math.min(farthest, Math.max(0.05, this.camera.distance * Math.exp(0.001 * event.deltaY)));
        this.redraw();
      },
      { passive: false },
    );
  }

  redraw() {
    if (this.shown) this.draw(this.shown);
  }

  // `body`: poses of the links and contacts; `marks`: of each agent its hand's place, where it goes, and its colour; `fields`: all are shown;
  // `path`: of a roadmap.
  draw(shown) {
    this.shown = shown;
    const { body, objects } = shown;
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    if (!width || !height || !this.camera) return;
    const begun = performance.now();
    this.prepare(width, height);
    const touched = new Set(body.contacts.flatMap((one) => [one.first, one.second]));
    for (const one of this.surfaces) this.surface(one, body.links[one.link] || STILL);
    for (const one of objects) this.surface(this.thing(one), pose(one));
    this.present(width, height);
    this.overlay(shown, touched);
    this.adapt(performance.now() - begun);
  }

  prepare(width, height) {
    const scale = RESOLUTIONS[this.resolution];
    const [w, h] = [Math.max(1, Math.round(width * scale)), Math.max(1, Math.round(height * scale))];
    if (w !== this.buffer.width || h !== this.buffer.height || !this.pixels) {
      [this.buffer.width, this.buffer.height] = [w, h];
      this.image = new ImageData(w, h);
      this.pixels = new Uint32Array(this.image.data.buffer);
      this.depth = new Float32Array(w * h);
      this.ground = new Uint32Array(w * h);
      for (let y = 0; y < h; y++) {
        const t = y / h;
        this.ground.fill(rgb(30 - 16 * t, 38 - 19 * t, 48 - 23 * t), y * w, (y + 1) * w);
      }
    }
    this.pixels.set(this.ground);
    this.depth.fill(0);
    const { distance, target } = this.camera;
    this.axes = cameraAxes(this.camera);
    this.eye = target.map((one, i) => one + distance * this.axes[2][i]);
    this.focal = (0.5 * Math.min(w, h)) / Math.tan(radians(FIELD_OF_VIEW / 2));
    this.near = 0.05 * distance;
  }

  // A point in pixels of the buffer, and its inverse depth.
  project(p) {
    const d = sub(p, this.eye);
    const inverse = 1 / Math.max(this.near, -dot(d, this.axes[2]));
    const scale = this.focal * inverse;
    return [this.buffer.width / 2 + scale * dot(d, this.axes[0]), this.buffer.height / 2 - scale * dot(d, this.axes[1]), inverse];
  }

  surface({ vertices, normals, triangles, shades, screen }, m) {
    const [right, up, back] = this.axes;
    const row = (a) => [0, 1, 2].map((i) => a[0] * m[i] + a[1] * m[4 + i] + a[2] * m[8 + i]);
    const offset = [m[3] - this.eye[0], m[7] - this.eye[1], m[11] - this.eye[2]];
    const [r, u, b] = [row(right), row(up), row(back)];
    const [ro, uo, bo] = [dot(right, offset), dot(up, offset), dot(back, offset)];
    const light = [0, 1, 2].map((i) => LIGHT[0] * r[i] + LIGHT[1] * u[i] + LIGHT[2] * b[i]);
    const [cx, cy, focal, near] = [this.buffer.width / 2, this.buffer.height / 2, this.focal, this.near];
    for (let v = 0, s = 0; v < vertices.length; v += 3, s += 4) {
      const x = vertices[v];
      const y = vertices[v + 1];
      const z = vertices[v + 2];
      const away = -(b[0] * x + b[1] * y + b[2] * z + bo);
      const inverse = 1 / (away < near ? near : away);
      screen[s] = cx + focal * inverse * (r[0] * x + r[1] * y + r[2] * z + ro);
      screen[s + 1] = cy - focal * inverse * (u[0] * x + u[1] * y + u[2] * z + uo);
      screen[s + 2] = away < near ? -1 : inverse;
      const bright = light[0] * normals[v] + light[1] * normals[v + 1] + light[2] * normals[v + 2];
      screen[s + 3] = (SHADES - 1) * Math.min(1, bright > 0 ? 0.3 + 0.7 * bright : 0.3 + 0.22 * bright);
    }
    for (let t = 0; t < triangles.length; t += 3) fill(this, screen, 4 * triangles[t], 4 * triangles[t + 1], 4 * triangles[t + 2], shades);
  }

  thing(one) {
    const key = `${one.kind} ${one.size} ${one.color}`;
    if (!this.things.has(key)) this.things.set(key, surfaceOf(one));
    return this.things.get(key);
  }

  present(width, height) {
    const ratio = window.devicePixelRatio || 1;
    const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
    if (this.canvas.width !== w || this.canvas.height !== h) [this.canvas.width, this.canvas.height] = [w, h];
    this.buffer.getContext("2d").putImageData(this.image, 0, 0);
    this.ink = this.canvas.getContext("2d");
    this.ink.setTransform(1, 0, 0, 1, 0, 0);
    this.ink.imageSmoothingQuality = "medium";
    this.ink.drawImage(this.buffer, 0, 0, w, h);
    const scale = w / this.buffer.width;
    this.ink.setTransform(scale, 0, 0, scale, 0, 0);
    this.unit = 1 / (scale / ratio); // a pixel of the page
  }

  // What stands before everything: fields that are touched, contacts, the hands' trails and where they go, and the path of a roadmap.
  overlay({ body, marks, fields, path }, touched) {
    const { ink, unit: px } = this;
    ink.lineCap = "round";
    for (const shape of this.robot.shapes) {
      if (!shape.field || !(fields || touched.has(shape.name))) continue;
      const m = body.links[shape.link] || STILL;
      ink.strokeStyle = ink.fillStyle = touched.has(shape.name) ? "rgba(255,70,60,0.24)" : "rgba(90,200,220,0.10)";
      if (shape.vertices) {
        const at = (v) => this.project(applied(m, shape.position.map((p, i) => p + dot(shape.rotation[i], v))));
        polygon(ink, outlineOf(shape.vertices.map(at)));
        continue;
      }
      const half = shape.kind === "capsule" ? shape.size[1] / 2 : 0;
      const ends = [-half, half].map((z) => this.project(applied(m, shape.position.map((p, i) => p + shape.rotation[i][2] * z))));
      ink.lineWidth = this.focal * shape.size[0] * (ends[0][2] + ends[1][2]);
      stroke(ink, [ends[0], [ends[1][0] + 0.01, ends[1][1]]]);
    }
    for (const mark of marks) {
      const trail = (this.trails[mark.part] ||= []);
      const last = trail.at(-1);
      if (mark.hand && (!last || Math.hypot(...sub(last, mark.hand)) > 0.004)) trail.push(mark.hand);
      if (trail.length > TRAIL) trail.shift();
      const points = trail.map((p) => this.project(p));
      ink.lineWidth = 2 * px;
      for (let i = 1; i < points.length; i++) {
        ink.strokeStyle = `rgba(${mark.color},${(0.75 * i) / points.length})`;
        stroke(ink, [points[i - 1], points[i]]);
      }
      if (mark.to && mark.hand) this.goal(ink, mark, px);
    }
    if (path.points) drawPath(ink, path.points.map((p) => this.project(p)), path.share, px);
    for (const one of body.contacts) {
      const [x, y] = this.project(one.point);
      ink.fillStyle = one.kind === "solid" ? "rgb(255,70,60)" : "rgba(255,120,90,0.9)";
      disc(ink, x, y, (one.kind === "solid" ? 5 : 3.5) * px);
    }
  }

  goal(ink, { hand, to, color }, px) {
    const [from, end] = [this.project(hand), this.project(to)];
    ink.strokeStyle = "rgba(255,255,255,0.9)";
    ink.lineWidth = 1.6 * px;
    ink.setLineDash([5 * px, 5 * px]);
    stroke(ink, [from, end]);
    ink.setLineDash([]);
    ink.fillStyle = `rgb(${color})`;
    disc(ink, end[0], end[1], 4.5 * px);
    ink.beginPath();
    ink.arc(end[0], end[1], 8 * px, 0, 7);
    ink.stroke();
  }

  adapt(took) {
    this.cost = this.cost ? 0.8 * this.cost + 0.2 * took : took;
    const finest = window.devicePixelRatio > 1 ? 4 : 3;
    if (this.cost > TOO_MUCH && this.resolution > 0) this.resolution -= 1;
    else if (this.cost < ENOUGH && this.resolution < finest) this.resolution += 1;
    else return;
    this.cost = 0; // measured anew at the new resolution
  }
}

// Right, up and back of a camera.
function cameraAxes({ azimuth, elevation }) {
  const back = [Math.cos(azimuth) * Math.cos(elevation), Math.sin(azimuth) * Math.cos(elevation), Math.sin(elevation)];
  const right = [-Math.sin(azimuth), Math.cos(azimuth), 0];
  return [right, cross(back, right), back];
}

function pose({ rotation: r, position: p }) {
  return [...r[0], p[0], ...r[1], p[1], ...r[2], p[2]];
}

function stroke(ink, points) {
  ink.beginPath();
  points.forEach(([x, y], i) => (i ? ink.lineTo(x, y) : ink.moveTo(x, y)));
  ink.stroke();
}

function polygon(ink, points) {
  ink.beginPath();
  points.forEach(([x, y], i) => (i ? ink.lineTo(x, y) : ink.moveTo(x, y)));
  ink.fill();
}

function disc(ink, x, y, radius) {
  ink.beginPath();
  ink.arc(x, y, radius, 0, 7);
  ink.fill();
}
