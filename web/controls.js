// The panel of the attribute `controls`: poses, motions, light, layers, view, joints, live poses.

const SIDES = ["back", "palm", "thumb-side", "little-finger-side", "fingertips"];

function make(tag, properties = {}, ...children) {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}

const labelled = (text, control) => make("label", {}, make("span", { textContent: text }), control);
const spoken = (name) => name.replaceAll("-", " ").replace(/^./, (c) => c.toUpperCase());

function choice(names, onChoose) {
  const options = ["", ...names].map((name) => make("option", { value: name, textContent: name ? spoken(name) : "" }));
  const select = make("select", {}, ...options);
  select.onchange = () => { if (select.value) onChoose(select.value); };
  return select;
}

export class Controls {
  #avatar;
  #body = make("div");
  #sliders = [];
  #time = null;
  #button = null;
  #poses = null;
  #motions = null;
  #layer = null;
  #live = make("div", { className: "note" });

  /** A panel for an element <ghand-avatar>. */
  constructor(avatar) {
    this.#avatar = avatar;
    this.#live.setAttribute("role", "status");
    this.element = make("details", { className: "controls", open: true },
      make("summary", { textContent: "Hand" }), this.#body);
  }

  remove() {
    this.element.remove();
  }

  sayLive(text) {
    this.#live.textContent = text;
  }

  /** Makes the controls for the hands that are there now. */
  update() {
    const avatar = this.#avatar;
    const attempt = (act) => async (value) => {
      try {
        await act(value);
      } catch (error) {
        this.sayLive(error.message);
      }
    };
    this.#poses = choice(avatar.poses, attempt((name) => avatar.pose(name)));
    this.#motions = choice(avatar.motions, attempt((name) => avatar.play(name)));
    this.#button = make("button", { type: "button" });
    this.#button.onclick = () => (avatar.paused ? avatar.resume() : avatar.pause());
    this.#time = make("input", { type: "range", min: 0, max: 1, step: "any", value: 0, ariaLabel: "Time" });
    this.#time.oninput = () => {
      avatar.pause();
      avatar.seek(Number(this.#time.value));
    };
    const parts = [labelled("Pose", this.#poses), labelled("Motion", this.#motions),
      make("div", { className: "row" }, this.#button, this.#time),
      labelled("View", choice(SIDES, attempt((side) => avatar.camera(side))))];
    if (avatar.hands.length > 0 && avatar.hands.every((hand) => hand.relightable)) parts.push(...this.#light(attempt));
    this.#layer = null;
    const layers = (avatar.hands[0]?.layers ?? []).filter((layer) => avatar.hands.every((hand) => hand.layers.includes(layer)));
    if (layers.length > 1) parts.push(this.#layers(layers, attempt));
    if (avatar.hasAttribute("mediapipe")) {
      const webcam = make("button", { type: "button", textContent: "Webcam" });
      webcam.onclick = attempt(() => avatar.webcam());
      const stop = make("button", { type: "button", textContent: "Stop" });
      stop.onclick = () => avatar.stopLive();
      parts.push(make("div", { className: "row" }, webcam, stop));
    }
    this.#sliders = [];
    avatar.hands.forEach((hand, k) => parts.push(this.#joints(hand, k, attempt)));
    this.#body.replaceChildren(...parts, this.#live);
    this.stepped();
    this.changed();
  }

  #light(attempt) {
    const avatar = this.#avatar;
    const light = choice(["capture", "studio"], () => change());
    light.firstChild.remove();
    light.value = avatar.getAttribute("light") ?? "capture";
    const turn = make("input", { type: "range", min: -180, max: 180, step: 1, value: avatar.getAttribute("light-turn") ?? 0 });
    const change = attempt(() => avatar.light(light.value, Number(turn.value)));
    turn.oninput = change;
    return [labelled("Light", light), labelled("Turn", turn)];
  }

  #layers(layers, attempt) {
    const avatar = this.#avatar;
    const layer = choice(layers, attempt((name) => avatar.layer(name)));
    layer.firstChild.remove();
    this.#layer = layer;
    return labelled("Show", layer);
  }

  #joints(hand, k, attempt) {
    const body = make("div", { className: "joints" });
    for (const joint of hand.joints.filter((joint) => joint.limits)) {
      for (const [angle, [low, high]] of Object.entries(joint.limits).filter(([, [low, high]]) => high > low)) {
        const slider = make("input", { type: "range", min: low, max: high, step: 0.01 });
        const set = attempt(() => this.#avatar.setJoints({ [joint.name]: { [angle]: Number(slider.value) } }, { hand: k }));
        slider.oninput = set;
        slider.ariaLabel = `${joint.name}, ${angle}`;
        body.append(labelled(`${joint.name} ${{ flexion: "⤵", abduction: "↔", twist: "↻" }[angle]}`, slider));
        this.#sliders.push({ slider, hand: k, joint: joint.name, angle });
      }
    }
    const title = this.#avatar.hands.length > 1 ? `Joints, ${hand.side} hand` : "Joints";
    return make("details", {}, make("summary", { textContent: title }), body);
  }

  /** A pose has been set: by a control or by the page. */
  changed() {
    const avatar = this.#avatar;
    if (this.#poses) {
      this.#poses.value = avatar.shown.pose;
      this.#motions.value = avatar.shown.motion;
    }
    if (this.#layer) this.#layer.value = avatar.shown.layer;
    if (!this.element.querySelector("details[open]")) return;
    for (const { slider, hand, joint, angle } of this.#sliders) {
      const angles = slider.matches(":active") ? null : avatar.angles(joint, hand);
      if (angles) slider.value = angles[angle];
    }
  }

  /** Time has passed. */
  stepped() {
    if (!this.#button) return;
    const playback = this.#avatar.playback();
    this.#time.parentElement?.toggleAttribute("hidden", !playback);
    if (!playback) return;
    this.#time.max = playback.duration;
    if (!this.#time.matches(":active")) this.#time.value = playback.time;
    this.#button.textContent = playback.playing ? "Pause" : "Play";
  }
}
