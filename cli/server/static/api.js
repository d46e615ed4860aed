// Requests to the server. A lost connection is told once, and again when it is back.

import { byId } from "./dom.js";

const PATIENCE_MS = 30000;

export class Refused extends Error {
  constructor(message, status) {
    super(message);
    this.status = status;
  }
}

async function request(path, options = {}) {
  let response;
  try {
    response = await fetch(path, { ...options, signal: AbortSignal.timeout(PATIENCE_MS) });
  } catch {
    lost();
    throw new Refused("No answer from appocc serve.", 0);
  }
  found();
  if (response.ok) return response;
  let reason = `error ${response.status}`;
  try {
    reason = (await response.json()).error;
  } catch {
    // not from the server itself
  }
  throw new Refused(reason, response.status);
}

export const get = async (path) => (await request(path)).json();

export const blob = async (path) => (await request(path)).blob();

export const post = async (path, body = {}) => {
  const headers = { "content-type": "application/json" };
  return (await request(path, { method: "POST", headers, body: JSON.stringify(body) })).json();
};

let waiting = null;

function lost() {
  tell("The connection to appocc serve is lost. Trying again…", "connection");
  waiting ??= setInterval(() => request("/api/jobs").catch(() => {}), 2000);
}

function found() {
  if (waiting === null) return;
  clearInterval(waiting);
  waiting = null;
  hush("connection");
  window.dispatchEvent(new Event("reconnected"));
}

/** Show a message above the page; `kind` names it for `hush`. */
export function tell(text, kind = "error") {
  const banner = byId("banner");
  banner.textContent = text;
  banner.dataset.kind = kind;
  banner.hidden = false;
}

/** Take a message away. */
export function hush(kind = "error") {
  const banner = byId("banner");
  if (banner.dataset.kind === kind) banner.hidden = true;
}
