// SPDX-License-Identifier: Apache-2.0
// Draws the body in parallel projection with the places of its hands; places and the ball can be pointed at.
import { title } from "./cards.js";
import { drawPath } from "./path.js";
import { add, applied, cross, degrees, dot, mean, outlineOf, radians, scaled, STILL, sub, unit } from "./geometry.js";

const VIEWS = { front: [0, 4], top: [0, 89], side: [90, 6] }; // azimuth and elevation in degrees; oblique: that of the 3D view
const FLAT = 15; // degrees of elevation below which things are dragged in the plane of the picture, not horizontally
const NEAR = 13; // pixels
const TOP = 34; // pixels above what is drawn, for the title
const EDGE = 16; // pixels at the other sides
const ROOM = 0.8; // share of the picture for a robot of which is not known where it will move
const DARK = [26, 34, 44];

export class BodyPicture {
  // `legend`: stands below the picture, and takes some of its height.
  constructor(canvas, { tip, legend, dropped, picked, changed }) {
    this.canvas = canvas;
    this.legend = legend;
    this.tip = tip;
    this.dropped = dropped; // (name, place): an object was dragged there
    this.picked = picked; // (place or null): a place was clicked
    this.changed = changed; // (): the picture is to be drawn again
    this.robot = null;
    this.body = null;
    this.objects = [];
    this.places = {};
    this.left = {};
    this.path = {}; // of a roadmap
    this.chosen = null; // part whose places are shown; null: of all
    this.fields = false;
    this.place = null; // the one that was clicked
    this.dragging = null;
    this.view = [...VIEWS.front];
    this.spots = [];
    this.dirty = true;
    this.listen();
  }

  touch() {
    this.dirty = true;
    this.changed();
  }

  look(name) {
    if (name === "oblique") {
      const [dx, dy, dz] = unit(sub(this.robot.eye, this.robot.target));
      this.view = [180 - degrees(Math.atan2(dy, dx)), degrees(Math.asin(dz))];
    } else {
      this.view = [...VIEWS[name]];
      if (!this.isIcub() && name !== "top") this.view[0] += 180;
    }
    this.refit();
  }

  // Fit the picture again when it is drawn next; until then it can be pointed at as it is.
  refit() {
    if (this.frame) this.frame.key = "";
    this.touch();
  }

  isIcub() {
    return !this.robot || this.robot.icub;
  }

  // Right, up and ahead of the camera, as in mobee.rendering.camera.
  axes() {
    const [a, e] = this.view.map(radians);
    const ahead = [Math.cos(a) * Math.cos(e), -Math.sin(a) * Math.cos(e), -Math.sin(e)];
    const right = [-Math.sin(a), -Math.cos(a), 0];
    return [right, cross(right, ahead), ahead];
  }

  project(point) {
    const [right, up, ahead] = this.camera;
    return [this.frame.x + this.frame.scale * dot(point, right), this.frame.y - this.frame.scale * dot(point, up), dot(point, ahead)];
  }

  // The point that is seen at a pixel, in the plane through `through`: horizontal, or of the picture if it is seen from the side.
  unproject(x, y, through) {
    const [right, up, ahead] = this.camera;
    const u = (x - this.frame.x) / this.frame.scale;
    const v = (this.frame.y - y) / this.frame.scale;
    const flat = add(scaled(right, u), scaled(up, v));
    if (Math.abs(this.view[1]) < FLAT) return add(flat, scaled(ahead, dot(through, ahead)));
    return add(flat, scaled(ahead, (through[2] - flat[2]) / ahead[2]));
  }

  link(index) {
    return this.body.links[index] || STILL;
  }

  moved(index, p) {
    return applied(this.link(index), p);
  }

  points(shape, place) {
    const r = shape.rotation;
    const at = (x, y, z) => place(add(shape.position, [0, 1, 2].map((i) => r[i][0] * x + r[i][1] * y + r[i][2] * z)));
    if (shape.kind === "sphere") return [at(0, 0, 0)];
    if (shape.kind === "capsule" || shape.kind === "cylinder") return [at(0, 0, -shape.size[1] / 2), at(0, 0, shape.size[1] / 2)];
    if (shape.kind === "box") {
      const corners = [];
      for (const x of [-0.5, 0.5]) for (const y of [-0.5, 0.5]) for (const z of [-0.5, 0.5]) corners.push(at(x * shape.size[0], y * shape.size[1], z * shape.size[2]));
      return corners;
    }
    return (shape.vertices || []).map((v) => at(...v));
  }

