// Colours and shapes that maps and cameras share.

import { hue } from "./dom.js";

export const EGO = "rgb(60 200 90)";
export const REFERENT = "rgb(255 84 70)";
export const GOAL = "rgb(60 220 255)";
export const CANDIDATE = "rgb(255 205 60)";
export const CHOSEN = "rgb(255 255 255)";
export const ANNOTATED = "rgb(150 230 150)";

/** The corners of a rectangle on the ground: front left, rear left, rear right, front right. */
export function footprint([x, y], yaw, length, width) {
  const [cos, sin] = [Math.cos(yaw), Math.sin(yaw)];
  const corner = (along, across) => [x + along * cos - across * sin, y + along * sin + across * cos];
  const [half, side] = [length / 2, width / 2];
  return [corner(half, side), corner(-half, side), corner(-half, -side), corner(half, -side)];
}

export const footprintOf = (vehicle) => footprint(vehicle.xy, vehicle.yaw, vehicle.size[0], vehicle.size[1]);

/** Whether a point is on a vehicle, or within a margin of it. */
export function covers(vehicle, x, y, margin = 0.4) {
  const [dx, dy] = [x - vehicle.xy[0], y - vehicle.xy[1]];
  const [cos, sin] = [Math.cos(vehicle.yaw), Math.sin(vehicle.yaw)];
  const [along, across] = [dx * cos + dy * sin, dy * cos - dx * sin];
  return Math.abs(along) <= vehicle.size[0] / 2 + margin && Math.abs(across) <= vehicle.size[1] / 2 + margin;
}

/** The colour and the width of the outline of a vehicle: what it is in the conversation, else its track. */
export function inkOf(vehicle, shown, chosen, tracks) {
  if (shown?.referents.includes(vehicle.id)) return { ink: REFERENT, width: 2.5, important: true };
  // A vehicle of several pairs has the numbers of all of them.
  const numbers = (shown?.candidates ?? []).filter((one) => one.ids.includes(vehicle.id)).map((one) => one.number);
  if (numbers.length) return { ink: CANDIDATE, width: 2, important: true, label: numbers.join(" ") };
  if (vehicle.id === chosen) return { ink: CHOSEN, width: 2.5, important: true };
  return { ink: tracks ? `hsl(${hue(vehicle.id)} 75% 68%)` : "rgb(235 238 245)", width: 1.5, important: false };
}

/** Stroke a line twice, so that it is seen on light and dark ground. */
export function stroke(context, ink, width, dash = []) {
  context.lineJoin = "round";
  context.setLineDash([]);
  context.lineWidth = width + 2;
  context.strokeStyle = "rgb(0 0 0 / 55%)";
  context.stroke();
  context.setLineDash(dash);
  context.lineWidth = width;
  context.strokeStyle = ink;
  context.stroke();
  context.setLineDash([]);
}

/** Begin a path through pixels. */
export function trace(context, points, closed = false) {
  context.beginPath();
  points.forEach(([column, row], n) => (n ? context.lineTo(column, row) : context.moveTo(column, row)));
  if (closed) context.closePath();
}

/** Write a short text on a dark round ground, centred. */
export function badge(context, text, [column, row], ink) {
  context.font = "600 12px system-ui, sans-serif";
  const half = Math.max(context.measureText(text).width / 2 + 4, 9);
  context.fillStyle = "rgb(10 14 20 / 85%)";
  context.beginPath();
  context.roundRect(column - half, row - 9, 2 * half, 18, 9);
  context.fill();
  context.fillStyle = ink;
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.fillText(text, column, row + 0.5);
}

/** Make a canvas as sharp as the screen; returns its size in pixels of the page and its cleared context. */
export function sized(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  const [columns, rows] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== columns || canvas.height !== rows) [canvas.width, canvas.height] = [columns, rows];
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return { width, height, context };
}
