// Long work on the server: a new drive, predicted maps; its progress in the header.

import { get, post, tell } from "./api.js";
import { byId, fill, make } from "./dom.js";
import { state } from "./state.js";

const EVERY_MS = 700;
const VERB = { simulate: "Simulating", predict: "Predicting" };

export class JobBoard {
  /** Show jobs; `finished` gets a job that has ended well, `open` one whose maps are to be shown; `turned` is called at starts and ends. */
  constructor({ finished, open, turned }) {
    [this.finished, this.open, this.turned, this.last] = [finished, open, turned, null];
    byId("new-drive").addEventListener("click", () => byId("drive").showModal());
    byId("drive").addEventListener("close", () => this.#drive());
    byId("predict").addEventListener("click", () => byId("predicting").showModal());
    byId("predicting").addEventListener("close", () => this.#predict());
    this.look();
  }

  /** Offer weights, and towns and weathers for a new drive; null: there is no folder for it. */
  offer(drives, weights) {
    for (const select of document.querySelectorAll("select[name=weights]")) {
      fill(select, weights.map((name) => [name, name]), weights.includes(select.value) ? select.value : weights[0]);
    }
    byId("new-drive").hidden = !drives;
    const form = byId("drive").querySelector("form");
    if (!drives || form.elements.town.options.length) return;
    fill(form.elements.town, drives.towns.map((name) => [name, name]), drives.towns[0]);
    fill(form.elements.weather, drives.weathers.map((name) => [name, name.replace("_", " ")]), drives.weathers[0]);
    form.elements.seconds.max = drives.most_seconds;
  }

  get running() {
    return this.last?.state === "running";
  }

  /** Whether the maps of a recording are being made. */
  predicts(recording) {
    return this.running && this.last.recording === recording;
  }

  #drive() {
    const { elements } = byId("drive").querySelector("form");
    if (byId("drive").returnValue !== "start") return;
    byId("drive").returnValue = "";
    const [seconds, seed] = [Number(elements.seconds.value), Number(elements.seed.value)];
    const [town, weather, weights] = ["town", "weather", "weights"].map((name) => elements[name].value);
    this.#start("/api/drives", { town, weather, seconds, seed, weights });
  }

  #predict() {
    if (byId("predicting").returnValue !== "start") return;
    byId("predicting").returnValue = "";
    const weights = byId("predicting").querySelector("form").elements.weights.value;
    this.#start(`/api/recordings/${state.recording}/predict`, { weights });
  }

  async #start(path, body) {
    try {
      this.#show(await post(path, body));
      this.look();
    } catch (error) {
      tell(error.message);
    }
  }

  /** Look at the jobs, and again while one is running. */
  async look() {
    let job;
    try {
      job = (await get("/api/jobs")).jobs.at(-1);
    } catch {
      job = this.last;
    }
    const ran = this.running;
    this.last = job;
    const ended = ran && !this.running;
    if (ended && job?.state === "done") await this.finished(job).catch(() => {});
    if (ran !== this.running) this.turned();
    if (job && (ended || job.state === "running")) this.#show(job);
    clearTimeout(this.timer);
    if (job?.state === "running") this.timer = setTimeout(() => this.look(), EVERY_MS);
  }

  #show(job) {
    const line = byId("job");
    line.hidden = false;
    const share = job.total ? job.done / job.total : 0;
    const close = (text, onclick) => make("button", { type: "button", onclick }, text);
    if (job.state === "running") {
      const bar = make("progress", { max: 1, value: share });
      const left = share > 0.05 ? `, ${Math.ceil((job.seconds / share) * (1 - share))} s left` : "";
      const words = `${VERB[job.kind] ?? "Working on"} ${job.title}${job.note ? `: ${job.note}` : ""}`;
      line.replaceChildren(make("span", { title: words }, words), bar, make("span", { className: "share" }, `${Math.floor(100 * share)} %${left}`),
        close("Stop", () => post(`/api/jobs/${job.number}/stop`).then(() => this.look())));
    } else if (job.state === "done") {
      const other = job.recording && (job.recording !== state.recording || job.source !== state.source);
      line.replaceChildren(make("span", {}, `Ready: ${job.title}`),
        other ? close("Open it", () => { line.hidden = true; this.open(job); }) : "", close("×", () => { line.hidden = true; }));
    } else {
      line.replaceChildren(make("span", { className: "failed", title: job.note }, `${job.title}: ${job.note}`), close("×", () => { line.hidden = true; }));
    }
  }
}