  // Points that a picture must hold: of the robot, of all places, of targets.
  extent() {
    const seen = [];
    for (const shape of this.robot.shapes) if (!shape.field) seen.push(...this.points(shape, (p) => this.moved(shape.link, p)));
    for (const where of Object.values(this.places)) seen.push(...where.points.map((p) => this.moved(where.link, p)));
    for (const thing of this.objects) if (thing.role === "target") seen.push(thing.position);
    seen.push(...(this.path.points || []));
    return seen.length ? seen : [[0, 0, 0], [0, 0, 0.3]];
  }

  // Fit what is drawn into the canvas; kept until the view or the size changes, so that the picture does not swim.
  fit(width, height) {
    const key = `${width} ${height} ${this.legend.clientHeight} ${this.view} ${this.robot.name} ${Object.keys(this.places)} ${this.path.points?.at(-1) || ""}`;
    if (this.frame && this.frame.key === key) return;
    this.camera = this.axes();
    const seen = this.extent();
    const us = seen.map((p) => dot(p, this.camera[0]));
    const vs = seen.map((p) => dot(p, this.camera[1]));
    const [u0, u1, v0, v1] = [Math.min(...us), Math.max(...us), Math.min(...vs), Math.max(...vs)];
    const bottom = height - this.legend.clientHeight - EDGE;
    const share = Object.keys(this.places).length ? 1 : ROOM; // places show where the robot will move
    const scale = share * Math.min((width - 2 * EDGE) / (u1 - u0), (bottom - TOP) / (v1 - v0));
    this.frame = { key, scale, x: width / 2 - (scale * (u0 + u1)) / 2, y: (TOP + bottom) / 2 + (scale * (v0 + v1)) / 2 };
  }

  draw() {
    if (!this.dirty || !this.robot || !this.body) return;
    this.dirty = false;
    const ratio = window.devicePixelRatio || 1;
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    if (!width || !height) return;
    if (this.canvas.width !== Math.round(width * ratio) || this.canvas.height !== Math.round(height * ratio)) {
      this.canvas.width = Math.round(width * ratio);
      this.canvas.height = Math.round(height * ratio);
    }
    const ink = this.canvas.getContext("2d");
    ink.setTransform(ratio, 0, 0, ratio, 0, 0);
    ink.clearRect(0, 0, width, height);
    this.fit(width, height);
    this.camera = this.axes();
    const touched = new Set(this.body.contacts.flatMap((one) => [one.first, one.second]));
    const volumes = [];
    for (const shape of this.robot.shapes) {
      if (shape.field && !(this.fields || touched.has(shape.name))) continue;
      const points = this.points(shape, (p) => this.moved(shape.link, p)).map((p) => this.project(p));
      const color = shape.field ? (touched.has(shape.name) ? "rgba(255,70,60,0.28)" : "rgba(90,200,220,0.10)") : null;
      volumes.push({ shape, points, depth: mean(points.map((p) => p[2])) - (shape.field ? 0.5 : 0), color });
    }
    for (const thing of this.objects) {
      const points = this.points(thing, (p) => p).map((p) => this.project(p));
      const alpha = thing.kind === "box" ? 0.22 : 1;
      const depth = thing.kind === "box" ? Math.max(...points.map((p) => p[2])) + 5 : mean(points.map((p) => p[2]));
      volumes.push({ shape: thing, points, depth, color: `rgba(${thing.color},${alpha})` });
    }
    volumes.sort((one, other) => other.depth - one.depth);
    const depths = volumes.filter((one) => !one.color).map((one) => one.depth);
    const [far, near] = [Math.max(...depths), Math.min(...depths)];
    for (const one of volumes) this.volume(ink, one, one.color || this.solid(one.shape, (far - one.depth) / (far - near || 1)));
    this.spots = [];
    for (const [part, where] of Object.entries(this.places)) if (!this.chosen || this.chosen === part) this.drawPlaces(ink, part, where);
    if (this.path.points) drawPath(ink, this.path.points.map((p) => this.project(p)), this.path.share, 1);
    this.drawPicked(ink);
    const box = this.canvas.getBoundingClientRect();
    const targets = this.objects.filter((thing) => thing.role === "target");
    const where = targets.map((thing) => [thing.name, this.project(thing.position).slice(0, 2)]);
    this.canvas.dataset.targets = JSON.stringify(Object.fromEntries(where.map(([name, [x, y]]) => [name, [x + box.left, y + box.top]])));
  }

