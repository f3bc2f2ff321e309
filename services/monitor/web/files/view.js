// SPDX-License-Identifier: Apache-2.0
// The 3D view: the page's own picture, which is there at once and always near the robot, and Rerun's viewer where the browser can draw it in time.
import { SceneView } from "./scene.js";

const LATEST = 1; // s from the arrival of a frame until Rerun shows it: a slower one is closed
const FRAMES_TO_JUDGE = 3; // frames that are too late, one after the other
const OTHER_NAME = { "127.0.0.1": "localhost", localhost: "127.0.0.1" };
const NARROW = 640; // pixels: on a phone Rerun's panels have no room

// Under another name of the same host the browser gives the viewer a process of its own: while it draws, the page and its STOP still answer.
function viewerAddress() {
  const address = new URL("viewer.html", location);
  address.hostname = OTHER_NAME[location.hostname] || location.hostname;
  address.searchParams.set("page", location.origin);
  return address;
}

export class View {
  constructor({ frame, canvas, legend, note, button, pressed }) {
    this.scene = new SceneView(canvas);
    this.frame = frame;
    this.canvas = canvas;
    this.legend = legend;
    this.note = note;
    this.button = button;
    this.pressed = pressed; // (key): a key was pressed in Rerun's view
    this.rerunTime = null; // s of robot time that Rerun shows
    this.isAsked = false; // a person wants Rerun, however late
    this.late = 0; // frames
    addEventListener("message", (event) => {
      if (frame.src && event.source === frame.contentWindow && event.origin === viewerAddress().origin) this.receive(event.data);
    });
  }

  // Begin with a robot; Rerun loads after the story and only if a graphics card draws it.
  async open(robot) {
    try {
      await this.scene.open(robot);
    } catch (error) {
      console.debug(error);
      setTimeout(() => this.open(robot), 1000); // the system ends or is starting again
      return;
    }
    if (!this.frame.src && !this.isAsked) setTimeout(() => this.isFast() && this.load(), 1500);
  }

  isFast() {
    if (window.innerWidth < NARROW) return false;
    const context = document.createElement("canvas").getContext("webgl");
    const about = context?.getExtension("WEBGL_debug_renderer_info");
    const card = context ? String(context.getParameter(about ? about.UNMASKED_RENDERER_WEBGL : context.RENDERER)) : "";
    context?.getExtension("WEBGL_lose_context")?.loseContext();
    return card !== "" && !/swiftshader|llvmpipe|software|basic render/i.test(card);
  }

  // Change between the two views.
  toggle() {
    if (this.frame.src) return this.close("");
    this.isAsked = true;
    this.load();
  }

  reload() {
    if (!this.frame.src) return;
    this.close("");
    this.load();
  }

  load() {
    if (this.frame.src) return;
    this.late = 0;
    this.frame.src = viewerAddress();
    this.frame.hidden = false; // behind the page's own picture until it has drawn: a hidden frame draws nothing
    this.say("Rerun's view loads.");
  }

  close(why) {
    this.frame.hidden = true;
    this.frame.removeAttribute("src");
    this.frame.contentWindow?.location.replace("about:blank"); // without an address alone it would continue
    this.canvas.hidden = this.legend.hidden = false;
    this.rerunTime = null;
    this.button.firstChild.textContent = "Rerun's view ";
    this.say(why);
  }

  // A message of Rerun's view, which viewer.js sends.
  receive({ kind, share, time, delay, text, key }) {
    if (kind === "key") this.pressed(key);
    if (kind === "loading") this.say(`Rerun's view loads: ${Math.round(100 * share)} %`);
    if (kind === "ready") this.say("Rerun's view draws its first picture.");
    if (kind === "shown") {
      this.canvas.hidden = this.legend.hidden = true;
      this.button.firstChild.textContent = "Light view ";
      this.say("");
    }
    if (kind === "time") this.rerunTime = time;
    if (kind === "frame") this.judge(delay);
    if (kind === "failed") this.close(`Rerun's view has failed (${String(text).slice(0, 200)}).`);
  }

  judge(delay) {
    this.late = delay > LATEST ? this.late + 1 : 0;
    if (this.late >= FRAMES_TO_JUDGE && !this.isAsked) {
      this.close(`Rerun's view needed ${delay.toFixed(1)} s for a frame here, so it was closed. V opens it all the same.`);
    }
  }

  say(text) {
    this.note.textContent = text;
    this.note.hidden = !text;
  }
}
