// The conversation: sentences typed or spoken, answers with reasons, questions with buttons.

import { get, post } from "./api.js";
import { byId, chip, make, metres, place } from "./dom.js";
import { change, state } from "./state.js";

const FIRST = ["park behind the nearest car", "stop next to the vehicle", "which cars do you see?"];
const FOLLOW_MS = 250;
// What a question shows that waits for its answer while the scene moves on, beside its candidates.
const NO_GOAL = { referents: [], target: null, nearest: null, runners_up: [], route: null, steps: [] };

export class Talk {
  /** Hold the conversation of the page; `changed` is called when map and cameras must show something else. */
  constructor(changed) {
    [this.changed, this.data, this.busy, this.wanted, this.shownAt] = [changed, null, false, null, -1];
    byId("say").addEventListener("submit", (event) => {
      event.preventDefault();
      const text = byId("sentence").value.trim();
      if (text) this.say(text);
    });
    // Out of the text field, the keys are those of the page again.
    byId("sentence").addEventListener("keydown", (event) => event.key === "Escape" && event.target.blur());
    listen((text) => this.say(text));
    new ResizeObserver(scrollDown).observe(byId("turns"));
  }

  /** What map and cameras show of the conversation at a frame: {referents, candidates, target, ...} or null. */
  at(frame) {
    const { data } = this;
    if (!this.#here() || data.about.frame !== frame) return null;
    if (!data.shown && !data.candidates.length) return null;
    return { ...(data.shown ?? NO_GOAL), candidates: data.candidates };
  }

  /** Why the goal in force cannot be planned for a frame; "" if it can. */
  lost(frame) {
    return this.#here() && this.data.about.frame === frame ? this.data.lost : "";
  }

  #here() {
    const about = this.data?.about;
    return about && about.recording === state.recording && about.scene === state.scene && about.source === state.source;
  }

  #body(more) {
    const { talk, recording, scene, frame, source } = state;
    return { talk: talk || null, recording, scene, frame, source, ...more };
  }

  /** Take up the conversation that the address names. */
  async resume() {
    if (state.talk) this.#take(await get(`/api/talk/${encodeURIComponent(state.talk)}`));
    else this.#render();
  }

  say(text) {
    return this.#ask({ say: text }, text);
  }

  choose(candidate) {
    return this.#ask({ choose: candidate.key }, candidate.words);
  }

  async #ask(more, text) {
    if (this.busy) return;
    this.busy = true;
    byId("turns").append(make("li", { className: "said waiting" }, text));
    byId("replies").replaceChildren();
    scrollDown();
    try {
      const data = await post("/api/talk", this.#body(more));
      byId("sentence").value = "";
      this.#take(data);
    } catch (error) {
      this.#render();
      byId("turns").append(make("li", { className: "answer problem" }, error.message));
      scrollDown();
    } finally {
      this.busy = false;
    }
  }

  /** Follow the scene to another key frame: the goal is planned anew. One request at a time; the last frame wins. */
  async follow() {
    if (!this.data?.turns.length || !this.#here() || this.data.about.frame === state.frame) return;
    const waiting = this.wanted !== null;
    this.wanted = state.frame;
    if (waiting) return;
    while (this.wanted !== null && this.data.about.frame !== this.wanted) {
      const began = performance.now();
      try {
        if (!this.busy) this.#take(await post("/api/talk", this.#body({})), false);
      } catch {
        break;
      }
      await new Promise((resolve) => setTimeout(resolve, Math.max(FOLLOW_MS - (performance.now() - began), 20)));
      if (!this.#here()) break;
      if (this.wanted === this.data.about.frame) break;
      this.wanted = state.frame;
    }
    this.wanted = null;
  }

  #take(data, spoken = true) {
    this.data = data;
    change({ talk: data.talk });
    if (spoken) this.#render();
    else this.#buttons();
    this.changed();
  }

  #render() {
    const turns = this.data?.turns ?? [];
    byId("turns").replaceChildren(...turns.flatMap((turn, n) => [
      make("li", { className: "said" }, turn.said),
      answerOf(turn, n === turns.length - 1),
    ]));
    this.#buttons();
    scrollDown();
  }

  /** The buttons of the last answer: vehicles to choose, yes and no; or sentences to begin with. */
  #buttons() {
    const { turns = [], candidates = [], replies = [], question = "" } = this.data ?? {};
    const box = byId("replies");
    if (!turns.length) {
      const tries = FIRST.map((text) => make("button", { type: "button", onclick: () => this.say(text) }, text));
      box.replaceChildren(make("p", {}, "Say where to go, for example:"), ...tries);
      return;
    }
    const asked = turns.at(-1).status === "ambiguous";
    // "Do you mean ...?" about a single vehicle is answered by yes or no.
    const offered = replies.length && candidates.length === 1 ? [] : candidates;
    const choices = offered.map((one) => make(
      "button", { type: "button", className: "choice", onclick: () => this.choose(one) },
      make("b", {}, String(one.number)), chip(one.rgb), make("span", {}, one.words),
    ));
    const answers = replies.map((text) => make("button", { type: "button", onclick: () => this.say(text) }, text));
    // A question that was asked before an aside is told again, so that it is clear what a button answers.
    const last = turns.at(-1).question;
    const told = !question || last === question || (last && choices.length > 0);
    const open = told || !(answers.length + choices.length) ? [] : [make("p", { className: "open" }, capital(question))];
    const title = choices.length && told ? [make("p", {}, asked ? "Which one?" : "Or do you mean:")] : [];
    box.replaceChildren(...open, ...answers, ...title, ...choices);
  }
}