  solid(shape, nearness) {
    const part = this.robot.parts[shape.part];
    const base = part && (part.name in this.places || !Object.keys(this.places).length) ? part.color : [150, 160, 176];
    const light = 0.42 + 0.34 * nearness;
    const [r, g, b] = base.map((channel) => Math.round(light * (0.35 * channel + 0.65 * 170)));
    return `rgb(${r},${g},${b})`;
  }

  volume(ink, { shape, points }, color) {
    ink.lineCap = shape.kind === "cylinder" ? "butt" : "round";
    ink.fillStyle = ink.strokeStyle = color;
    const see = color.startsWith("rgba") && !color.endsWith(",1)");
    if (shape.kind === "sphere") {
      circle(ink, points[0], Math.max(2, this.frame.scale * shape.size[0]));
      ink.fill();
      if (!see) outline(ink);
    } else if (shape.kind === "capsule" || shape.kind === "cylinder") {
      const width = 2 * this.frame.scale * shape.size[0];
      for (const [grow, style] of see ? [[0, color]] : [[1.6, "rgba(8,11,15,0.8)"], [0, color]]) {
        ink.strokeStyle = style;
        ink.lineWidth = width + grow;
        ink.beginPath();
        ink.moveTo(points[0][0], points[0][1]);
        ink.lineTo(points[1][0] + 0.01, points[1][1]);
        ink.stroke();
      }
    } else if (points.length > 2) {
      const hull = outlineOf(points);
      ink.beginPath();
      hull.forEach(([x, y], i) => (i ? ink.lineTo(x, y) : ink.moveTo(x, y)));
      ink.closePath();
      ink.fill();
      if (!see) outline(ink);
    }
  }

  drawPlaces(ink, part, where) {
    const left = this.left[part];
    const hue = this.robot.parts.find((one) => one.name === part).color;
    const points = where.points.map((p) => this.project(this.moved(where.link, p)));
    const order = points.map((p, i) => i).sort((i, j) => (left ? left.left[i] - left.left[j] : 0));
    for (const state of order) {
      const share = left ? left.left[state] : 1;
      const [x, y] = points[state];
      if (share > 0.3) {
        ink.fillStyle = `rgba(${hue},${0.13 * share})`;
        circle(ink, [x, y], 3 + 5 * share);
        ink.fill();
      }
      ink.fillStyle = `rgb(${hue.map((channel, k) => Math.round(DARK[k] + share * (channel - DARK[k])))})`;
      circle(ink, [x, y], 1.6 + 2 * share);
      ink.fill();
      ink.lineWidth = 0.7;
      ink.strokeStyle = `rgba(${hue},${0.25 + 0.3 * share})`;
      ink.stroke();
      this.spots.push({ part, state, x, y, place: this.moved(where.link, where.points[state]) });
    }
    if (!left || !points[left.here]) return;
    const way = [left.here, ...left.path].map((state) => points[state]).filter(Boolean);
    if (way.length > 1) {
      ink.lineWidth = 2.2;
      ink.strokeStyle = "#ffffff";
      line(ink, way.slice(0, 2));
      arrow(ink, way[0], way[1]);
      ink.setLineDash([3, 4]);
      ink.lineWidth = 1.4;
      ink.strokeStyle = `rgb(${hue})`;
      line(ink, way.slice(1));
      ink.setLineDash([]);
      const end = way[way.length - 1];
      ink.lineWidth = 1.6;
      circle(ink, end, 8);
      ink.stroke();
    }
    ink.lineWidth = 2;
    ink.strokeStyle = "#ffffff";
    circle(ink, way[0], 6);
    ink.stroke();
  }

  drawPicked(ink) {
    if (!this.place) return;
    const [x, y] = this.project(this.place);
    ink.strokeStyle = "#ffca61";
    ink.lineWidth = 2;
    for (const [dx, dy] of [[9, 0], [-9, 0], [0, 9], [0, -9]]) line(ink, [[x + dx / 2, y + dy / 2], [x + 1.6 * dx, y + 1.6 * dy]]);
    circle(ink, [x, y], 7);
    ink.stroke();
  }

