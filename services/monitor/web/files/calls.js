// SPDX-License-Identifier: Apache-2.0
// Asks the monitor to do something, and shows its answer for some seconds.

export const key = new URLSearchParams(location.search).get("key") || ""; // without it a page can only show
export const me = sessionStorage.getItem("page") || Math.random().toString(36).slice(2, 12); // the id of this page
sessionStorage.setItem("page", me);

const SHOWN = { good: 4000, bad: 9000 }; // ms

// Returns whether it was done.
export async function send(verb, given = {}) {
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
export function say(text, bad = false) {
  const said = document.getElementById("said");
  said.textContent = text;
  said.className = bad ? "bad" : "";
  said.hidden = false;
  clearTimeout(silence);
  silence = setTimeout(() => (said.hidden = true), SHOWN[bad ? "bad" : "good"]);
}
