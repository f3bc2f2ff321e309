// SPDX-License-Identifier: Apache-2.0
// The cards with the story of each agent.

// The name of a part for people.
export const title = (part) => part.replaceAll("_", " ");

export function node(tag, kind, ...content) {
  const made = document.createElement(tag);
  made.className = kind;
  made.append(...content);
  return made;
}

// A number and its unit on one line.
const tight = (text) => text.replace(/(\d) (%|nats|cm|mm|s)(?![a-z])/g, "$1\u00a0$2");

function labelled(kind, label, text) {
  return node("p", kind, node("b", "", `${label} `), text);
}

// A card without a story.
export function waiting(name, text) {
  const made = node("article", "card", node("h3", "", name), node("p", "", text));
  made.style.setProperty("--hue", "#98a5b3");
  return made;
}

// The card of a motion along a path of a roadmap; `path`: as services/monitor/story/teller.py makes it.
export function playback(path) {
  const bar = node("div", "bar", node("i", ""));
  bar.firstChild.style.width = `${100 * path.share}%`;
  bar.title = "Share of the planned motion that is over";
  const kind = { over: "reached", interrupted: "missed" }[path.phase] || "";
  const made = node("article", "card", node("h3", "", "path of a roadmap"), node("p", `now ${kind}`, tight(path.now)), bar);
  made.style.setProperty("--hue", "#ffd640");
  return made;
}

// The card of an agent.  `color`: of its part; `isTaken`: a person moves the part; `isPast`: the page shows a recording; `click`: when it is clicked.
export function card(one, { color, isChosen, isTaken, isPast, click }) {
  const facts = one.n === undefined ? "" : `${one.n} transition${one.n === 1 ? "" : "s"}, ${share(one.tried)} of actions tried, ${share(one.predictable)} predictable`;
  const plot = node("span", "surprise", "surprise", node("canvas", ""));
  plot.title = "Surprise of the last 60 transitions, −ln p in nats; amber: it did not get where it wanted";
  const small = node("small", "", facts);
  small.title = `It has ${one.actions} actions in ${one.states} states. Predictable: tried at least twice, and at least 80 % of the tries ended alike`;
  const made = node("article", `card${isChosen ? " chosen" : ""}`, node("h3", "", node("span", "", one.title), small, plot));
  made.dataset.part = one.part;
  made.style.setProperty("--hue", `rgb(${color})`);
  made.title = "Click: show the places of this part only";
  if (one.reach && (isTaken || !one.now)) made.append(node("p", "now", tight(one.reach)));
  else if (isTaken) made.append(node("p", "now", "Taken over on this page. Its agent rests. G gives it back."));
  else if (one.now) {
    made.append(node("p", "", node("b", "", "Tries "), node("strong", "now", tight(one.now)), ` ${tight(one.expects)}`));
  } else if (!one.last) made.append(node("p", "", "Waiting for its first action to begin."));
  else if (one.explorer && !isPast) made.append(labelled("", "Tries", "nothing yet: it chooses its next action."));
  if (one.last) {
    const kind = one.last.reached ? "reached" : "missed";
    const line = labelled("", "Last", node("span", kind, one.last.outcome));
    const surprise = node("span", "", ` ${tight(one.last.surprise)}`);
    surprise.title = "Surprise: −ln of the probability that it gave to what happened. Learned: how much its model changed (Kullback-Leibler divergence).";
    line.append(surprise);
    made.append(line);
  } else if (one.now && !isTaken) {
    made.append(node("p", "", one.n ? `It continues after ${one.n} transitions of an earlier run.` : "Its first action has not ended yet: nothing is learned so far."));
  }
  if (one.wants && !isTaken) made.append(labelled("", one.wants.startsWith("nothing") ? "Wants" : `Wants, ${one.chooses},`, one.wants));
  made.addEventListener("click", click);
  return made;
}

function share(part) {
  const percent = 100 * part;
  return `${percent > 0 && percent < 10 ? percent.toFixed(1) : Math.round(percent)} %`;
}
