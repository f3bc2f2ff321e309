// SPDX-License-Identifier: Apache-2.0
// The page: asks the monitor for news and shows them; the parts of the page are made here.
import { BodyPicture } from "./body.js";
import { me, say, send } from "./calls.js";
import { Keys } from "./keys.js";
import { MovePanel } from "./move.js";
import { bannerOf, wordOf } from "./status.js";
import { Story } from "./story.js";
import { View } from "./view.js";

const RETRY = 1000; // ms until a monitor that did not answer is asked again
const HIDDEN_PERIOD = 250; // ms between two requests of a page that nobody sees

const $ = (id) => document.getElementById(id);

// What the page knows.  `path`: of a roadmap.  `place`: the one that was picked.  `pace`: largest speed in lockstep, 0: as fast as it can.
const state = { robot: null, status: {}, control: {}, cards: [], curves: {}, baselines: {}, path: {}, connected: false, past: false, pace: 0, place: null };

const picture = new BodyPicture($("body"), {
  tip: $("tip"),
  legend: $("legend"),
  changed: () => redraw(),
  dropped: async (name, place) => {
    if (await send("place", { name, position: place })) send("reach", { object: name });
  },
  picked: (place, name) => {
    state.place = place ? { position: place } : { object: name };
    say(place ? "A place is picked: H lets the nearest hand reach for it." : `The ${name} is picked: H lets the nearest hand reach for it; or drag it.`);
  },
});
const view = new View({ frame: $("viewer"), canvas: $("scene"), legend: $("view-legend"), note: $("loading"), button: $("other-view"), pressed: (key) => keys.press(key) });
const move = new MovePanel($("move"), { send, state, press: (key) => keys.press(key) });
const story = new Story({ state, picture, chosen: (part) => part && move.choose(part) });
const keys = new Keys({ state, picture, view, move, story, tab, look });

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
      await new Promise((resolve) => setTimeout(resolve, RETRY));
    }
  }
}

const nextFrame = () => new Promise((resolve) => (document.hidden ? setTimeout(resolve, HIDDEN_PERIOD) : requestAnimationFrame(resolve)));

const shows = {
  robot(robot) {
    const restarted = state.robot && state.robot.monitor !== robot.monitor;
    state.robot = picture.robot = robot;
    document.title = `MoBeE: ${robot.name}`;
    $("title").textContent = `MoBeE: ${robot.name}`;
    picture.look("oblique");
    move.build(robot);
    story.showLegends();
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
    story.showLegends();
    view.scene.paint(Object.fromEntries(Object.keys(places).map((part) => [part, story.colorOf(part)])));
    isFramed = false;
  },
  left(left) {
    picture.left = left;
    picture.touch();
  },
  path(path) {
    const isNew = Boolean(path.now) !== Boolean(state.path.now);
    state.path = picture.path = path;
    picture.touch();
    story.showCards();
    if (isNew) story.showLegends();
  },
  cards(cards) {
    state.cards = cards;
    story.showCards();
    move.update();
  },
  curves(curves) {
    state.curves = curves;
    story.showCurves();
  },
  baselines(baselines) {
    state.baselines = baselines;
    story.showCurves();
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
  $("pause").firstChild.textContent = state.status.mode === "paused" ? "Resume " : "Pause ";
  for (const button of document.querySelectorAll("[data-do=stop], [data-do=pause]")) button.hidden = state.past;
  if (!state.cards.length) story.showCards();
  arrange();
}

// Without agents there is nothing to know: the page begins with what a person can do.
let isArranged = false;
function arrange() {
  const agents = state.status.agents?.length || Object.keys(state.curves).length;
  const runs = (service) => state.status.services?.includes(service);
  $("wonders-title").textContent = agents ? "What it wonders about" : "The robot";
  document.querySelector("[data-do=tab-knows]").hidden = !agents;
  document.querySelector("[data-do=tab-move]").hidden = state.past || !runs("controller");
  if (isArranged || !state.robot || !(runs("controller") || runs("port_filter"))) return;
  isArranged = true;
  if (!agents && !state.past) tab(runs("controller") ? "move" : "events");
}

function tab(name) {
  for (const one of ["knows", "move", "events"]) {
    $(one).hidden = one !== name;
    document.querySelector(`[data-do=tab-${one}]`).setAttribute("aria-selected", String(one === name));
  }
  if (name === "knows") story.showCurves();
}

// ---- the pictures

function look(name) {
  picture.look(name);
  view.scene.turn(name);
  isFramed = false;
  redraw();
}

// What the agents' hands do now, for the 3D view: where each is, and where its action leads.
function marks() {
  const found = [];
  for (const [part, where] of Object.entries(picture.places)) {
    const left = picture.left[part];
    if (!left || (picture.chosen && picture.chosen !== part)) continue;
    const at = (index) => (where.points[index] ? picture.moved(where.link, where.points[index]) : null);
    found.push({ part, color: story.colorOf(part), hand: where.tip ? picture.moved(where.tip.link, where.tip.point) : null, to: left.path.length ? at(left.path[0]) : null });
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
    if (!$("scene").hidden) view.scene.draw({ body: picture.body, objects: picture.objects, marks: marks(), fields: picture.fields, path: picture.path });
    drawn = picture.body.t;
  });
}

const watch = new ResizeObserver(() => {
  picture.refit();
  story.showCurves();
});
watch.observe($("body"));
watch.observe($("knows"));
keys.listen();
follow();
