// Elements. Text is only ever set as text: names of recordings and sentences are not trusted.

export const byId = (id) => document.getElementById(id);

/** Make an element: properties are set as such, `on...` are listeners, children are elements or text. */
export function make(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name.startsWith("aria-") || name === "role") element.setAttribute(name, value);
    else element[name] = value;
  }
  element.append(...children.filter((child) => child !== null && child !== undefined));
  return element;
}

/** Fill a <select> with [value, text] pairs; one that has a single choice is disabled. */
export function fill(select, pairs, chosen) {
  select.replaceChildren(...pairs.map(([value, text]) => make("option", { value, textContent: text })));
  select.value = chosen;
  select.disabled = pairs.length < 2;
}

/** A small square of a colour [r, g, b]. */
export function chip(rgb) {
  const square = make("span", { className: rgb ? "chip" : "chip none" });
  if (rgb) square.style.backgroundColor = `rgb(${rgb.join(" ")})`;
  return square;
}

/** Degrees of a hue that stays the same for a name: green, blue or violet, as red, amber and cyan have a meaning. */
export function hue(name) {
  let sum = 0;
  for (const character of name) sum = (sum * 31 + character.codePointAt(0)) % 9973;
  const degrees = (sum * 137.5) % 190;
  return degrees < 70 ? 90 + degrees : 140 + degrees;
}

export const metres = (value) => `${Math.abs(value).toFixed(1)} m`;

/** A place in words: "12.0 m ahead, 3.5 m to the right". */
export function place(x, y) {
  return `${metres(x)} ${x < 0 ? "behind" : "ahead"}, ${metres(y)} to the ${y < 0 ? "right" : "left"}`;
}
