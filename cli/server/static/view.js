// What part of the ground the maps show: all maps of the page share it, so that they can be compared.

const LEAST = 0.5;
const MOST = 60;
const STEP = 1.25;
const FILL = 1.3;

/** A view in metres of the ego frame (x ahead, y left); scale 1 shows about the whole grid. */
export class View {
  constructor(changed) {
    this.changed = changed;
    this.reset();
  }

  reset() {
    [this.x, this.y, this.scale] = [null, null, 1];
    this.changed();
  }

  zoom(factor, x = this.x, y = this.y) {
    const scale = Math.min(Math.max(this.scale * factor, LEAST), MOST);
    const share = this.scale / scale;
    if (this.x !== null) [this.x, this.y] = [x + (this.x - x) * share, y + (this.y - y) * share];
    this.scale = scale;
    this.changed();
  }

  /** What the keys of the page do to the view. */
  get keys() {
    const [closer, farther] = [() => this.zoom(STEP), () => this.zoom(1 / STEP)];
    return { "+": closer, "=": closer, "-": farther, 0: () => this.reset() };
  }

  /** Return the functions between metres and pixels of a canvas of a size, for a grid. */
  on(width, height, grid) {
    const middle = [(grid.x[0] + grid.x[1]) / 2, (grid.y[0] + grid.y[1]) / 2];
    if (this.x === null) [this.x, this.y] = middle;
    const fits = [height / (grid.x[1] - grid.x[0]), width / (grid.y[1] - grid.y[0])];
    // Scale 1 shows the whole grid, or a little less of it where that fills an oblong canvas.
    const perMetre = Math.min(Math.max(...fits), FILL * Math.min(...fits)) * this.scale;
    return {
      perMetre,
      pixel: ([x, y]) => [width / 2 - (y - this.y) * perMetre, height / 2 - (x - this.x) * perMetre],
      metres: (column, row) => [this.x - (row - height / 2) / perMetre, this.y - (column - width / 2) / perMetre],
    };
  }
}

/** Let wheel, drag, pinch and double click of a canvas change a view; `metres` maps its pixels to the ground. */
export function control(canvas, view, metres) {
  const fingers = new Map();
  const at = (event) => metres(event.offsetX, event.offsetY);
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    view.zoom(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015)), ...at(event));
  }, { passive: false });
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, event);
    canvas.dataset.moved = "";
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    const [x0, y0] = metres(before.offsetX, before.offsetY);
    const [x1, y1] = at(event);
    const far = Math.hypot(event.offsetX - before.offsetX, event.offsetY - before.offsetY);
    if (!canvas.dataset.moved && far < 4) return;
    canvas.dataset.moved = "yes";
    if (fingers.size === 2) pinch(view, fingers, event);
    fingers.set(event.pointerId, event);
    [view.x, view.y] = [view.x - (x1 - x0) / fingers.size, view.y - (y1 - y0) / fingers.size];
    view.changed();
  });
  for (const name of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(name, (event) => fingers.delete(event.pointerId));
  }
  canvas.addEventListener("dblclick", () => view.reset());
}

function pinch(view, fingers, event) {
  const other = [...fingers.values()].find((one) => one.pointerId !== event.pointerId);
  const before = fingers.get(event.pointerId);
  const apart = (one) => Math.hypot(one.offsetX - other.offsetX, one.offsetY - other.offsetY);
  if (apart(before) > 1) view.zoom(apart(event) / apart(before));
}
