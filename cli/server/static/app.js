// The page: recordings, scenes and layers to choose, and the parts that show a key frame.

import { get, hush, tell } from "./api.js";
import { Cameras } from "./cameras.js";
import { CLASSES } from "./cells.js";
import { byId, chip, fill, make, place } from "./dom.js";
import { forget, load, setTileWidth, setTruth } from "./frames.js";
import { JobBoard } from "./jobs.js";
import { MapCanvas } from "./map.js";
import { change, onChange, state } from "./state.js";
import { Talk } from "./talk.js";
import { Timeline } from "./timeline.js";
import { offerTrainings } from "./training.js";
import { ChosenVehicle } from "./vehicle.js";
import { View } from "./view.js";

const LAYERS = [
  ["colour", "Colour"], ["road", "Road"], ["lane", "Lane"], ["vehicle", "Vehicle cells"], ["boxes", "Vehicles"],
  ["tracks", "Tracks"], ["annotated", "Annotated boxes"], ["truth", "Truth"],
];
const TRUTH_LAYERS = ["colour", "road", "lane", "vehicle"];

let recordings = [];
let frame = null;

const recording = () => recordings.find((one) => one.key === state.recording);
const scene = () => recording()?.scenes[state.scene];
const view = new View(() => drawMaps());
const chosen = new ChosenVehicle(() => draw());
const choose = (vehicle) => change({ vehicle: vehicle?.id ?? "" });
const cameras = new Cameras(choose);
const maps = ["map", "truth"].map((id) => new MapCanvas(byId(id).querySelector("canvas"), view, {
  hovered: (under) => readOut(under, id),
  clicked: (under) => choose(under.vehicle),
}));
const timeline = new Timeline(() => scene()?.frames ?? 0, view.keys);
const talk = new Talk(() => draw());
const board = new JobBoard({ finished: (job) => refresh(job), open: (job) => {
    open(job.recording);
    change({ source: job.source, vehicle: "" });
  }, turned: () => (frame ? draw() : show()) });

// What is open ------------------------------------------------------------------------------------------------------

async function list() {
  const listed = await get("/api/recordings");
  recordings = listed.recordings;
  board.offer(listed.drives, listed.weights);
  offerTrainings(listed.trainings);
}

/** Look for new recordings and maps, such as those of a job. */
async function refresh(job = null) {
  await list();
  if (job && !state.recording) open(job.recording);
  if (job?.recording === state.recording) {
    forget();
    if (!state.source) change({ source: recording()?.sources[0] ?? "" });
  }
  choices();
  await show();
}

/** Open a recording with the first scene, source and frame that it has, as far as the state names none. */
function open(key) {
  const wanted = recordings.find((one) => one.key === key) ?? recordings.find((one) => one.scenes.length) ?? recordings[0];
  if (!wanted) return;
  const same = !state.recording || wanted.key === state.recording;
  const index = same && state.scene < wanted.scenes.length ? state.scene : 0;
  const count = wanted.scenes[index]?.frames ?? 0;
  change({
    recording: wanted.key,
    scene: index,
    source: same && wanted.sources.includes(state.source) ? state.source : wanted.sources[0] ?? "",
    frame: same ? Math.max(Math.min(state.frame, count - 1), 0) : 0,
    vehicle: same ? state.vehicle : "",
  });
}

function choices() {
  const one = recording();
  fill(byId("recording"), recordings.map(({ key, title }) => [key, title]), state.recording);
  fill(byId("scene"), (one?.scenes ?? []).map(({ name }, n) => [n, name]), state.scene);
  fill(byId("source"), (one?.sources ?? []).map((name) => [name, name]), state.source);
  byId("recording-label").hidden = !recordings.length;
  byId("scene-label").hidden = !one?.scenes.length;
  byId("source-label").hidden = !one?.sources.length;
  byId("predict").hidden = !one?.scenes.length;
  setTruth(one?.truth ?? null);
  document.title = one ? `${one.title} · appocc` : "appocc";
  const own = LAYERS.filter(([name]) => name !== "truth" || (one?.truth && one.truth !== state.source));
  byId("layers").replaceChildren(...own.map(([name, text]) => make("button", {
    type: "button", "aria-pressed": String(state.layers.has(name)), onclick: () => toggle(name),
  }, text)));
}

function toggle(name) {
  const layers = new Set(state.layers);
  if (!layers.delete(name)) layers.add(name);
  change({ layers });
}

// A key frame -------------------------------------------------------------------------------------------------------

let [showing, stale] = [false, false];

/** Show the key frame of the state. One is loaded at a time; who drags the slider sees some on the way to the last. */
async function show() {
  stale = true;
  if (showing) return;
  showing = true;
  while (stale) {
    stale = false;
    await showOnce();
  }
  showing = false;
}