const STATUS = { not_found: "Not found", not_a_command: "Not a command" };

function answerOf(turn, last) {
  const parts = [];
  const reasons = make("ul", {}, ...turn.reasons.map((reason) => make("li", {}, reason)));
  // An answer in words comes before the question that stays open.
  const inWords = turn.status === "ok" && !turn.goal && turn.reasons.length > 0;
  if (inWords) parts.push(reasons);
  if (turn.question) parts.push(make("p", { className: "question" }, capital(turn.question)));
  else if (turn.status in STATUS) {
    const noPlace = turn.status === "not_found" && turn.referent;
    parts.push(make("p", { className: "question" }, noPlace ? "No place for that" : STATUS[turn.status]));
  }
  if (turn.referent) parts.push(make("p", { className: "referent" }, capital(turn.referent)));
  if (turn.goal) {
    const { ego_m: [x, y], cell, way_m: way } = turn.goal;
    const words = way === null ? "" : `, ${metres(way)} to drive`;
    parts.push(make("p", { className: "goal", title: `cell ${cell.join(", ")}` }, `Goal ${place(x, y)}${words}`));
  }
  if (turn.steps.length) parts.push(make("ol", {}, ...turn.steps.map((step) => make("li", {}, step))));
  if (turn.reasons.length && !inWords) {
    const bare = !parts.length || last || turn.reasons.length === 1;
    parts.push(bare ? reasons : make("details", {}, make("summary", {}, "why"), reasons));
  }
  if (turn.dropped.length) parts.push(make("p", { className: "dropped" }, `Not used: ${turn.dropped.join(", ")}`));
  if (!parts.length) parts.push(make("p", {}, "Done."));
  return make("li", { className: `answer ${turn.status}` }, ...parts);
}

const capital = (text) => text.charAt(0).toUpperCase() + text.slice(1);

function scrollDown() {
  const turns = byId("turns");
  turns.scrollTop = turns.scrollHeight;
}

/** Use the browser's own speech input, where it has one. */
function listen(heard) {
  const Recognition = window.SpeechRecognition ?? window.webkitSpeechRecognition;
  if (!Recognition) return;
  const button = byId("speak");
  button.hidden = false;
  let ear = null;
  button.addEventListener("click", () => {
    if (ear) {
      ear.stop();
      return;
    }
    ear = new Recognition();
    Object.assign(ear, { lang: "en-GB", interimResults: true, maxAlternatives: 1 });
    button.classList.add("listening");
    ear.onresult = (event) => {
      const result = event.results[event.results.length - 1];
      byId("sentence").value = result[0].transcript;
      if (result.isFinal) heard(result[0].transcript);
    };
    ear.onerror = (event) => {
      byId("sentence").placeholder = event.error === "no-speech" ? "nothing heard" : `no speech input (${event.error})`;
    };
    ear.onend = () => {
      ear = null;
      button.classList.remove("listening");
    };
    ear.start();
  });
}
