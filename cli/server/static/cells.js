// Maps as exact values: colours, class probabilities and flags of every cell, and pictures composed of them.

import { blob } from "./api.js";

export const CLASSES = ["road", "vehicle", "lane"];
const CLASS_RGB = { road: [112, 112, 118], vehicle: [70, 130, 240], lane: [245, 205, 70] };
const DRAWN = ["road", "lane", "vehicle"];
// Colours of a prediction fade to this where no class is probable.
const NOTHING = [38, 41, 48];
const OVER_COLOUR = 0.6;

/** Read the sheet of a map (see `map_sheet` of the server): three pictures below each other. */
export async function loadSheet(path) {
  const options = { colorSpaceConversion: "none", premultiplyAlpha: "none" };
  const bitmap = await createImageBitmap(await blob(path), options);
  const canvas = new OffscreenCanvas(bitmap.width, bitmap.height);
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.drawImage(bitmap, 0, 0);
  const [columns, rows] = [bitmap.width, bitmap.height / 3];
  bitmap.close();
  const part = (n) => context.getImageData(0, n * rows, columns, rows).data;
  return { columns, rows, rgb: part(0), chance: part(1), flags: part(2), pictures: new Map() };
}

/** The picture of the chosen layers, a cell a pixel; unknown cells are clear. */
export function picture(sheet, layers, predicted) {
  const key = [...layers].filter((name) => name === "colour" || DRAWN.includes(name)).sort().join(" ");
  if (!sheet.pictures.has(key)) {
    sheet.pictures.clear();
    sheet.pictures.set(key, compose(sheet, layers, predicted));
  }
  return sheet.pictures.get(key);
}

function compose(sheet, layers, predicted) {
  const image = new ImageData(sheet.columns, sheet.rows);
  const classes = DRAWN.filter((name) => layers.has(name));
  for (let at = 0; at < image.data.length; at += 4) {
    const colour = layers.has("colour") ? colourOf(sheet, at, predicted) : null;
    let rgb = colour ?? (classes.length && sheet.flags[at] ? [20, 20, 20] : null);
    for (const name of classes) {
      if (!(sheet.flags[at + 1] & (1 << CLASSES.indexOf(name)))) continue;
      const share = colour ? OVER_COLOUR : 1;
      rgb = CLASS_RGB[name].map((value, n) => share * value + (1 - share) * rgb[n]);
    }
    if (rgb) image.data.set([...rgb, 255], at);
  }
  const canvas = new OffscreenCanvas(sheet.columns, sheet.rows);
  canvas.getContext("2d").putImageData(image, 0, 0);
  return canvas;
}

function colourOf(sheet, at, predicted) {
  if (!sheet.flags[at + 2]) return null;
  const rgb = sheet.rgb.subarray(at, at + 3);
  if (!predicted) return [...rgb];
  const opacity = (Math.max(sheet.chance[at], sheet.chance[at + 1], sheet.chance[at + 2]) / 255) ** 2;
  return [...rgb].map((value, n) => opacity * value + (1 - opacity) * NOTHING[n]);
}

/** The cell at a point in metres: indices, probabilities and colour; null outside of the grid. */
export function cellAt(sheet, grid, x, y) {
  const i = Math.floor((x - grid.x[0]) / grid.cell + 1e-9);
  const j = Math.floor((y - grid.y[0]) / grid.cell + 1e-9);
  if (i < 0 || j < 0 || i >= sheet.rows || j >= sheet.columns) return null;
  const at = 4 * ((sheet.rows - 1 - i) * sheet.columns + (sheet.columns - 1 - j));
  const chances = CLASSES.map((name, n) => (sheet.flags[at] & (1 << n) ? sheet.chance[at + n] / 255 : null));
  return { cell: [i, j], chances, rgb: sheet.flags[at + 2] ? [...sheet.rgb.subarray(at, at + 3)] : null };
}
