// What the page shows, kept in its address: a page that is loaded again shows the same.

const LAYERS = ["colour", "road", "lane", "vehicle", "boxes", "tracks", "annotated", "truth"];
const SHOWN = ["colour", "boxes", "tracks", "truth"];
const listeners = [];

export const state = read();

function read() {
  const query = new URLSearchParams(location.search);
  const layers = query.has("layers") ? query.get("layers").split(" ") : SHOWN;
  return {
    recording: query.get("recording") ?? "",
    scene: Number(query.get("scene")) || 0,
    source: query.get("source") ?? "",
    frame: Number(query.get("frame")) || 0,
    layers: new Set(layers.filter((name) => LAYERS.includes(name))),
    vehicle: query.get("vehicle") ?? "",
    talk: query.get("talk") ?? "",
  };
}

/** Change parts of the state; listeners get the set of names that changed. */
export function change(parts) {
  const changed = new Set(Object.keys(parts).filter((name) => state[name] !== parts[name]));
  if (!changed.size) return;
  Object.assign(state, parts);
  remember();
  for (const listener of listeners) listener(changed);
}

export function onChange(listener) {
  listeners.push(listener);
}

let due = null;

/** Write the address, not more often than browsers allow. */
function remember() {
  due ??= setTimeout(() => {
    due = null;
    const query = new URLSearchParams();
    for (const [name, value] of Object.entries(state)) {
      const text = name === "layers" ? [...value].join(" ") : String(value);
      if (text || name === "layers") query.set(name, text);
    }
    history.replaceState(null, "", `?${query}`);
  }, 150);
}

/** The address of a key frame on the server, with a suffix such as "/map.png". */
export function address(suffix = "", frame = state.frame, source = state.source, more = {}) {
  const query = new URLSearchParams({ ...(source ? { source } : {}), ...more });
  return `/api/recordings/${state.recording}/${state.scene}/${frame}${suffix}?${query}`;
}
