// SPDX-License-Identifier: Apache-2.0
// Runs Rerun's viewer.  It asks the monitor for a frame when it has shown the one before: a slow browser skips frames and stays near.
"use strict";

const CHANNEL = "mobee";
const SHOWN_PATIENCE = 20000; // ms after which the next frame is asked for, although the viewer has not said that it shows the last one

let shown = -1; // s of robot time that the viewer shows
let shownChanged = () => {};

function onEvent(text) {
  const event = typeof text === "string" ? JSON.parse(text) : text;
  if (event.type === "time_update" && event.time !== undefined) {
    shown = Number(event.time) / 1e9;
    tell({ kind: "time", time: shown });
    shownChanged();
  }
}

const page = new URLSearchParams(window.location.search).get("page") || window.location.origin; // that embeds this viewer

function tell(message) {
  window.parent.postMessage(message, page);
}

// Rerun takes the keys when it starts or is clicked; the page must receive them, above all that of the emergency stop.
addEventListener(
  "keydown",
  (event) => {
    if (!event.ctrlKey && !event.metaKey && !event.altKey) tell({ kind: "key", key: event.key });
  },
  { capture: true },
);

function pieces(buffer) {
  const view = new DataView(buffer);
  const found = [];
  for (let at = 16; at < buffer.byteLength; ) {
    const length = view.getUint32(at, true);
    found.push(new Uint8Array(buffer, at + 4, length));
    at += 4 + length;
  }
  return { number: Number(view.getBigUint64(0, true)), time: view.getFloat64(8, true), found };
}

function hasShown(time) {
  return new Promise((resolve) => {
    const begun = performance.now();
    const check = () => {
      if (shown >= time - 0.02 || performance.now() - begun > SHOWN_PATIENCE) {
        shownChanged = () => {};
        clearInterval(timer);
        resolve();
      }
    };
    const timer = setInterval(check, 200);
    shownChanged = check;
    check();
  });
}

async function follow(handle) {
  let after = 0;
  let frames = 0;
  for (;;) {
    try {
      const answer = await fetch(`frame?after=${after}`);
      const frame = pieces(await answer.arrayBuffer());
      for (const piece of frame.found) {
        if (piece.length) handle.send_rrd_to_channel(CHANNEL, piece);
      }
      if (frame.found.length) {
        after = frame.number;
        const came = performance.now();
        await hasShown(frame.time);
        await new Promise((resolve) => requestAnimationFrame(resolve));
        frames += 1;
        if (frames === 2) tell({ kind: "shown" }); // with the first one the viewer may still read the meshes
        if (frames > 2) tell({ kind: "frame", delay: (performance.now() - came) / 1000 });
      }
    } catch (error) {
      console.debug("no frame", error);
      await new Promise((resolve) => setTimeout(resolve, 1000));
    }
  }
}

async function load(url, progress) {
  const answer = await fetch(url);
  const total = Number(answer.headers.get("Content-Length"));
  const reader = answer.body.getReader();
  const parts = [];
  let loaded = 0;
  for (;;) {
    const { done, value } = await reader.read();
    if (done) break;
    parts.push(value);
    loaded += value.byteLength;
    progress(loaded / total);
  }
  return new Response(new Blob(parts), { headers: { "Content-Type": "application/wasm" } });
}

async function start() {
  const query = new URLSearchParams(window.location.search);
  await wasm_bindgen({ module_or_path: load("re_viewer_bg.wasm", (share) => tell({ kind: "loading", share })) });
  const handle = new wasm_bindgen.WebHandle({
    url: null,
    render_backend: query.get("renderer") || "webgl",
    hide_welcome_screen: true,
    check_for_updates_on_startup: false,
    enable_history: false,
    persist: false,
    theme: "dark",
    panel_state_overrides: { top: "Hidden", blueprint: "Hidden", selection: "Hidden", time: query.has("recording") ? "Collapsed" : "Hidden" },
    on_viewer_event: onEvent,
  });
  await handle.start(document.getElementById("canvas"));
  handle.open_channel(CHANNEL, "MoBeE");
  tell({ kind: "ready" });
  const recording = query.get("recording");
  if (recording) {
    const data = await (await fetch(recording)).arrayBuffer();
    handle.send_rrd_to_channel(CHANNEL, new Uint8Array(data));
    tell({ kind: "shown" });
  } else {
    follow(handle);
  }
  setInterval(() => handle.has_panicked() && tell({ kind: "failed", text: handle.panic_message() }), 1000);
}

start().catch((error) => tell({ kind: "failed", text: String(error) }));
