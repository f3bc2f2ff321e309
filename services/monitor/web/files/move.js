// SPDX-License-Identifier: Apache-2.0
// The panel with which a person takes a part over, and moves it by sliders.
import { title } from "./cards.js";
import { degrees } from "./geometry.js";

const SEND_PERIOD = 150; // ms between two goals while a slider moves

export class MovePanel {
  constructor(panel, { send, state, press }) {
    this.panel = panel;
    this.send = send;
    this.state = state;
    this.press = press; // (key): does what the key does
    this.part = null;
    this.sliders = [];
    this.sent = 0;
    this.timer = 0;
  }

  build(robot) {
    this.robot = robot;
    this.start = {};
    let at = 0;
    for (const part of robot.parts) {
      this.start[part.name] = at;
      at += part.motors.length;
    }
    this.choose(this.part || robot.parts.at(0)?.name);
  }

  choose(part) {
    if (!this.robot || !this.robot.parts.some((one) => one.name === part)) return;
    this.part = part;
    const found = this.robot.parts.find((one) => one.name === part);
    const parts = row(...this.robot.parts.map((one) => button(title(one.name), () => this.choose(one.name), one.name === part)));
    this.takes = button("Take over (T)", () => this.take());
    this.gives = button("Give back (G)", () => this.give());
    const reaches = button("Reach for the picked place (H)", () => (this.state.place ? this.send("reach", this.state.place) : this.send("reach", {})));
    const fields = button("Fields (F)", () => this.press("f"));
    const resets = button("Reset (0, twice)", () => this.press("0"));
    const release = button("Release the stop (R)", () => this.send("release"));
    const explorers = this.explorers();
    this.sliders = found.motors.map((motor) => this.slider(motor));
    const box = document.createElement("div");
    box.className = "sliders";
    box.append(...this.sliders.map((one) => one.label));
    this.panel.replaceChildren(parts, row(this.takes, this.gives, explorers, reaches, release, fields, resets), box);
    this.update();
  }

  // The choice of how the agent of the part explores.
  explorers() {
    const label = document.createElement("label");
    this.explorer = document.createElement("select");
    this.explorer.replaceChildren(...Object.entries(this.robot.explorers || {}).map(([name, words]) => new Option(words, name)));
    this.explorer.title = "How the agent of this part chooses its actions (X)";
    this.explorer.addEventListener("change", () => this.send("explore", { part: this.part, explorer: this.explorer.value }));
    label.append("explores (X)", this.explorer);
    this.explores = label;
    return label;
  }

  slider(motor) {
    const label = document.createElement("label");
    const name = document.createElement("span");
    const input = document.createElement("input");
    const output = document.createElement("output");
    name.textContent = motor.name;
    Object.assign(input, { type: "range", min: motor.low, max: motor.high, step: (motor.high - motor.low) / 200 });
    input.addEventListener("input", () => {
      output.textContent = amount(input.value, motor.slides);
      this.moved();
    });
    label.append(name, input, output);
    return { label, input, output, slides: motor.slides };
  }

  moved() {
    clearTimeout(this.timer);
    const wait = Math.max(0, SEND_PERIOD - (performance.now() - this.sent));
    this.timer = setTimeout(() => {
      this.sent = performance.now();
      this.send("goal", { part: this.part, q: this.sliders.map((one) => Number(one.input.value)) });
    }, wait);
  }

  isTaken() {
    return Boolean(this.state.control.taken?.includes(this.part));
  }

  update() {
    if (!this.takes) return;
    this.takes.disabled = this.isTaken();
    this.gives.disabled = !this.state.control.taken?.length;
    for (const one of this.sliders) one.input.disabled = !this.isTaken();
    const card = this.state.cards.find((one) => one.part === this.part);
    this.explores.hidden = !card?.explorer;
    if (card?.explorer && document.activeElement !== this.explorer) this.explorer.value = card.explorer;
  }

  // The sliders of a part that is not taken show where it is.
  follow(q) {
    if (!q || this.panel.hidden || !this.part) return;
    if (this.isTaken() && this.wasTaken) return;
    this.wasTaken = this.isTaken(); // once more, so that they begin where the part is
    this.sliders.forEach((one, i) => {
      one.input.value = q[this.start[this.part] + i];
      one.output.textContent = amount(one.input.value, one.slides);
    });
  }

  take() {
    return this.send("take", { part: this.part });
  }

  // Give the chosen part back, or, if it is not taken, one that is: a hand that reaches.
  give() {
    return this.send("give", { part: this.isTaken() ? this.part : this.state.control.taken?.[0] || this.part });
  }

  next() {
    const names = this.robot.parts.map((one) => one.name);
    this.choose(names[(names.indexOf(this.part) + 1) % names.length]);
  }

  reachTarget(objects) {
    const target = objects.find((one) => one.role === "target");
    return this.send("reach", { object: target ? target.name : "ball" });
  }
}

// A position of a motor: in m if it slides, else in rad.
const amount = (position, slides) => (slides ? `${Math.round(1000 * position)} mm` : `${Math.round(degrees(position))}°`);

function row(...content) {
  const made = document.createElement("div");
  made.className = "row";
  made.append(...content);
  return made;
}

function button(text, act, chosen = false) {
  const made = document.createElement("button");
  made.textContent = text;
  made.className = chosen ? "chosen" : "";
  made.addEventListener("click", act);
  return made;
}
