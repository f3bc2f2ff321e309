// SPDX-License-Identifier: Apache-2.0
// The page: asks the monitor for news, shows them, and sends what a person asks for.
import { BodyPicture } from "./body.js";
import { card, node, title, waiting } from "./cards.js";
import { drawCurves, drawSurprise } from "./curves.js";
import { placesLegend, viewLegend } from "./legend.js";
import { MovePanel } from "./move.js";
import { bannerOf, withoutAgents, wordOf } from "./status.js";
import { View } from "./view.js";

const $ = (id) => document.getElementById(id);
const key = new URLSearchParams(location.search).get("key") || "";
const me = sessionStorage.getItem("page") || Math.random().toString(36).slice(2, 12);
sessionStorage.setItem("page", me);

const state = { robot: null, status: {}, control: {}, cards: [], curves: {}, baselines: {}, connected: false, past: false, pace: 0, place: null };
const colorOf = (part) => state.robot?.parts.find((one) => one.name === part)?.color || [152, 165, 179];

const picture = new BodyPicture($("body"), $("tip"), {
  changed: () => redraw(),
  dropped: async (name, place) => {
    if (await send("place", { name, position: place })) send("reach", { object: name });
  },
  picked: (place, name) => {
    state.place = place ? { position: place } : { object: name };
    say(place ? "A place is picked: H lets the nearest hand reach for it." : `The ${name} is picked: H lets the nearest hand reach for it; or drag it.`);
  },
});
const view = new View({ frame: $("viewer"), canvas: $("scene"), legend: $("view-legend"), note: $("loading"), button: $("other-view"), pressed: (key) => press(key) });
const move = new MovePanel($("move"), { send, state, press: (key) => press(key) });

// ---- calls

async function send(verb, given = {}) {
  let answer;
  try {
    const reply = await fetch("do", {
      method: "POST",
      headers: { "Content-Type": "application/json", "X-Key": key },
      body: JSON.stringify({ page: me, verb, arguments: given }),
    });
    answer = await reply.json();
  } catch {
    answer = { ok: false, text: "The monitor does not answer: the system has ended, or the connection is lost." };
  }
  say(answer.text, !answer.ok);
  return answer.ok;
}

let silence = 0;
function say(text, bad = false) {
  $("said").textContent = text;
  $("said").className = bad ? "bad" : "";
  $("said").hidden = false;
  clearTimeout(silence);
  silence = setTimeout(() => ($("said").hidden = true), bad ? 9000 : 4000);
}

// ---- news

async function follow() {
  let after = 0;
  for (;;) {
    try {
      const late = `${drawn === null ? "" : `&body=${drawn}`}${view.rerunTime === null || state.past ? "" : `&viewer=${view.rerunTime}`}`;
      const answer = await fetch(`news?after=${after}&page=${me}${late}`);
      if (!answer.ok) throw new Error(answer.statusText);
      const news = await answer.json();
      state.connected = true;
      after = news.version;
      show(news);
      await nextFrame(); // in which the news are drawn
      await nextFrame(); // the one before has been made
    } catch (error) {
      console.debug(error);
      state.connected = false;
      after = 0;
      showState();
      await new Promise((resolve) => setTimeout(resolve, 1000));
    }
  }
}

const nextFrame = () => new Promise((resolve) => (document.hidden ? setTimeout(resolve, 250) : requestAnimationFrame(resolve)));

