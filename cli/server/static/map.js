// A map on a canvas: cells, vehicles, trails, and what the conversation is about.

import { cellAt, picture } from "./cells.js";
import {
  ANNOTATED, CHOSEN, EGO, GOAL, badge, covers, footprint, footprintOf, inkOf, sized, stroke, trace,
} from "./paint.js";
import { control } from "./view.js";

const FRONT_M = 0.9;
const RINGS_M = [10, 20, 30, 40];

export class MapCanvas {
  /** Show maps on a canvas; `hovered` and `clicked` get what is under the pointer. */
  constructor(canvas, view, { hovered, clicked }) {
    [this.canvas, this.view, this.data] = [canvas, view, null];
    const under = (event) => this.under(...this.metres(event.offsetX, event.offsetY));
    control(canvas, view, (column, row) => this.metres(column, row));
    canvas.addEventListener("pointermove", (event) => this.data && hovered(under(event)));
    canvas.addEventListener("pointerleave", () => hovered(null));
    canvas.addEventListener("click", (event) => this.data && !canvas.dataset.moved && clicked(under(event)));
  }

  /** Show {sheet, grid, predicted, layers, vehicles, boxes, ego, shown, chosen, path}; null for none. */
  show(data) {
    this.data = data;
    this.draw();
  }

  metres(column, row) {
    return this.data ? this.place.metres(column, row) : [0, 0];
  }

  under(x, y) {
    const { sheet, grid, vehicles, layers } = this.data;
    const near = vehicles.filter((one) => layers.has("boxes") && covers(one, x, y));
    near.sort((one, other) => Math.hypot(one.xy[0] - x, one.xy[1] - y) - Math.hypot(other.xy[0] - x, other.xy[1] - y));
    return { x, y, cell: sheet && cellAt(sheet, grid, x, y), vehicle: near[0] ?? null };
  }

  draw() {
    const { width, height, context } = sized(this.canvas);
    if (!this.data || !width) return;
    const { grid } = this.data;
    this.place = this.view.on(width, height, grid);
    this.context = context;
    this.#cells(grid);
    this.#rings();
    this.#vehicles();
    this.#ego();
    if (this.data.shown) this.#answer(this.data.shown);
  }

