// The curves of trainings, drawn anew while they run.

import { blob } from "./api.js";
import { byId, fill } from "./dom.js";

const EVERY_MS = 5000;
let timer = null;

/** Offer the trainings of the opened folders. */
export function offerTrainings(names) {
  byId("curves").hidden = !names.length;
  const select = byId("training").querySelector("select");
  fill(select, names.map((name) => [name, name]), names.includes(select.value) ? select.value : names.at(-1));
}

async function look() {
  clearTimeout(timer);
  const dialog = byId("training");
  if (!dialog.open) return;
  const [image, line] = [dialog.querySelector("img"), dialog.querySelector("[role=status]")];
  try {
    const query = new URLSearchParams({ name: dialog.querySelector("select").value });
    const picture = await blob(`/api/curves?${query}`);
    URL.revokeObjectURL(image.src);
    image.src = URL.createObjectURL(picture);
    [image.hidden, line.textContent] = [false, ""];
  } catch (error) {
    [image.hidden, line.textContent] = [true, error.message];
  }
  timer = setTimeout(look, EVERY_MS);
}

byId("curves").addEventListener("click", () => {
  byId("training").showModal();
  look();
});
byId("training").querySelector("select").addEventListener("change", look);
