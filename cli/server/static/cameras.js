// The camera images as one looks out of the car, with vehicles, goal and way drawn into them.

import { byId, make } from "./dom.js";
import { GOAL, badge, footprintOf, inkOf, sized, stroke, trace } from "./paint.js";

const NEAR_M = 0.3;
const EDGES = [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]];

export class Cameras {
  /** Show cameras in the page's section; `clicked` gets the vehicle under the pointer or null. */
  constructor(clicked) {
    [this.section, this.clicked, this.tiles, this.rows] = [byId("cameras"), clicked, new Map(), ""];
  }

  /** Show {images, moment, shown, chosen}. */
  show(data) {
    this.data = data;
    this.#lay(data.moment.rows, data.moment.cameras);
    for (const [channel, { image, tile }] of this.tiles) {
      const loaded = data.images[channel];
      tile.classList.toggle("missing", !loaded);
      if (loaded && image.src !== loaded.src) image.src = loaded.src;
    }
    this.draw();
  }

  /** Make a tile for each camera, if there are other cameras than before. */
  #lay(rows, cameras) {
    const key = JSON.stringify(rows);
    if (this.rows === key) return;
    this.rows = key;
    this.tiles.clear();
    const columns = Math.max(3, ...rows.map((row) => row.length));
    this.section.replaceChildren(...rows.map((row) => make("div", { className: "row" }, ...row.map((channel) => {
      const [image, canvas] = [make("img", { alt: "", draggable: false }), make("canvas")];
      const name = channel.replace(/^CAM_/, "").replaceAll("_", " ").toLowerCase();
      const tile = make("figure", { className: "camera", title: channel }, image, canvas, make("figcaption", {}, name));
      const [width, height] = cameras[channel].size;
      tile.style.setProperty("--aspect", width / height);
      tile.style.setProperty("--columns", columns);
      tile.dataset.channel = channel;
      tile.addEventListener("click", (event) => this.clicked(this.#under(channel, event)));
      this.tiles.set(channel, { image, canvas, tile });
      return tile;
    }))));
    this.section.style.setProperty("--rows", rows.length);
  }

  get tileWidth() {
    return Math.max(0, ...[...this.tiles.values()].map(({ tile }) => tile.clientWidth));
  }

  draw() {
    if (!this.data) return;
    const { moment, shown, chosen } = this.data;
    for (const [channel, { canvas }] of this.tiles) {
      const { width, context } = sized(canvas);
      const look = lens(moment.cameras[channel], width);
      if (shown?.route) {
        context.globalAlpha = 0.8;
        for (const piece of pieces(look, shown.route)) {
          trace(context, piece);
          stroke(context, GOAL, 2, [6, 4]);
        }
        context.globalAlpha = 1;
      }
      if (shown?.target) ground(context, look, shown.target.footprint);
      for (const vehicle of moment.vehicles) {
        const { ink, width: line, important, label } = inkOf(vehicle, shown, chosen, false);
        if (important) box(context, look, vehicle, ink, Math.min(line, 2), label);
      }
    }
  }

  #under(channel, event) {
    const { moment } = this.data;
    const look = lens(moment.cameras[channel], this.tiles.get(channel).canvas.clientWidth);
    const hits = moment.vehicles.filter((vehicle) => {
      const bounds = boundsOf(look, vehicle);
      if (!bounds) return false;
      const [left, top, right, bottom] = bounds;
      return event.offsetX >= left && event.offsetX <= right && event.offsetY >= top && event.offsetY <= bottom;
    });
    return hits.sort((one, other) => one.distance - other.distance)[0] ?? null;
  }

  /** The cameras in which the middle of a vehicle is, by name. */
  seeing(vehicle, moment) {
    const middle = [...vehicle.xy, vehicle.bottom + vehicle.size[2] / 2];
    return Object.entries(moment.cameras).filter(([, camera]) => {
      const point = lens(camera, camera.size[0]).camera(middle);
      if (point[2] < NEAR_M) return false;
      const [column, row] = lens(camera, camera.size[0]).pixel(point);
      return column >= 0 && row >= 0 && column < camera.size[0] && row < camera.size[1];
    }).map(([channel]) => channel);
  }
}

/** The projection of a camera into a tile of a width. */
function lens(camera, width) {
  const scale = width / camera.size[0];
  const [m, k] = [camera.cam_from_ego, camera.intrinsic];
  return {
    camera: ([x, y, z]) => [0, 1, 2].map((row) => m[row][0] * x + m[row][1] * y + m[row][2] * z + m[row][3]),
    pixel: ([x, y, z]) => [0, 1].map((row) => ((k[row][0] * x + k[row][1] * y + k[row][2] * z) / z + 0.5) * scale),
  };
}

function cornersOf(look, vehicle) {
  const foot = footprintOf(vehicle);
  const level = (z) => foot.map(([x, y]) => look.camera([x, y, z]));
  return [...level(vehicle.bottom), ...level(vehicle.bottom + vehicle.size[2])];
}

/** The part of a line in front of the camera, in pixels; null if there is none. */
function clipped(look, a, b) {
  if (Math.max(a[2], b[2]) <= NEAR_M) return null;
  const ends = [[a, b], [b, a]].map(([one, other]) => {
    if (one[2] > NEAR_M) return one;
    const share = (NEAR_M - one[2]) / (other[2] - one[2]);
    return one.map((value, axis) => value + share * (other[axis] - value));
  });
  return ends.map(look.pixel);
}

function box(context, look, vehicle, ink, width, label) {
  const corners = cornersOf(look, vehicle);
  const lines = EDGES.map(([a, b]) => clipped(look, corners[a], corners[b])).filter(Boolean);
  if (!lines.length) return;
  context.beginPath();
  for (const [start, end] of lines) {
    context.moveTo(...start);
    context.lineTo(...end);
  }
  stroke(context, ink, width);
  const middle = look.camera([...vehicle.xy, vehicle.bottom + vehicle.size[2]]);
  if (label && middle[2] > NEAR_M) badge(context, label, look.pixel(middle), ink);
}

function boundsOf(look, vehicle) {
  const corners = cornersOf(look, vehicle);
  if (corners.some(([, , depth]) => depth < NEAR_M)) return null;
  const pixels = corners.map(look.pixel);
  const [columns, rows] = [pixels.map(([column]) => column), pixels.map(([, row]) => row)];
  return [Math.min(...columns), Math.min(...rows), Math.max(...columns), Math.max(...rows)];
}

/** Fill a place on the ground, cut off at the camera. */
function ground(context, look, foot) {
  const points = foot.map(([x, y]) => look.camera([x, y, 0]));
  const cut = points.flatMap((point, n) => {
    const next = points[(n + 1) % points.length];
    return clipped(look, point, next) ?? [];
  });
  if (cut.length < 3) return;
  trace(context, cut, true);
  context.fillStyle = "rgb(60 220 255 / 40%)";
  context.fill();
  stroke(context, GOAL, 2);
}

/** The pieces of a way on the ground that are in front of a camera. */
function pieces(look, points) {
  const found = [];
  for (let n = 1; n < points.length; n += 1) {
    const ends = [points[n - 1], points[n]].map(([x, y]) => look.camera([x, y, 0]));
    const piece = clipped(look, ...ends);
    if (!piece) continue;
    const last = found.at(-1)?.at(-1);
    if (last && Math.hypot(last[0] - piece[0][0], last[1] - piece[0][1]) < 0.5) found.at(-1).push(piece[1]);
    else found.push(piece);
  }
  return found;
}