  #line(points, ink, width, { closed = false, dash = [] } = {}) {
    trace(this.context, points.map(this.place.pixel), closed);
    stroke(this.context, ink, width, dash);
  }

  #cells(grid) {
    const { context, place, data } = this;
    const [left, top] = place.pixel([grid.x[1], grid.y[1]]);
    const [right, bottom] = place.pixel([grid.x[0], grid.y[0]]);
    context.fillStyle = hatch(context);
    context.fillRect(left, top, right - left, bottom - top);
    if (!data.sheet) return;
    context.imageSmoothingEnabled = false;
    context.drawImage(picture(data.sheet, data.layers, data.predicted), left, top, right - left, bottom - top);
  }

  #rings() {
    const { context, place } = this;
    const [column, row] = place.pixel([0, 0]);
    context.strokeStyle = "rgb(255 255 255 / 16%)";
    context.fillStyle = "rgb(255 255 255 / 65%)";
    context.lineWidth = 1;
    context.font = "11px system-ui, sans-serif";
    context.textAlign = "left";
    context.textBaseline = "bottom";
    for (const radius of RINGS_M) {
      context.beginPath();
      context.arc(column, row, radius * place.perMetre, 0, 2 * Math.PI);
      context.stroke();
      const aside = radius * place.perMetre * Math.SQRT1_2;
      if (place.perMetre * 10 > 28) context.fillText(`${radius} m`, column + aside + 2, row - aside - 1);
    }
  }

  #vehicles() {
    const { vehicles, boxes, layers, shown, chosen, path } = this.data;
    if (layers.has("annotated")) {
      for (const box of boxes.filter((one) => inside(this.data.grid, one.xy))) this.#line(footprintOf(box), ANNOTATED, 1, { closed: true, dash: [4, 3] });
    }
    if (layers.has("tracks")) {
      for (const one of vehicles.filter((each) => each.trail.length > 1)) {
        this.#line(one.trail, inkOf(one, shown, chosen, true).ink, 1.5);
      }
    }
    if (path) {
      this.#line(path.before, CHOSEN, 2);
      this.#line(path.after, CHOSEN, 1.5, { dash: [3, 5] });
    }
    const inked = vehicles.map((one) => [one, inkOf(one, shown, chosen, layers.has("tracks"))]);
    inked.sort(([, one], [, other]) => one.important - other.important);
    for (const [one, { ink, width, important }] of inked) {
      if (!important && !layers.has("boxes")) continue;
      this.#fill(one, important ? ink : null);
      this.#line(footprintOf(one), ink, width, { closed: true, dash: one.seen ? [] : [3, 3] });
      if (one.front_known) this.#line([one.xy, front(one)], ink, width);
    }
    for (const [one, { ink, label }] of inked) {
      if (label) badge(this.context, label, this.place.pixel(one.xy), ink);
    }
  }

  /** Fill a vehicle with its paint, which predicted cells show only faintly; or with a glow if it is important. */
  #fill(vehicle, glow) {
    const { layers, predicted } = this.data;
    const paint = layers.has("colour") && predicted && vehicle.rgb ? `rgb(${vehicle.rgb.join(" ")})` : null;
    trace(this.context, footprintOf(vehicle).map(this.place.pixel), true);
    this.context.fillStyle = paint ?? glow ?? "transparent";
    this.context.globalAlpha = paint ? 0.9 : 0.35;
    this.context.fill();
    this.context.globalAlpha = 1;
  }

  #ego() {
    const { length, width, rear } = this.data.ego;
    const middle = length / 2 - rear;
    this.#line(footprint([middle, 0], 0, length, width), EGO, 2, { closed: true });
    const nose = length - rear;
    this.#line([[nose - FRONT_M, width / 2], [nose, 0], [nose - FRONT_M, -width / 2]], EGO, 2);
  }

  #answer(shown) {
    for (const one of shown.runners_up) this.#line(one, "rgb(60 220 255 / 60%)", 1, { closed: true, dash: [4, 4] });
    for (const step of shown.steps) this.#line(step.footprint, GOAL, 1.5, { closed: true, dash: [2, 3] });
    if (shown.route) this.#line(shown.route, GOAL, 2.5, { dash: [7, 5] });
    if (shown.nearest) this.#goal(shown.nearest, CHOSEN, "rgb(255 255 255 / 25%)");
    if (shown.target) this.#goal(shown.target, GOAL, "rgb(60 220 255 / 40%)");
  }

  #goal({ footprint: foot, ego_m: middle, cell }, ink, ground) {
    trace(this.context, foot.map(this.place.pixel), true);
    this.context.fillStyle = ground;
    this.context.fill();
    this.#line(foot, ink, 2.5, { closed: true });
    const [a, , , d] = foot;
    this.#line([middle, [(a[0] + d[0]) / 2, (a[1] + d[1]) / 2]], ink, 2);
    this.#cell(cell);
  }

  /** Mark the goal cell itself. */
  #cell([i, j]) {
    const { x, y, cell } = this.data.grid;
    const [column, row] = this.place.pixel([x[0] + (i + 1) * cell, y[0] + (j + 1) * cell]);
    const side = Math.max(cell * this.place.perMetre, 3);
    this.context.fillStyle = GOAL;
    this.context.fillRect(column, row, side, side);
  }
}

const inside = (grid, [x, y]) => x >= grid.x[0] && x <= grid.x[1] && y >= grid.y[0] && y <= grid.y[1];

function front(vehicle) {
  const half = vehicle.size[0] / 2;
  return [vehicle.xy[0] + half * Math.cos(vehicle.yaw), vehicle.xy[1] + half * Math.sin(vehicle.yaw)];
}

let pattern = null;

/** The hatching of unknown cells. */
function hatch(context) {
  if (!pattern) {
    const tile = new OffscreenCanvas(12, 12);
    const inside = tile.getContext("2d");
    inside.fillStyle = "rgb(58 62 72)";
    inside.fillRect(0, 0, 12, 12);
    inside.strokeStyle = "rgb(84 90 104)";
    inside.lineWidth = 1.5;
    for (const shift of [-12, 0, 12]) {
      trace(inside, [[shift - 1, 13], [shift + 13, -1]]);
      inside.stroke();
    }
    pattern = context.createPattern(tile, "repeat");
  }
  return pattern;
}
