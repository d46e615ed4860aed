// Key frames with all their pictures, loaded ahead of their time and kept in bounded number.

import { get } from "./api.js";
import { loadSheet } from "./cells.js";
import { address, state } from "./state.js";

const KEPT = 20;
const WIDTHS = [320, 480, 640, 960, 1920];
const kept = new Map();
let truthSource = null;
let width = WIDTHS[0];

/** The source of true maps of the recording; null without one. */
export function setTruth(source) {
  truthSource = source;
}

/** Load camera images for tiles of a width in pixels of the screen; true if that is another width than before. */
export function setTileWidth(pixels) {
  const wanted = WIDTHS.find((one) => one >= pixels) ?? WIDTHS.at(-1);
  const other = wanted > width;
  width = Math.max(wanted, width);
  return other;
}

export function forget() {
  kept.clear();
}

const keyOf = (frame) => [state.recording, state.scene, state.source, frame, width, state.layers.has("truth")].join("|");

/** A key frame: {moment, sheet, truth, images}; parts that cannot be read are null, with the reason in `problem`. */
export function load(frame) {
  const key = keyOf(frame);
  const loading = kept.get(key) ?? read(frame);
  loading.catch(() => kept.delete(key));
  kept.delete(key);
  kept.set(key, loading);
  if (kept.size > KEPT) kept.delete(kept.keys().next().value);
  return loading;
}

async function read(frame) {
  const truth = state.layers.has("truth") && truthSource && truthSource !== state.source ? truthSource : null;
  const sheetOf = (source) => (source ? loadSheet(address("/map.png", frame, source)).catch(() => null) : null);
  const sheets = Promise.all([sheetOf(state.source), sheetOf(truth)]);
  let problem = "";
  let moment;
  try {
    moment = await get(address("", frame));
  } catch (error) {
    if (error.status !== 400 || !state.source) throw error;
    problem = error.message;
    moment = await get(address("", frame, ""));
  }
  const channels = Object.keys(moment.cameras);
  const paths = channels.map((channel) => address(`/cameras/${encodeURIComponent(channel)}`, frame, "", { width }));
  const pictures = await Promise.all(paths.map((path) => loadImage(path)));
  const [sheet, truthSheet] = await sheets;
  const images = Object.fromEntries(channels.map((channel, n) => [channel, pictures[n]]));
  return { frame, moment, sheet, truth: truthSheet, truthSource: truth, images, problem };
}

async function loadImage(path) {
  const image = new Image();
  image.src = path;
  try {
    await image.decode();
    return image;
  } catch {
    return null;
  }
}
