// SPDX-License-Identifier: Apache-2.0
// The state of the system in words: the banner, the word at the top, and why there is no agent.

const WORDS = { waiting: ["waits", "rest"], stop: ["emergency stop", "bad"], fault: ["fault", "bad"], hold: ["hold", "rest"], paused: ["paused", "rest"], ended: ["ended", "bad"], lost: ["not connected", "bad"] };

// What must be shown in large letters: `level`, `title`, `text`, `todo`; null if all is well.  The monitor makes it, unless the page has lost the monitor.
export function bannerOf(state) {
  if (!state.connected) {
    return state.robot
      ? { level: "lost", title: "The connection is lost", text: "The system has ended, or its monitor starts again. The picture below is the last one.", todo: "Start it again: mobee launch. See the run again: mobee replay RUN." }
      : { level: "waiting", title: "Waiting for the monitor", text: "It does not answer yet.", todo: "" };
  }
  if (state.past) return null;
  return state.status.banner || null;
}

// The word at the top, and its kind, a class of page.css.
export function wordOf(banner, isPast) {
  if (banner) return WORDS[banner.level] || ["", "rest"];
  return isPast ? ["recording", "rest"] : ["running", "running"];
}

// The text of the card that is shown when no agent moves the robot.
export function withoutAgents(state) {
  if (!state.robot) return "Waiting for the robot.";
  if (state.past) return "No agent explored in this run.";
  if (!state.status.services?.includes("controller")) return "There is no controller either: a program of yours drives the robot, and this page shows it.";
  if (state.status.moving?.length) return `A program moves its ${state.status.moving.join(" and ")}.`;
  return "Click a place in the picture below, then H: a hand reaches for it. M: move a part by sliders.";
}