const shows = {
  robot(robot) {
    const restarted = state.robot && state.robot.monitor !== robot.monitor;
    state.robot = picture.robot = robot;
    document.title = `MoBeE: ${robot.name}`;
    $("title").textContent = `MoBeE: ${robot.name}`;
    picture.look("oblique");
    move.build(robot);
    showLegend();
    view.open(robot);
    isFramed = false;
    if (restarted) view.reload();
  },
  status(status) {
    state.status = status;
    showState();
  },
  control(control) {
    state.control = control;
    const mine = control.holder === me;
    $("holder").textContent = control.pages > 1 ? `${control.pages} pages open; ${mine ? "this one" : control.holder ? "another one" : "none"} holds the controls` : "";
    move.update();
  },
  body(body) {
    picture.body = body;
    picture.touch();
    move.follow(body.q);
  },
  objects(objects) {
    if (!picture.dragging) picture.objects = objects;
    picture.touch();
    move.update();
  },
  places(places) {
    picture.places = places;
    picture.touch();
    showLegend();
    view.scene.paint(Object.fromEntries(Object.keys(places).map((part) => [part, colorOf(part)])));
    isFramed = false;
  },
  left(left) {
    picture.left = left;
    picture.touch();
  },
  cards(cards) {
    state.cards = cards;
    showCards();
    move.update();
  },
  curves(curves) {
    state.curves = curves;
    showCurves();
  },
  baselines(baselines) {
    state.baselines = baselines;
    showCurves();
  },
  events(events) {
    $("events").replaceChildren(
      ...[...events].reverse().map((one) => {
        const row = document.createElement("p");
        row.className = one.level;
        const when = document.createElement("time");
        when.textContent = `${one.t.toFixed(1)} s`;
        row.append(when, `${one.who}: ${one.text}`);
        return row;
      }),
    );
  },
  late(late) {
    const parts = [];
    if (late.body !== undefined) parts.push(`body ${late.body.toFixed(1)} s behind`);
    if (late.viewer !== undefined) parts.push(`3D ${late.viewer.toFixed(1)} s behind`);
    if (!state.past) $("late").textContent = parts.join(", ");
  },
  player(player) {
    state.past = true;
    $("timeline").hidden = false;
    $("seek").max = player.length;
    if (document.activeElement !== $("seek")) $("seek").value = player.at;
    $("when").textContent = `${player.at.toFixed(0)} of ${player.length.toFixed(0)} s`;
    $("play").textContent = player.plays ? "Pause" : "Play";
    showState();
  },
};

function show(news) {
  if (news.robot) shows.robot(news.robot); // before all that refers to its parts
  for (const name of Object.keys(news)) if (name in shows && name !== "robot") shows[name](news[name]);
}

// ---- the state of the system

function showState() {
  const said = bannerOf(state);
  $("banner").hidden = !said;
  if (said) {
    $("banner").className = said.level;
    $("banner").children[0].textContent = said.title;
    $("banner").children[1].textContent = said.text;
    $("banner").children[2].textContent = said.todo;
  }
  const [word, kind] = wordOf(said, state.past);
  $("state").textContent = word;
  $("state").className = `pill ${kind}`;
  if (state.status.time !== undefined) $("clock").textContent = `${state.status.time.toFixed(0)} s`;
  $("pause").firstChild.textContent = state.status.mode === "paused" ? "Go on " : "Pause ";
  for (const button of document.querySelectorAll("[data-do=stop], [data-do=pause], [data-do=tab-move]")) button.hidden = state.past;
  if (!state.cards.length) showCards();
  arrange();
}

// ---- the story

function showCards() {
  const known = new Set(state.cards.map((card) => title(card.part)));
  const silent = (state.status.agents || []).filter((name) => !known.has(name));
  const cards = state.cards.map(keptCard);
  for (const name of silent) cards.push(waiting(name, "Its agent is up. Waiting for its first decision."));
  if (!cards.length) cards.push(waiting("No agent moves this robot", withoutAgents(state)));
  $("cards").replaceChildren(...cards);
  for (const one of state.cards) {
    const { made, text, plotted } = kept.get(one.part);
    if (plotted === text) continue;
    drawSurprise(made.querySelector("canvas"), one.recent, colorOf(one.part));
    kept.get(one.part).plotted = text;
  }
}

const kept = new Map(); // cards by part, with what they were made from: one that has not changed is not made again
function keptCard(one) {
  const text = JSON.stringify([one, picture.chosen === one.part, state.control.taken]);
  if (kept.get(one.part)?.text !== text) {
    const isChosen = picture.chosen === one.part;
    const isTaken = Boolean(state.control.taken?.includes(one.part));
    const click = () => choose(picture.chosen === one.part ? null : one.part);
    kept.set(one.part, { made: card(one, { color: colorOf(one.part), isChosen, isTaken, isPast: state.past, click }), text });
  }
  return kept.get(one.part).made;
}

