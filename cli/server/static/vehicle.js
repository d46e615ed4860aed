// The vehicle that is chosen: its card, and its path in the ego frame of the moment.

import { get } from "./api.js";
import { byId, chip, make } from "./dom.js";
import { address, change, state } from "./state.js";

export class ChosenVehicle {
  constructor(changed) {
    [this.changed, this.path, this.key] = [changed, null, ""];
  }

  /** Show the card of the chosen vehicle at a moment; `seeing` names the cameras that see a vehicle. */
  show(moment, seeing) {
    const section = byId("vehicle");
    const one = moment.vehicles.find((vehicle) => vehicle.id === state.vehicle);
    section.hidden = !state.vehicle;
    if (!state.vehicle) return;
    const close = make("button", { type: "button", title: "Let go (esc)", "aria-label": "Let go", onclick: () => change({ vehicle: "" }) }, "×");
    if (!one) {
      section.replaceChildren(close, make("p", {}, `${titleOf(state.vehicle)} is not in view here.`));
      return;
    }
    const speed = one.speed === null ? "speed unknown" : `${one.speed.toFixed(1)} m/s (${Math.round(3.6 * one.speed)} km/h)`;
    const cameras = seeing(one, moment).map((name) => name.replace(/^CAM_/, "").replaceAll("_", " ").toLowerCase());
    const [length, width] = one.size;
    const rows = [
      ["colour", [chip(one.rgb), one.colour ?? "unknown"]],
      ["speed", [speed]],
      ["distance", [`${one.distance} m`]],
      ["size", [`${length.toFixed(1)} × ${width.toFixed(1)} m`]],
      ["seen by", [cameras.join(", ") || "no camera"]],
      ...(one.score === null ? [] : [["certain", [`${Math.round(100 * one.score)} %${one.seen ? "" : ", not detected now"}`]]]),
    ];
    section.replaceChildren(
      close,
      make("h2", {}, titleOf(one.id, one.name)),
      make("dl", {}, ...rows.flatMap(([name, value]) => [make("dt", {}, name), make("dd", {}, ...value)])),
    );
  }

  /** Load the path of the chosen vehicle, if it is another one or far from the frame it was loaded at. */
  async follow() {
    const key = [state.recording, state.scene, state.source, state.vehicle, Math.floor(state.frame / 50)].join("|");
    if (key === this.key) return;
    [this.key, this.path] = [key, null];
    if (!state.vehicle || !state.source) return;
    try {
      this.path = (await get(address("/path", state.frame, state.source, { id: state.vehicle }))).points;
    } catch {
      return; // a vehicle of a single map has none
    }
    if (key === this.key) this.changed();
  }

  /** The path up to a moment and after it, in the ego frame; null without one. */
  at(moment) {
    if (!this.path || !state.vehicle) return null;
    const m = moment.world_from_ego;
    const inEgo = ([, x, y]) => {
      const [dx, dy] = [x - m[0][3], y - m[1][3]];
      return [m[0][0] * dx + m[1][0] * dy, m[0][1] * dx + m[1][1] * dy];
    };
    const before = this.path.filter(([k]) => k <= moment.frame).map(inEgo);
    const after = this.path.filter(([k]) => k >= moment.frame).map(inEgo);
    return { before, after };
  }
}

/** "Car, track 12"; ids of annotations are long and say nothing. */
function titleOf(id, name = "vehicle") {
  const kind = name.charAt(0).toUpperCase() + name.slice(1);
  return /^(track|object|blob) \d+$/.test(id) ? `${kind}, ${id}` : kind;
}
