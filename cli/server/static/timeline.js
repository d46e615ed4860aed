// The time slider: play, pause, steps, and frames loaded ahead.

import { byId } from "./dom.js";
import { load } from "./frames.js";
import { change, state } from "./state.js";

const AHEAD = 4;
// Recordings with long gaps still move.
const LONGEST_S = 1.0;
const TYPED = "input, select, textarea, button, dialog, [contenteditable]";

export class Timeline {
  /** Control the key frames of a scene; `count` gives their number, `keys` what other keys of the page do. */
  constructor(count, keys) {
    [this.count, this.keys, this.playing, this.times] = [count, keys, false, new Map()];
    this.slider = byId("time");
    this.slider.addEventListener("input", () => this.go(Number(this.slider.value)));
    byId("play").addEventListener("click", () => this.toggle());
    window.addEventListener("keydown", (event) => this.#key(event));
  }

  /** Show the frame that is on the page, at a time of the scene in seconds. */
  shown(frame, seconds) {
    this.times.set(frame, seconds);
    this.slider.max = Math.max(this.count() - 1, 0);
    this.slider.value = frame;
    this.slider.disabled = this.count() < 2;
    byId("clock").textContent = `${seconds.toFixed(1)} s · frame ${frame} of ${this.count() - 1}`;
    this.slider.setAttribute("aria-valuetext", byId("clock").textContent);
    byId("play").classList.toggle("playing", this.playing);
    byId("play").setAttribute("aria-label", this.playing ? "Pause" : "Play");
  }

  go(frame) {
    const last = this.count() - 1;
    const wanted = Math.min(Math.max(frame, 0), Math.max(last, 0));
    change({ frame: wanted });
  }

  /** Load the frames that come next. */
  ahead() {
    for (let k = state.frame + 1; k <= Math.min(state.frame + (this.playing ? AHEAD : 1), this.count() - 1); k += 1) {
      load(k).catch(() => {});
    }
  }

  toggle(on = !this.playing) {
    if (this.playing === on) return;
    this.playing = on;
    byId("play").classList.toggle("playing", on);
    byId("play").setAttribute("aria-label", on ? "Pause" : "Play");
    if (on) this.#play();
  }

  async #play() {
    if (state.frame >= this.count() - 1) this.go(0);
    while (this.playing && state.frame < this.count() - 1) {
      const [began, from] = [performance.now(), state.frame];
      let now;
      let next;
      try {
        [now, next] = await Promise.all([load(from), load(from + 1)]);
      } catch {
        break;
      }
      const gap = Math.min(Math.max(next.moment.time_s - now.moment.time_s, 0.02), LONGEST_S);
      const rest = 1000 * gap - (performance.now() - began);
      await new Promise((resolve) => setTimeout(resolve, Math.max(rest, 0)));
      // A slider that was moved meanwhile wins.
      if (this.playing && state.frame === from) change({ frame: from + 1 });
    }
    this.toggle(false);
  }

  #key(event) {
    const typing = event.target instanceof Element && event.target.matches(TYPED) && event.target !== this.slider;
    if (event.ctrlKey || event.metaKey || event.altKey || document.querySelector("dialog[open]")) return;
    const text = event.target instanceof Element && event.target.matches("input[type=text], select");
    if (text) return;
    const step = event.shiftKey ? 10 : 1;
    const acts = {
      ...this.keys,
      " ": () => this.toggle(),
      ArrowRight: () => this.go(state.frame + step),
      ArrowLeft: () => this.go(state.frame - step),
      Home: () => this.go(0),
      End: () => this.go(this.count() - 1),
      "/": () => byId("sentence").focus(),
      Escape: () => change({ vehicle: "" }),
    };
    // A button that has the focus keeps its own space bar.
    if (!(event.key in acts) || (event.key === " " && typing)) return;
    event.preventDefault();
    acts[event.key]();
  }
}
