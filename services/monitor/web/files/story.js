// SPDX-License-Identifier: Apache-2.0
// The story: a card for each agent, the curves of what they know, and the legends.
import { card, playback, title, waiting } from "./cards.js";
import { drawCurves, drawSurprise } from "./curves.js";
import { placesLegend, viewLegend } from "./legend.js";
import { withoutAgents } from "./status.js";

const $ = (id) => document.getElementById(id);

export class Story {
  // `state`: of the page.  `picture`: of the body.  `chosen`: called with the part that is shown alone, or null.
  constructor({ state, picture, chosen }) {
    this.state = state;
    this.picture = picture;
    this.chosen = chosen;
    this.kept = new Map(); // cards by part, with what they were made from: one that has not changed is not made again
  }

  colorOf(part) {
    return this.state.robot?.parts.find((one) => one.name === part)?.color || [152, 165, 179];
  }

  showCards() {
    const { state } = this;
    const known = new Set(state.cards.map((one) => title(one.part)));
    const silent = (state.status.agents || []).filter((name) => !known.has(name));
    const cards = state.cards.map((one) => this.card(one));
    if (state.path.now) cards.unshift(playback(state.path));
    for (const name of silent) cards.push(waiting(name, "Its agent is up. Waiting for its first decision."));
    if (!cards.length) cards.push(waiting("No agent moves this robot", withoutAgents(state)));
    $("cards").replaceChildren(...cards);
    for (const one of state.cards) {
      const found = this.kept.get(one.part);
      if (found.plotted === found.text) continue;
      drawSurprise(found.made.querySelector("canvas"), one.recent, this.colorOf(one.part));
      found.plotted = found.text;
    }
  }

  card(one) {
    const { state, picture, kept } = this;
    const isChosen = picture.chosen === one.part;
    const text = JSON.stringify([one, isChosen, state.control.taken]);
    if (kept.get(one.part)?.text !== text) {
      const isTaken = Boolean(state.control.taken?.includes(one.part));
      const click = () => this.choose(picture.chosen === one.part ? null : one.part);
      kept.set(one.part, { made: card(one, { color: this.colorOf(one.part), isChosen, isTaken, isPast: state.past, click }), text });
    }
    return kept.get(one.part).made;
  }

  // Show the places of one part only; null: of all.
  choose(part) {
    this.picture.chosen = part;
    this.picture.touch();
    $("wonders-of").textContent = part ? title(part) : "";
    this.chosen(part);
    this.showCards();
  }

  chooseNext() {
    const names = [null, ...this.state.cards.map((one) => one.part)];
    this.choose(names[(names.indexOf(this.picture.chosen) + 1) % names.length]);
  }

  showLegends() {
    const { robot, path } = this.state;
    const places = this.picture.places;
    $("view-legend").replaceChildren(...viewLegend(robot, { hasPlaces: Object.keys(places).length > 0, hasPath: Boolean(path.now), showsFields: this.picture.fields }));
    $("legend").replaceChildren(...placesLegend(places, (part) => this.colorOf(part)));
  }

  showCurves() {
    if ($("knows").hidden) return;
    const { cards, curves, baselines } = this.state;
    const parts = cards.map((one) => one.part).filter((part) => part in curves);
    const of = (value) => Object.fromEntries(parts.map((part) => [part, value(part)]));
    const [shown, colors, titles] = [of((part) => curves[part]), of((part) => this.colorOf(part)), of(title)];
    drawCurves($("curves"), shown, baselines, colors, titles, "The curve begins when an agent has ended its first action.");
  }
}
