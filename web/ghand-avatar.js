// The element <ghand-avatar>: shows avatars of ghand in a page. ghand-avatar.d.ts describes it.

import { Controls } from "./controls.js";
import { fetchBytes, motionNames, openPlayer, poseNames } from "./loading.js";
import { followSocket, followWebcam, xrPacket } from "./live.js";
import { followPointer } from "./pointer.js";
import { STYLE } from "./style.js";

// Longest time that passes at once, seconds: a page that was hidden goes on where it was.
const LONGEST_STEP = 0.5;
const TRANSITION = 0.3;
// A lost device is known this long after it shows, milliseconds.
const LOSS_MS = 500;

const nameOf = (url) => (url.startsWith("data:") ? "avatar.ghand" : decodeURIComponent(url.split(/[?#]/)[0].split("/").pop()));
const textOf = (error) => (error instanceof Error ? error.message : String(error)).split("\n")[0];

export class GhandAvatar extends HTMLElement {
  static observedAttributes = ["src", "pose", "motion", "light", "light-turn", "layer", "controls", "connect", "poster", "alt"];

  #player = null;
  #canvas;
  #message;
  #controls = null;
  #hands = [];
  #loading = null;
  #frame = 0;
  #drawn = false;
  #settling = false;
  #before = 0;
  #visible = true;
  #stopLive = null;
  #driven = false;
  #named = { pose: "", motion: "" };
  #observers = [];
  #ready;

  constructor() {
    super();
    const root = this.attachShadow({ mode: "open" });
    const style = document.createElement("style");
    style.textContent = STYLE;
    this.#canvas = document.createElement("canvas");
    this.#canvas.tabIndex = 0;
    this.#canvas.setAttribute("role", "img");
    this.#message = document.createElement("div");
    this.#message.className = "message";
    this.#message.setAttribute("role", "status");
    root.append(style, this.#canvas, this.#message);
    followPointer(this.#canvas, {
      orbit: (x, y) => this.#view("orbit", x, y),
      pan: (x, y, edge) => this.#view("pan", x, y, edge),
      zoomAt: (factor, x, y, edge) => this.#view("zoomAt", factor, x, y, edge),
      face: () => this.#view("face"),
      toggle: () => this.paused ? this.resume() : this.pause(),
    });
    root.addEventListener("dragover", (event) => event.preventDefault());
    root.addEventListener("drop", (event) => this.#drop(event));
    this.#describe();
  }

  connectedCallback() {
    const resized = new ResizeObserver(() => this.#resize());
    resized.observe(this);
    const seen = new IntersectionObserver(([entry]) => {
      this.#visible = entry.isIntersecting;
      this.#invalidate();
    });
    seen.observe(this);
    this.#observers = [resized, seen];
    this.#showControls();
    this.#ready = this.#load();
    // Who does not wait for `ready` gets the event.
    this.#ready.catch(() => {});
  }

  disconnectedCallback() {
    this.#loading?.abort();
    this.stopLive();
    cancelAnimationFrame(this.#frame);
    this.#frame = 0;
    this.#observers.forEach((observer) => observer.disconnect());
    this.#close();
  }

  attributeChangedCallback(name, before, value) {
    if (!this.isConnected || before === value) return;
    if (name === "src") {
      this.#ready = this.#load();
      this.#ready.catch(() => {});
    } else if (name === "controls") {
      this.#showControls();
    } else if (name === "alt" || name === "poster") {
      this.#describe();
    } else if (this.#player) {
      this.#attempt(() => this.#take(name));
    }
  }

  /** Resolves when the avatars are shown; rejects with one sentence if they cannot be. */
  get ready() {
    return this.#ready ?? Promise.reject(new Error("the element is not in a page"));
  }

  /** What the hands are. */
  get hands() {
    return this.#hands;
  }

  get poses() {
    return poseNames();
  }

  get motions() {
    return motionNames();
  }

  /** The graphics adapter. */
  get device() {
    return this.#open().device();
  }

  /** Goes to a pose; see the types. */
  pose(pose, { hand = null, seconds = TRANSITION } = {}) {
    const player = this.#open();
    for (const k of this.#chosen(hand)) {
      if (typeof pose === "string") player.poseNamed(k, pose, seconds);
      else if (ArrayBuffer.isView(pose)) player.poseOf(k, Float32Array.from(pose), seconds);
      else if (Array.isArray(pose)) player.poseOf(k, Float32Array.from(pose.flat()), seconds);
      else player.playFile(k, "pose", new TextEncoder().encode(JSON.stringify(pose)), false);
    }
    this.#name({ pose: typeof pose === "string" ? pose : "" });
  }

  /** Axis-angle vectors of the joints of a hand, then its translation. */
  joints(hand = 0) {
    return this.#open().pose(hand);
  }

  /** Sets joints by name. */
  setJoints(joints, { hand = 0 } = {}) {
    const player = this.#open();
    const names = this.#hands[hand]?.joints.map((joint) => joint.name) ?? [];
    const pose = player.pose(hand);
    const angles = [];
    for (const [name, value] of Object.entries(joints)) {
      const k = names.indexOf(name);
      if (k < 0) throw new Error(`there is no joint "${name}"; there are ${names.join(", ")}`);
      if (Array.isArray(value) || ArrayBuffer.isView(value)) {
        if (value.length !== 3) throw new Error(`joint "${name}" needs an axis-angle vector of three numbers`);
        pose.set(value, 3 * k);
      } else {
        angles.push([k, value]);
      }
    }
    player.poseOf(hand, pose, 0);
    for (const [k, value] of angles) {
      const now = player.angles(hand, k);
      if (!now) throw new Error(`joint "${names[k]}" has no known axes; give an axis-angle vector`);
      const [flexion, abduction, twist] = now;
      const all = { flexion, abduction, twist, ...value };
      player.setAngles(hand, k, all.flexion, all.abduction, all.twist);
    }
    this.#name({});
  }

  /** Flexion, abduction and twist of a joint by name, radians; null if its axes are unknown. */
  angles(name, hand = 0) {
    const k = this.#hands[hand]?.joints.findIndex((joint) => joint.name === name) ?? -1;
    const found = k < 0 ? null : this.#open().angles(hand, k);
    return found ? { flexion: found[0], abduction: found[1], twist: found[2] } : null;
  }

  /** Plays a motion by name, a URL or a file of poses. */
  async play(motion, { hand = null, repeat = true, speed = 1 } = {}) {
    const player = this.#open();
    const named = typeof motion === "string" && motionNames().includes(motion);
    let bytes = null;
    if (!named) {
      const isUrl = typeof motion === "string" || motion instanceof URL;
      if (isUrl && !/[./:]/.test(String(motion))) {
        throw new Error(`there is no motion "${motion}"; there are ${motionNames().join(", ")}`);
      }
      if (isUrl) bytes = await fetchBytes(String(motion), this.#loading?.signal);
      else if (motion instanceof Blob) bytes = new Uint8Array(await motion.arrayBuffer());
      else bytes = new TextEncoder().encode(JSON.stringify(motion));
      if (player !== this.#player) throw new Error("the player was closed meanwhile");
    }
    const name = motion instanceof File ? motion.name : typeof motion === "object" ? "poses" : nameOf(String(motion));
    const remarks = [];
    for (const k of this.#chosen(hand)) {
      if (named) player.playNamed(k, motion, repeat);
      else remarks.push(...player.playFile(k, name, bytes, repeat));
      player.setSpeed(k, speed);
    }
    for (const remark of new Set(remarks)) console.warn(`${name}: ${remark}`);
    this.#name({ motion: named ? motion : "" });
  }

  pause() {
    this.#hands.forEach((_, k) => this.#open().setPlaying(k, false));
    this.#changed();
  }

  resume() {
    this.#hands.forEach((_, k) => this.#open().setPlaying(k, true));
    this.#changed();
  }

  /** Whether no motion is played. */
  get paused() {
    return !this.#hands.some((_, k) => this.playback(k)?.playing);
  }

  /** The motion of a hand: time, duration (seconds), playing, repeat, speed; null if there is none. */
  playback(hand = 0) {
    return JSON.parse(this.#player?.playback(hand) ?? "null");
  }

  /** Goes to a time of the motions, seconds. */
  seek(seconds) {
    this.#hands.forEach((_, k) => this.#open().seek(k, seconds));
    this.#changed();
  }

  /** Sets and returns the view; see the types. */
  camera(view) {
    const player = this.#open();
    if (typeof view === "string") {
      player.lookFrom(view);
      player.frame();
    } else if (view) {
      const now = JSON.parse(player.view() ?? "{}");
      const { position, target, up, fov } = { ...now, ...view };
      player.lookAt(Float64Array.from([position, target, up].flat()), fov);
    }
    this.#invalidate();
    return JSON.parse(player.view() ?? "null");
  }

  /** Puts the hands into `capture` or `studio` light, turned about the vertical, degrees. */
  light(name, turn = 0) {
    this.#open().setLight(name, turn);
    this.#changed();
  }

  /** Shows a layer of all hands: `skin`, `albedo` or `views`. */
  layer(name) {
    this.#open().setLayer(name);
    this.#changed();
  }

  /** A picture in any size, over a background of display values from 0 to 1. */
  async picture({ width = this.#canvas.width, height = this.#canvas.height, background = [1, 1, 1] } = {}) {
    return new ImageData(await this.#open().picture(width, height, ...background), width, height);
  }

  /** Drives the hands by a packet of live poses: an object, text or bytes. */
  packet(packet, { inPlace = true } = {}) {
    const text = typeof packet === "string" || ArrayBuffer.isView(packet) ? packet : JSON.stringify(packet);
    const bytes = typeof text === "string" ? new TextEncoder().encode(text) : text;
    this.#open().packet(bytes, performance.now() / 1000, inPlace);
    this.#name({});
  }

  /** Drives the hands by packets of a WebSocket. */
  connect(url) {
    this.stopLive();
    this.#stopLive = followSocket(url, (data) => this.#live(data), (text) => this.#sayLive(`Live: ${text}`));
  }

  /** Drives the hands by a webcam or a <video>, with MediaPipe from a folder that the page's owner serves. */
  async webcam({ mediapipe = this.getAttribute("mediapipe"), video = null } = {}) {
    if (!mediapipe) throw new Error("MediaPipe is missing: give its folder as the attribute mediapipe or in webcam({ mediapipe })");
    this.stopLive();
    const player = this.#open();
    const stop = await followWebcam(mediapipe, video, (data) => this.#live(data), (text) => this.#sayLive(`Webcam: ${text}`));
    if (player === this.#player) this.#stopLive = stop;
    else stop();
  }

  /** Drives the hands by a frame of the page's own WebXR session with hand tracking. Says whether it showed a hand. */
  xrFrame(frame, referenceSpace, options) {
    const packet = xrPacket(frame, referenceSpace);
    if (packet) this.packet(packet, options);
    return packet !== null;
  }

  /** Stops webcam and WebSocket. */
  stopLive() {
    this.#stopLive?.();
    this.#stopLive = null;
    this.#driven = false;
    this.#controls?.sayLive("");
  }

  /** Loses the graphics device, as a reset driver does: for tests of a page. */
  loseDevice() {
    this.#open().lose();
    this.#invalidate();
  }

  #open() {
    if (!this.#player) throw new Error("the player is closed or not ready; wait for `ready`");
    return this.#player;
  }

  #chosen(hand) {
    return hand === null ? this.#hands.map((_, k) => k) : [hand];
  }

  #close() {
    this.#player?.free();
    this.#player = null;
    this.#hands = [];
  }

  async #load() {
    this.#loading?.abort();
    this.#loading = new AbortController();
    const { signal } = this.#loading;
    const sources = (this.getAttribute("src") ?? "").split(/\s+/).filter(Boolean);
    try {
      this.#say("Loading");
      const [player, ...files] = await Promise.all([openPlayer(this.#canvas), ...this.#fetchAll(sources, signal)]);
      if (signal.aborted) {
        player.free();
        throw new DOMException("another avatar was asked for", "AbortError");
      }
      this.#close();
      this.#use(player);
      files.forEach((bytes, k) => player.add(nameOf(sources[k]), bytes));
      this.#arrived();
      this.#attempt(() => ["pose", "motion", "light", "layer", "connect"].forEach((name) => this.#take(name)));
    } catch (error) {
      if (signal.aborted) throw error;
      this.#close();
      this.#fail(textOf(error));
      throw error;
    }
  }

  #fetchAll(sources, signal) {
    const states = sources.map(() => [0, 0]);
    return sources.map((url, k) => fetchBytes(url, signal, (loaded, total) => {
      states[k] = [loaded, total];
      const sum = (i) => states.reduce((all, state) => all + state[i], 0);
      const known = states.every((state) => state[1] > 0);
      const detail = { loaded: sum(0), total: known ? sum(1) : 0 };
      this.#say(known ? `Loading: ${Math.round(100 * detail.loaded / detail.total)} %` : "Loading");
      this.dispatchEvent(new CustomEvent("progress", { detail }));
    }));
  }

  // The player has other hands.
  #arrived() {
    this.#hands = Array.from({ length: this.#player.count() }, (_, k) => JSON.parse(this.#player.describe(k)));
    this.#named = { pose: "", motion: "" };
    this.#say("");
    this.#controls?.update();
    this.#drawn = false;
    this.#resize();
  }

  // Does what an attribute says.
  #take(name) {
    const value = this.getAttribute(name);
    if (name === "pose" && value) this.pose(value, { seconds: this.#drawn ? TRANSITION : 0 });
    if (name === "motion") {
      if (value) this.play(value).catch((error) => this.#warn(error));
      else if (this.#drawn) this.pause();
    }
    if (name === "light" || name === "light-turn") {
      const turn = Number(this.getAttribute("light-turn") ?? 0);
      if (this.#drawn || this.hasAttribute("light") || turn !== 0) this.light(this.getAttribute("light") ?? "capture", turn);
    }
    if (name === "layer" && (value || this.#drawn)) this.layer(value || "skin");
    if (name === "connect") {
      if (value) this.connect(value);
      else this.stopLive();
    }
  }

  #attempt(act) {
    try {
      act();
    } catch (error) {
      this.#warn(error);
    }
  }

  /** The names of the pose or motion that is shown; "" for others; and the layer. */
  get shown() {
    return { ...this.#named, layer: this.#player?.layer() ?? "skin" };
  }

  #name({ pose = "", motion = "" }) {
    this.#named = { pose, motion };
    this.#changed();
  }

  // What the hands show has changed.
  #changed() {
    this.#controls?.changed();
    this.#invalidate();
  }

  #view(name, ...values) {
    if (!this.#player) return;
    this.#player[name](...values);
    this.#invalidate();
  }

  #live(data) {
    if (!this.#player) return;
    try {
      this.packet(data);
      // As the tracker's camera sees it.
      if (!this.#driven) this.#view("lookAsTracker");
      this.#driven = true;
    } catch (error) {
      this.#sayLive(`Live: ${textOf(error)}`);
    }
  }

  #sayLive(text) {
    this.#controls?.sayLive(text);
    this.dispatchEvent(new CustomEvent("live", { detail: { message: text } }));
  }

  async #drop(event) {
    event.preventDefault();
    const [file] = event.dataTransfer?.files ?? [];
    if (!file) return;
    try {
      if (/\.ghand$/i.test(file.name)) {
        const bytes = new Uint8Array(await file.arrayBuffer());
        const player = this.#open();
        player.clear();
        player.add(file.name, bytes);
        this.#arrived();
      } else {
        await this.play(file);
      }
    } catch (error) {
      if (this.#player?.count() === 0) this.#hands = [];
      this.#warn(error);
      this.#invalidate();
    }
  }

  #resize() {
    const scale = globalThis.devicePixelRatio || 1;
    const [width, height] = [this.clientWidth, this.clientHeight].map((edge) => Math.max(1, Math.round(edge * scale)));
    if (this.#canvas.width !== width || this.#canvas.height !== height) {
      [this.#canvas.width, this.#canvas.height] = [width, height];
    }
    this.#invalidate();
  }

  #invalidate() {
    this.#settling = false;
    if (this.#frame || !this.#player || !this.#visible) return;
    this.#before = 0;
    this.#frame = requestAnimationFrame((now) => this.#step(now));
  }

  #step(now) {
    this.#frame = 0;
    if (!this.#player || !this.#visible) return;
    if (this.#player.busy() || (this.#settling && !this.#player.idle())) {
      this.#frame = requestAnimationFrame((next) => this.#step(next));
      return;
    }
    const passed = this.#before ? Math.min((now - this.#before) / 1000, LONGEST_STEP) : 0;
    this.#before = now;
    try {
      const moves = this.#player.advance(passed);
      const again = this.#player.draw();
      if (!this.#drawn) {
        this.#drawn = true;
        this.dispatchEvent(new CustomEvent("load", { detail: { hands: this.#hands } }));
      }
      this.#controls?.stepped();
      this.dispatchEvent(new CustomEvent("frame"));
      // Whether a picture lacked Gaussians is known when the device has drawn it: a still one is drawn once more then.
      const wasSettling = this.#settling;
      this.#settling = !moves && !again;
      if (!wasSettling || !this.#settling) this.#frame = requestAnimationFrame((next) => this.#step(next));
    } catch (error) {
      this.#drawingFailed(textOf(error));
    }
  }

  // Shows a player's hands. If its device is lost, another one is opened for them.
  #use(player) {
    this.#player = player;
    player.lost().then((reason) => {
      if (player === this.#player) this.#reopen(`the graphics device was lost: ${reason}`);
    });
  }

  async #reopen(reason) {
    const before = this.#player;
    this.#player = null;
    this.dispatchEvent(new CustomEvent("devicelost", { detail: { message: reason } }));
    try {
      const player = await openPlayer(this.#canvas);
      player.take(before);
      if (!this.isConnected) {
        player.free();
        return;
      }
      this.#use(player);
      this.dispatchEvent(new CustomEvent("devicerestored"));
      this.#invalidate();
    } catch (error) {
      this.#fail(`${reason}; it could not be opened again: ${textOf(error)}`);
    }
  }

  // A lost device may show itself by a failure first.
  #drawingFailed(reason) {
    const player = this.#player;
    setTimeout(() => {
      if (player !== this.#player) return;
      this.#close();
      this.#fail(reason);
    }, LOSS_MS);
  }

  // One sentence in place of the picture, over the poster.
  #fail(text) {
    this.#say(text, true);
    this.dispatchEvent(new CustomEvent("error", { detail: { message: text } }));
  }

  // One sentence beside the picture, which stays.
  #warn(error) {
    const message = textOf(error);
    this.#say(message);
    this.dispatchEvent(new CustomEvent("error", { detail: { message } }));
  }

  #say(text, failed = false) {
    this.#message.textContent = text;
    this.classList.toggle("failed", failed);
    this.#describe();
  }

  #describe() {
    const hands = this.#hands.map(({ side }) => `a ${side} hand`).join(" and ");
    this.#canvas.setAttribute("aria-label", this.getAttribute("alt") ?? (hands ? `Avatar of ${hands}` : "Avatar of a hand"));
    const poster = this.getAttribute("poster");
    const shows = poster && !this.#player;
    this.#canvas.style.backgroundImage = shows ? `url("${poster.replace(/["\\]/g, "\\$&")}")` : "";
  }

  #showControls() {
    if (!this.hasAttribute("controls")) {
      this.#controls?.remove();
      this.#controls = null;
    } else if (!this.#controls) {
      this.#controls = new Controls(this);
      this.shadowRoot.append(this.#controls.element);
      if (this.#player) this.#controls.update();
    }
  }
}

if (!customElements.get("ghand-avatar")) customElements.define("ghand-avatar", GhandAvatar);