async function showOnce() {
  const [one, wanted] = [recording(), state.frame];
  if (!one || one.error || !scene()?.frames) {
    frame = null;
    document.body.classList.add("empty");
    note(one?.error ?? (one ? "This scene has no key frames."
      : board.running ? "The drive is being made. It opens here when it is ready."
      : "Nothing is open yet. “New drive…” simulates a short drive."));
    return;
  }
  document.body.classList.remove("empty");
  try {
    const loaded = await load(wanted);
    if (one !== recording()) return;
    hush();
    frame = loaded;
    draw();
    timeline.shown(frame.frame, frame.moment.time_s);
    timeline.ahead();
    talk.follow();
    chosen.follow();
    again();
  } catch (error) {
    if (error.status !== 0) tell(error.message);
  }
}

let due = null;

/** While the scene is being tracked, look again for its tracks. */
function again() {
  clearTimeout(due);
  const tracking = frame.moment.tracking;
  if (tracking?.kind !== "map" || tracking.problem) return;
  due = setTimeout(() => {
    forget();
    show();
  }, 1500);
}

function draw() {
  if (!frame) return;
  const { moment, images, problem } = frame;
  const shown = talk.at(frame.frame);
  cameras.show({ images, moment, shown, chosen: state.vehicle });
  if (setTileWidth(cameras.tileWidth * (window.devicePixelRatio || 1))) show();
  chosen.show(moment, cameras.seeing.bind(cameras));
  const tracking = moment.tracking;
  const pending = tracking?.kind === "map" && !tracking.problem;
  note(!state.source && board.predicts(state.recording) ? "Its maps are being made."
    : !state.source ? "No maps yet: “Predict maps…” makes them from the cameras."
    : problem || (pending ? `Following the vehicles: ${Math.floor(100 * tracking.share)} %` : talk.lost(frame.frame)));
  drawMaps(shown);
}

function drawMaps(shown = frame && talk.at(frame.frame)) {
  if (!frame) return;
  const { moment, sheet, truth, truthSource } = frame;
  const grid = moment.map;
  const common = { grid, ego: moment.ego, layers: state.layers, shown, chosen: state.vehicle, path: chosen.at(moment) };
  const [map, other] = maps;
  byId("map").hidden = !grid;
  byId("truth").hidden = !grid || !truth;
  byId("map").querySelector("figcaption").textContent = state.source;
  byId("truth").querySelector("figcaption").textContent = `truth (${truthSource})`;
  map.show(grid && { ...common, sheet, predicted: grid.predicted, vehicles: moment.vehicles, boxes: moment.boxes });
  const layers = new Set([...TRUTH_LAYERS.filter((name) => state.layers.has(name)), "annotated"]);
  const truthData = { ...common, layers, sheet: truth, predicted: false, vehicles: [], boxes: moment.boxes, path: null };
  other.show(grid && truth ? truthData : null);
}

function readOut(under, id) {
  const line = byId("readout");
  if (!under) {
    line.replaceChildren();
    return;
  }
  const { x, y, cell, vehicle } = under;
  const shares = (cell?.chances ?? []).map((share, n) => `${CLASSES[n]} ${share === null ? "unknown" : `${Math.round(100 * share)} %`}`);
  line.replaceChildren(
    make("span", {}, place(x, y)),
    ...(cell ? [make("span", {}, `cell ${cell.cell.join(", ")}`), make("span", {}, shares.join(" · "))] : [make("span", {}, "outside of the map")]),
    ...(cell ? [make("span", {}, chip(cell.rgb), cell.rgb ? `rgb ${cell.rgb.join(" ")}` : "colour unknown")] : []),
    ...(vehicle ? [make("span", { className: "over" }, vehicle.words)] : []),
    ...(id === "truth" ? [make("span", {}, "truth")] : []),
  );
}

function note(text) {
  byId("note").textContent = text;
  byId("note").hidden = !text;
}

// The page ----------------------------------------------------------------------------------------------------------

onChange((changed) => {
  if (["recording", "scene", "source", "layers"].some((name) => changed.has(name))) choices();
  if (changed.has("recording") || changed.has("scene")) timeline.toggle(false);
  if (["recording", "scene", "source"].some((name) => changed.has(name))) note("Loading…");
  if (["recording", "scene", "source", "frame", "layers"].some((name) => changed.has(name))) show();
  if (changed.has("vehicle")) {
    chosen.follow();
    draw();
  }
});

byId("recording").addEventListener("change", (event) => open(event.target.value));
byId("scene").addEventListener("change", (event) => change({ scene: Number(event.target.value), frame: 0, vehicle: "" }));
byId("source").addEventListener("change", (event) => change({ source: event.target.value, vehicle: "" }));
byId("help").addEventListener("click", () => byId("about").showModal());
// A button that was clicked gives the keys back to the page: space plays, and does not press it again.
const letGo = () => document.activeElement instanceof HTMLButtonElement && document.activeElement.blur();
document.addEventListener("click", (event) => event.detail && letGo());
for (const dialog of document.querySelectorAll("dialog")) dialog.addEventListener("close", () => setTimeout(letGo));
window.addEventListener("reconnected", () => refresh().catch(() => {}));
new ResizeObserver(() => draw()).observe(byId("stage"));

try {
  await list();
  open(state.recording);
  choices();
  await talk.resume();
  await show();
} catch (error) {
  tell(error.message);
}
document.body.dataset.ready = "yes";