// Without agents there is nothing to know: the page begins with what a person can do.
let isArranged = false;
function arrange() {
  const agents = state.status.agents?.length || Object.keys(state.curves).length;
  $("wonders-title").textContent = agents ? "What it wonders about" : "The robot";
  const runs = (service) => state.status.services?.includes(service);
  if (isArranged || !state.robot || !(runs("controller") || runs("port_filter"))) return;
  isArranged = true;
  if (!agents && !state.past) tab(runs("controller") ? "move" : "events");
}

function choose(part) {
  picture.chosen = part;
  picture.touch();
  $("wonders-of").textContent = part ? title(part) : "";
  if (part) move.choose(part);
  showCards();
}

function chooseNext() {
  const names = [null, ...state.cards.map((one) => one.part)];
  choose(names[(names.indexOf(picture.chosen) + 1) % names.length]);
}

function showLegend() {
  $("view-legend").replaceChildren(...viewLegend(state.robot, Object.keys(picture.places).length > 0));
  $("legend").replaceChildren(...placesLegend(picture.places, colorOf));
}

function showCurves() {
  if ($("knows").hidden) return;
  const parts = state.cards.map((one) => one.part).filter((part) => part in state.curves);
  const curves = Object.fromEntries(parts.map((part) => [part, state.curves[part]]));
  const colors = Object.fromEntries(parts.map((part) => [part, colorOf(part)]));
  const titles = Object.fromEntries(parts.map((part) => [part, title(part)]));
  drawCurves($("curves"), curves, state.baselines, colors, titles, "The curve begins when an agent has ended its first action.");
}

// ---- keys and buttons

const QUICK_EXPLORERS = ["curious", "least_tried", "random"];
let resets = 0;
let seeking = 0;
function seek(at) {
  clearTimeout(seeking);
  seeking = setTimeout(() => fetch(`seek?at=${at}`), 80);
}

const actions = {
  " ": ["pause", "stop the robot's time, or let it go on", () => (state.past ? fetch("seek?toggle=1") : send(state.status.mode === "paused" ? "resume" : "pause"))],
  s: ["stop", "EMERGENCY STOP: all motors, at once", () => send("stop")],
  r: ["release", "release the emergency stop", () => send("release")],
  c: ["control", "take the controls from another page", () => send("control")],
  m: ["tab-move", "move a part: sliders, take over (T), give back (G)", () => tab("move")],
  t: ["take", "take the chosen part over from its agent", () => move.take()],
  g: ["give", "give the chosen part back", () => move.give()],
  x: ["explorer", "change how the agents explore: curious, least tried, random", () => nextExplorer()],
  n: ["next", "choose the next part", () => move.next()],
  h: ["reach", "let the nearest hand reach for the place or ball that was clicked", () => (state.place ? send("reach", state.place) : say("Click a place in the picture of the body first.", true))],
  b: ["ball", "let the nearest hand reach for the ball (the first target in the world)", () => move.reachTarget(picture.objects)],
  f: ["fields", "show or hide the fields around the body", () => toggleFields()],
  "1": ["view-oblique", "see the body from the front, left and above (drag turns it)", () => look("oblique")],
  "2": ["view-front", "see it from the front", () => look("front")],
  "3": ["view-top", "see it from above", () => look("top")],
  "4": ["view-side", "see it from the side", () => look("side")],
  p: ["part", "show the places of one agent after the other, then of all", () => chooseNext()],
  k: ["tab-knows", "what the agents know, as curves", () => tab("knows")],
  e: ["tab-events", "the events", () => tab("events")],
  "+": ["faster", "lockstep: double the largest speed", () => pace(2)],
  "-": ["slower", "lockstep: halve the largest speed", () => pace(0.5)],
  "0": ["reset", "start the simulation again at home (press twice)", () => resetTwice()],
  v: ["viewer", "change between the light 3D view and Rerun's, which has plots, eyes and events too", () => view.toggle()],
  "?": ["help", "list these keys", () => help()],
};
const byName = { ...Object.fromEntries(Object.values(actions).map(([name, , act]) => [name, act])), play: () => fetch("seek?toggle=1") };