  listen() {
    const at = (event) => {
      const box = this.canvas.getBoundingClientRect();
      return [event.clientX - box.left, event.clientY - box.top];
    };
    let start = null;
    this.canvas.addEventListener("pointerdown", (event) => {
      if (!this.frame) return;
      const [x, y] = at(event);
      start = { x, y, view: [...this.view], moved: false };
      const thing = this.thingAt(x, y);
      if (thing) this.dragging = { thing, from: [...thing.position] };
      this.canvas.setPointerCapture(event.pointerId);
    });
    this.canvas.addEventListener("pointermove", (event) => {
      if (!this.frame) return;
      const [x, y] = at(event);
      if (!start) return this.explain(x, y);
      start.moved ||= Math.hypot(x - start.x, y - start.y) > 4;
      if (!start.moved) return;
      if (this.dragging) this.dragging.thing.position = this.unproject(x, y, this.dragging.from);
      else this.view = [start.view[0] + (x - start.x) * 0.5, Math.min(89, Math.max(-20, start.view[1] + (y - start.y) * 0.4))];
      this.touch();
    });
    this.canvas.addEventListener("pointerup", (event) => {
      if (!start) return;
      const [x, y] = at(event);
      const { moved } = start;
      start = null;
      if (this.dragging) {
        const { thing } = this.dragging;
        this.dragging = null;
        if (moved) this.dropped(thing.name, thing.position);
        else this.picked(null, thing.name);
      } else if (!moved) {
        const spot = this.spotAt(x, y);
        this.place = spot ? spot.place : this.unproject(x, y, this.handPlace());
        this.picked(this.place, null);
      }
      this.touch();
    });
    this.canvas.addEventListener("pointerleave", () => (this.tip.hidden = true));
  }

  handPlace() {
    const [, where] = Object.entries(this.places).find(([part]) => part === this.chosen) || Object.entries(this.places)[0] || [];
    const left = where && this.left[this.chosen || Object.keys(this.places)[0]];
    if (where && left) return this.moved(where.link, where.points[left.here]);
    const target = this.objects.find((thing) => thing.role === "target");
    return target ? target.position : [-0.3, 0, 0.1];
  }

  thingAt(x, y) {
    return this.objects.find((thing) => {
      if (thing.role !== "target") return false;
      const [px, py] = this.project(thing.position);
      return Math.hypot(px - x, py - y) < Math.max(NEAR, this.frame.scale * thing.size[0] + 4);
    });
  }

  spotAt(x, y) {
    let best = null;
    for (const spot of this.spots) {
      const away = Math.hypot(spot.x - x, spot.y - y);
      if (away < NEAR && (!best || away < best.away)) best = { ...spot, away };
    }
    return best;
  }

  explain(x, y) {
    const thing = this.thingAt(x, y);
    const spot = this.spotAt(x, y);
    let text = "";
    if (thing) text = `${thing.name}: drag it, and the nearest hand reaches for it`;
    else if (spot && this.left[spot.part]) {
      const left = this.left[spot.part];
      const tried = left.actions[spot.state] - left.untried[spot.state];
      text = `State ${spot.state} of the ${title(spot.part)}: ${tried} of ${left.actions[spot.state]} actions tried from here, ${Math.round(100 * left.left[spot.state])} % of the first information gain left. Click, then H: the hand reaches here.`;
    }
    this.tip.hidden = !text;
    if (!text) return;
    this.tip.textContent = text;
    this.tip.style.left = `${Math.min(x + 14, this.canvas.clientWidth - 270)}px`;
    this.tip.style.top = `${Math.max(4, y - 50)}px`;
  }
}

function circle(ink, [x, y], radius) {
  ink.beginPath();
  ink.arc(x, y, radius, 0, 2 * Math.PI);
}

function outline(ink) {
  ink.lineWidth = 0.8;
  ink.strokeStyle = "rgba(8,11,15,0.8)";
  ink.stroke();
}

function line(ink, points) {
  ink.beginPath();
  points.forEach(([x, y], i) => (i ? ink.lineTo(x, y) : ink.moveTo(x, y)));
  ink.stroke();
}

function arrow(ink, [x0, y0], [x1, y1]) {
  const angle = Math.atan2(y1 - y0, x1 - x0);
  if (Math.hypot(x1 - x0, y1 - y0) < 6) return;
  line(ink, [[x1 - 9 * Math.cos(angle - 0.45), y1 - 9 * Math.sin(angle - 0.45)], [x1, y1], [x1 - 9 * Math.cos(angle + 0.45), y1 - 9 * Math.sin(angle + 0.45)]]);
}
