// Fetches files with progress, and opens players.

import init, { Player } from "./ghand_web.js";

let starting = null;

// Starts the WebAssembly module, once for all players of a page. `globalThis.ghandWasm` may say where it is.
function start() {
  starting ??= init({ module_or_path: globalThis.ghandWasm ?? new URL("ghand.wasm", import.meta.url) });
  return starting;
}

/** A player on a canvas. Fails in one sentence where there is no WebGPU. */
export async function openPlayer(canvas) {
  if (!navigator.gpu) {
    const secure = globalThis.isSecureContext
      ? "use a current Chrome, Edge, Firefox or Safari, with hardware acceleration"
      : "open the page by https or from localhost";
    throw new Error(`This browser shows no WebGPU here; ${secure}.`);
  }
  await start();
  return Player.open(canvas);
}

/** Names of poses and of motions, once a player has been opened. */
export const poseNames = () => Player.poseNames();
export const motionNames = () => Player.motionNames();

const shortName = (url) => (url.startsWith("data:") ? "the avatar" : url);

/** The bytes at a URL. `onProgress` gets bytes loaded and, if the server says, in all (else 0). */
export async function fetchBytes(url, signal, onProgress = () => {}) {
  let response;
  try {
    response = await fetch(url, { signal });
  } catch (error) {
    if (signal?.aborted) throw error;
    const elsewhere = new URL(url, location.href).origin !== location.origin;
    const remedy = elsewhere
      ? "its server must be reachable and allow this page (Access-Control-Allow-Origin)"
      : "is it there, and does the page come from a server?";
    throw new Error(`${shortName(url)} cannot be fetched; ${remedy}`);
  }
  if (!response.ok) throw new Error(`${shortName(url)} cannot be fetched: ${response.status} ${response.statusText}`);
  const total = response.headers.get("Content-Encoding") ? 0 : Number(response.headers.get("Content-Length") ?? 0);
  const parts = [];
  let loaded = 0;
  const reader = response.body.getReader();
  for (;;) {
    const { done, value } = await reader.read();
    if (done) break;
    parts.push(value);
    loaded += value.length;
    onProgress(loaded, total);
  }
  const bytes = new Uint8Array(loaded);
  let at = 0;
  for (const part of parts) {
    bytes.set(part, at);
    at += part.length;
  }
  return bytes;
}