function look(name) {
  picture.look(name);
  view.scene.turn(name);
  isFramed = false;
  redraw();
}

function toggleFields() {
  picture.fields = !picture.fields;
  picture.touch();
  if (key && !state.past) send("fields", { shown: picture.fields });
}

// The explorer after the one by which the shown agent, or the first, chooses now.
function nextExplorer() {
  const part = picture.chosen || "";
  const now = state.cards.find((one) => !part || one.part === part)?.explorer;
  send("explore", { part, explorer: QUICK_EXPLORERS[(QUICK_EXPLORERS.indexOf(now) + 1) % QUICK_EXPLORERS.length] });
}

function pace(factor) {
  if (!state.robot?.lockstep) return say("The robot runs in real time; a speed can be set in lockstep only.", true);
  state.pace = Math.min(64, Math.max(0.25, (state.pace || 4) * factor));
  send("pace", { speed: state.pace });
}

function resetTwice() {
  if (performance.now() - resets < 2500) return send("reset");
  resets = performance.now();
  say("Press 0 again to start the simulation anew.");
}

function tab(name) {
  for (const one of ["knows", "move", "events"]) {
    $(one).hidden = one !== name;
    document.querySelector(`[data-do=tab-${one}]`).setAttribute("aria-selected", String(one === name));
  }
  if (name === "knows") showCurves();
}

function help() {
  const rows = Object.entries(actions).map(([press, [, text]]) => node("tr", "", node("td", "", node("kbd", "", press === " " ? "space" : press.toUpperCase())), node("td", "", text)));
  const close = node("button", "", "Close (Esc)");
  close.addEventListener("click", () => $("help").close());
  const note = key || state.past ? "" : "This page can only show: it was opened without the key that the launcher prints in its address.";
  $("help").replaceChildren(node("h2", "", "Keys"), node("p", "", note), node("table", "", ...rows), close);
  $("help").showModal();
}

// Do what a key stands for; returns whether there is something.
function press(key) {
  const found = $("help").open ? null : actions[key.length === 1 ? key.toLowerCase() : key];
  found?.[2]();
  return Boolean(found);
}

addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || (event.target.tagName === "INPUT" && event.key !== "s")) return;
  if (event.target.tagName === "BUTTON" && event.key === " ") return;
  if (press(event.key)) event.preventDefault();
});
document.addEventListener("click", (event) => {
  const name = event.target.closest?.("[data-do]")?.dataset.do;
  if (name) {
    byName[name]?.();
    event.target.blur?.();
  }
});
$("seek").addEventListener("input", () => seek($("seek").value));
const watch = new ResizeObserver(() => {
  picture.refit();
  showCurves();
});
watch.observe($("body"));
watch.observe($("knows"));

// What the agents' hands do now, for the 3D view: where each is, and where its action leads.
function marks() {
  const found = [];
  for (const [part, where] of Object.entries(picture.places)) {
    const left = picture.left[part];
    if (!left || (picture.chosen && picture.chosen !== part)) continue;
    const at = (index) => (where.points[index] ? picture.moved(where.link, where.points[index]) : null);
    found.push({ part, color: colorOf(part), hand: where.tip ? picture.moved(where.tip.link, where.tip.point) : null, to: left.path.length ? at(left.path[0]) : null });
  }
  return found;
}

let drawn = null; // s of robot time of the newest body that was drawn
let isDue = false;
let isFramed = false; // the 3D view sees the whole robot and all places
function redraw() {
  if (isDue) return;
  isDue = true;
  requestAnimationFrame(() => {
    isDue = false;
    picture.draw();
    if (!picture.body || !picture.robot) return;
    if (!isFramed) view.scene.fit(picture.extent());
    isFramed = true;
    if (!$("scene").hidden) view.scene.draw(picture.body, picture.objects, marks(), picture.fields);
    drawn = picture.body.t;
  });
}

follow();
