// SPDX-License-Identifier: Apache-2.0
// The keys of the page; every button stands for one of them.
import { key, say, send } from "./calls.js";
import { node } from "./cards.js";

const MEANINGS = [
  ["tried", "share of the agent's actions that it tried at least once; an action goes from one state, a pose, to a neighbouring one"],
  ["predictable", "share of its actions that were tried at least twice and ended alike in at least 80 % of the tries"],
  ["n × random", "actions tried, over those that random exploration would have tried after as many transitions"],
  ["surprise", "−ln p of what happened, in nats; p: the probability that the agent gave to it before. 0.69 nats: one half"],
  ["learned", "information gain, in nats: how much the outcome changed the agent's model (Kullback-Leibler divergence)"],
  ["left to learn", "mean of the last information gains of a state's actions, over the largest one that this agent ever had"],
  ["s behind", "how much later the page shows the body than the robot moved it, in seconds of the robot's time"],
];
const QUICK_EXPLORERS = ["curious", "least_tried", "random"];
const TWICE = 2500; // ms between two presses of the key that starts the simulation again
const SEEK_PERIOD = 80; // ms
const SPEEDS = { first: 4, least: 0.25, most: 64 }; // times real time, in lockstep

export class Keys {
  // `tab`: shows a tab by its name.  `look`: shows the body from a side.
  constructor({ state, picture, view, move, story, tab, look }) {
    Object.assign(this, { state, picture, view, move, story });
    this.resets = 0;
    this.seeking = 0;
    this.actions = {
      " ": ["pause", "stop the robot's time, or resume it", () => this.pause()],
      s: ["stop", "EMERGENCY STOP: all motors, at once", () => send("stop")],
      r: ["release", "release the emergency stop", () => send("release")],
      c: ["control", "take the controls from another page", () => send("control")],
      m: ["tab-move", "move a part: sliders, take over (T), give back (G)", () => tab("move")],
      t: ["take", "take the chosen part over from its agent", () => move.take()],
      g: ["give", "give the chosen part back", () => move.give()],
      x: ["explorer", "change how the agents explore: curious, least tried, random", () => this.nextExplorer()],
      n: ["next", "choose the next part", () => move.next()],
      h: ["reach", "let the nearest hand reach for the place or ball that was clicked", () => this.reach()],
      b: ["ball", "let the nearest hand reach for the ball (the first target in the world)", () => move.reachTarget(picture.objects)],
      f: ["fields", "show or hide the fields around the body", () => this.toggleFields()],
      "1": ["view-oblique", "see the body from the front, left and above (drag turns it)", () => look("oblique")],
      "2": ["view-front", "see it from the front", () => look("front")],
      "3": ["view-top", "see it from above", () => look("top")],
      "4": ["view-side", "see it from the side", () => look("side")],
      p: ["part", "show the places of one agent after the other, then of all", () => story.chooseNext()],
      k: ["tab-knows", "what the agents know, as curves", () => tab("knows")],
      e: ["tab-events", "the events", () => tab("events")],
      "+": ["faster", "lockstep: double the largest speed", () => this.pace(2)],
      "-": ["slower", "lockstep: halve the largest speed", () => this.pace(0.5)],
      "0": ["reset", "start the simulation again at home (press twice)", () => this.reset()],
      v: ["viewer", "change between the light 3D view and Rerun's, which has plots, eyes and events too", () => view.toggle()],
      "?": ["help", "list these keys, and what the numbers mean", () => this.help()],
    };
    this.byName = Object.fromEntries(Object.values(this.actions).map(([name, , act]) => [name, act]));
    this.byName.play = () => fetch("seek?toggle=1");
  }

  // Do what a key stands for; returns whether there is something.
  press(pressed) {
    const found = document.getElementById("help").open ? null : this.actions[pressed.length === 1 ? pressed.toLowerCase() : pressed];
    found?.[2]();
    return Boolean(found);
  }

  listen() {
    addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey || (event.target.tagName === "INPUT" && event.key !== "s")) return;
      if (event.target.tagName === "BUTTON" && event.key === " ") return;
      if (this.press(event.key)) event.preventDefault();
    });
    document.addEventListener("click", (event) => {
      const name = event.target.closest?.("[data-do]")?.dataset.do;
      if (!name) return;
      this.byName[name]?.();
      event.target.blur?.();
    });
    const slider = document.getElementById("seek");
    slider.addEventListener("input", () => {
      clearTimeout(this.seeking);
      this.seeking = setTimeout(() => fetch(`seek?at=${slider.value}`), SEEK_PERIOD);
    });
  }

  pause() {
    if (this.state.past) return fetch("seek?toggle=1");
    return send(this.state.status.mode === "paused" ? "resume" : "pause");
  }

  reach() {
    if (!this.state.place) return say("Click a place in the picture of the body first.", true);
    return send("reach", this.state.place);
  }

  toggleFields() {
    this.picture.fields = !this.picture.fields;
    this.picture.touch();
    this.story.showLegends();
    if (key && !this.state.past) send("fields", { shown: this.picture.fields });
  }

  // The explorer after the one by which the shown agent, or the first, chooses now.
  nextExplorer() {
    const part = this.picture.chosen || "";
    const now = this.state.cards.find((one) => !part || one.part === part)?.explorer;
    send("explore", { part, explorer: QUICK_EXPLORERS[(QUICK_EXPLORERS.indexOf(now) + 1) % QUICK_EXPLORERS.length] });
  }

  pace(factor) {
    if (!this.state.robot?.lockstep) return say("The robot runs in real time; a speed can be set in lockstep only.", true);
    this.state.pace = Math.min(SPEEDS.most, Math.max(SPEEDS.least, (this.state.pace || SPEEDS.first) * factor));
    return send("pace", { speed: this.state.pace });
  }

  reset() {
    if (performance.now() - this.resets < TWICE) return send("reset");
    this.resets = performance.now();
    return say("Press 0 again to start the simulation anew.");
  }

  help() {
    const name = (pressed) => node("kbd", "", pressed === " " ? "space" : pressed.toUpperCase());
    const rows = Object.entries(this.actions).map(([pressed, [, text]]) => node("tr", "", node("td", "", name(pressed)), node("td", "", text)));
    const close = node("button", "", "Close (Esc)");
    const dialog = document.getElementById("help");
    close.addEventListener("click", () => dialog.close());
    const note = key || this.state.past ? "" : "This page can only show: it was opened without the key that the launcher prints in its address.";
    const words = MEANINGS.map(([word, text]) => node("tr", "", node("td", "", node("b", "", word)), node("td", "", text)));
    const tables = [node("p", "", note), node("table", "", ...rows), node("h2", "", "Numbers"), node("table", "", ...words)];
    dialog.replaceChildren(close, node("h2", "", "Keys"), ...tables);
    dialog.showModal();
  }
}
