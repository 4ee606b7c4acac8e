// The checks of tests/browser.rs that run in a page. Each one's result, or its error, is posted to the test.

import "/ghand-avatar.js";

const SIZE = { width: 320, height: 240 };
const assert = (condition, text) => { if (!condition) throw new Error(text); };
const post = (path, body) => fetch(path, { method: "POST", body });
const event = (target, name) => new Promise((resolve) => target.addEventListener(name, resolve, { once: true }));
const messageOf = (promise) => promise.then(() => "nothing", (error) => error.message);
const thrown = (act) => { try { act(); return "nothing"; } catch (error) { return error.message; } };

// Waits for something that a busy machine may do late.
async function until(condition, text, interval = 50) {
  for (let begin = performance.now(); performance.now() < begin + 20_000;) {
    if (condition()) return;
    await new Promise((resolve) => setTimeout(resolve, interval));
  }
  throw new Error(text);
}

function make(attributes) {
  const element = document.createElement("ghand-avatar");
  Object.entries(attributes).forEach(([name, value]) => element.setAttribute(name, value));
  document.body.append(element);
  return element;
}

async function shown(attributes) {
  const element = make(attributes);
  await element.ready;
  return element;
}

// The pixels of the canvas, over white, in the event of a frame.
function copyOf(element) {
  const canvas = element.shadowRoot.querySelector("canvas");
  const copy = Object.assign(document.createElement("canvas"), { width: canvas.width, height: canvas.height });
  const pen = copy.getContext("2d", { willReadFrequently: true });
  pen.fillStyle = "white";
  pen.fillRect(0, 0, copy.width, copy.height);
  pen.drawImage(canvas, 0, 0);
  return pen.getImageData(0, 0, copy.width, copy.height);
}

// The pixels of the canvas once they are drawn.
async function canvasPixels(element) {
  // Two frames: the first may have lacked Gaussians.
  for (let k = 0; k < 4; k += 1) {
    const drawn = event(element, "frame");
    element.camera({});
    await drawn;
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
  const drawn = event(element, "frame");
  element.camera({});
  await drawn;
  return copyOf(element);
}

function difference(a, b) {
  assert(a.width === b.width && a.height === b.height, `${a.width} x ${a.height} against ${b.width} x ${b.height}`);
  let most = 0;
  a.data.forEach((value, k) => { most = Math.max(most, Math.abs(value - b.data[k])); });
  return most;
}

const plan = await (await fetch("plan.json")).json();

const checks = {
  async pictures() {
    for (const [k, { avatar, lights, poses }] of plan.pictures.entries()) {
      const element = await shown({ src: avatar });
      for (const light of lights) {
        element.light(light, 30);
        for (const [j, pose] of poses.entries()) {
          if (pose.motion) {
            await element.play(pose.motion);
            element.pause();
            element.seek(pose.seconds);
          } else {
            element.pose(pose.name, { seconds: 0 });
          }
          const picture = await element.picture({ ...SIZE, background: [1, 1, 1] });
          await post(`picture/${k}/${light}/${j}`, picture.data);
        }
      }
      element.remove();
    }
  },

  async canvas() {
    const element = await shown({ src: "demo.ghand", pose: "victory" });
    const canvas = await canvasPixels(element);
    const apart = difference(canvas, await element.picture({ background: [1, 1, 1] }));
    assert(canvas.data.some((value) => value < 200), "the canvas is empty");
    assert(apart <= 2, `the canvas differs by ${apart}`);
    // Resizing keeps the hand in the picture.
    for (const [width, height] of [[160, 400], [700, 260], [320, 240]]) {
      Object.assign(element.style, { width: `${width}px`, height: `${height}px` });
      await event(element, "frame");
      const resized = await canvasPixels(element);
      assert(resized.width === width && resized.height === height, `it has ${resized.width} x ${resized.height} pixels`);
      const off = difference(resized, await element.picture({ background: [1, 1, 1] }));
      assert(off <= 2, `at ${width} x ${height} the canvas differs by ${off}`);
    }
    // A still close-up, which needs larger buffers than the first picture, becomes complete without anybody's help.
    let last = null;
    let drawn = 0;
    element.addEventListener("frame", () => {
      drawn += 1;
      last = copyOf(element);
    });
    element.camera({ fov: 4 });
    let before = -1;
    await until(() => {
      const rests = drawn > 0 && drawn === before;
      before = drawn;
      return rests;
    }, "it never rests", 500);
    const close = difference(last, await element.picture({ background: [1, 1, 1] }));
    assert(close <= 2, `the close-up differs by ${close} after ${drawn} frames`);
    element.remove();
    return apart;
  },

  async lost_device() {
    const element = await shown({ src: "demo.ghand", pose: "fist" });
    const before = await element.picture(SIZE);
    element.camera({ fov: 30 });
    const view = element.camera();
    const lost = event(element, "devicelost");
    const restored = event(element, "devicerestored");
    element.loseDevice();
    const { detail } = await lost;
    await restored;
    const apart = difference(before, await element.picture(SIZE));
    assert(JSON.stringify(element.camera()) === JSON.stringify(view), "the view is another");
    element.camera({ fov: view.fov });
    assert(apart > 2, "the view had changed before");
    const canvas = await canvasPixels(element);
    assert(difference(canvas, await element.picture({ background: [1, 1, 1] })) <= 2, "the canvas is wrong");
    element.remove();
    return detail.message;
  },

  async layers() {
    const element = await shown({ src: "demo.ghand", pose: "victory" });
    const of = async (name) => {
      element.layer(name);
      assert(element.shown.layer === name, `${element.shown.layer} is shown`);
      const picture = await element.picture({ background: [1, 1, 1] });
      assert(difference(await canvasPixels(element), picture) <= 2, `the canvas shows other colours than ${name}`);
      return picture;
    };
    assert(element.hands[0].layers.join() === "skin,albedo", element.hands[0].layers.join());
    const [skin, albedo] = [await of("skin"), await of("albedo")];
    assert(difference(skin, albedo) > 20, "the layers are alike");
    // A new device shows the same layer.
    const restored = event(element, "devicerestored");
    element.loseDevice();
    await restored;
    assert(difference(albedo, await element.picture({ background: [1, 1, 1] })) <= 2, "the layer is another");
    assert(difference(skin, await of("skin")) === 0, "skin is another");
    element.setAttribute("layer", "albedo");
    assert(element.shown.layer === "albedo", "the attribute does nothing");
    const said = [thrown(() => element.layer("bones")), thrown(() => element.layer("views"))];
    element.remove();
    return said;
  },

  async poses() {
    const element = await shown({ src: "demo.ghand" });
    let errors = 0;
    element.addEventListener("error", () => { errors += 1; });
    const joints = element.hands[0].joints.filter((joint) => joint.limits);
    const count = plan.poses;
    for (let k = 0; k < count; k += 1) {
      const joint = joints[k % joints.length];
      const [low, high] = joint.limits.flexion;
      element.setJoints({ [joint.name]: { flexion: low + (high - low) * ((k * 0.37) % 1) } });
      const drawn = event(element, "frame");
      await drawn;
    }
    const last = joints[(count - 1) % joints.length];
    const [low, high] = last.limits.flexion;
    const wanted = low + (high - low) * (((count - 1) * 0.37) % 1);
    const { flexion } = element.angles(last.name);
    assert(Math.abs(flexion - wanted) < 1e-4, `${flexion} against ${wanted}`);
    assert(errors === 0, `${errors} errors`);
    element.remove();
  },

  async two_players_and_two_hands() {
    const [one, two] = await Promise.all([
      shown({ src: "demo.ghand", pose: "fist" }),
      shown({ src: "demo.ghand demo.ghand", motion: "wave" }),
    ]);
    assert(one.hands.length === 1 && two.hands.length === 2, "the hands are not there");
    const alone = await one.picture(SIZE);
    const moving = two.playback(1).time;
    await until(() => two.playback(1).time !== moving, "time does not pass");
    two.pose("fist", { hand: 0, seconds: 0 });
    assert(two.playback(0) === null && two.playback(1) !== null, "the other hand has stopped");
    assert(difference(alone, await one.picture(SIZE)) === 0, "the first player has changed");
    one.remove();
    two.remove();
  },

  async live_poses() {
    const element = await shown({ src: "demo.ghand" });
    const rest = element.joints().slice();
    const rotations = Array.from({ length: element.hands[0].joints.length }, () => [0, 0, 0]);
    rotations[5] = [0.4, 0, 0];
    element.packet({ pose: rotations, translation: [0, 0, 0] });
    assert(Math.abs(element.joints()[15] - 0.4) < 1e-6, "the packet changed nothing");
    // A session of WebXR as the browser gives it: hands are maps of joint spaces.
    const names = ["wrist", "thumb-metacarpal", "thumb-phalanx-proximal", "thumb-phalanx-distal", "thumb-tip"];
    for (const finger of ["index", "middle", "ring", "pinky"]) {
      for (const part of ["metacarpal", "phalanx-proximal", "phalanx-intermediate", "phalanx-distal", "tip"]) {
        names.push(`${finger}-finger-${part}`);
      }
    }
    const matrix = new Float32Array([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
    const frame = (tracked) => ({
      session: { inputSources: [{ handedness: "right", hand: new Map(names.map((name) => [name, name])) }, {}] },
      getJointPose: () => (tracked ? { transform: { matrix } } : null),
    });
    assert(element.xrFrame(frame(true), null), "no hand was found");
    assert(!element.xrFrame(frame(false), null), "a hand was found");
    assert(element.joints().some((value, k) => Math.abs(value - rest[k]) > 1e-3), "the session changed nothing");
    element.remove();
  },

  async socket() {
    const element = await shown({ src: "demo.ghand", connect: `ws://${location.host}/socket` });
    await until(() => Math.abs(element.joints()[15] - 0.25) < 1e-6, "the socket's packet did not arrive");
    element.remove();
  },

  async bad_input() {
    const said = {};
    for (const src of ["none.ghand", "broken.ghand", "newer.ghand", "foreign.ghand"]) {
      const element = make({ src });
      const failed = event(element, "error");
      said[src] = await messageOf(element.ready);
      assert((await failed).detail.message === said[src], "the event says something else");
      assert(element.shadowRoot.querySelector(".message").textContent === said[src], "the element says something else");
      element.remove();
    }
    const element = await shown({ src: "demo.ghand" });
    const names = element.hands[0].joints.map((joint) => joint.name);
    const count = 3 * names.length;
    said.pose = thrown(() => element.pose("fits"));
    said.numbers = thrown(() => element.pose(new Float32Array(7)));
    said.nan = thrown(() => element.pose(new Float32Array(count).fill(NaN)));
    said.joint = thrown(() => element.setJoints({ none: [0, 0, 0] }));
    said.vector = thrown(() => element.setJoints({ [names[1]]: [0, 0] }));
    said.light = thrown(() => element.light("moon"));
    said.view = thrown(() => element.camera({ position: [0, 0, 0], target: [0, 0, 0] }));
    said.side = thrown(() => element.camera("left"));
    said.hand = thrown(() => element.pose("fist", { hand: 3 }));
    said.packet = thrown(() => element.packet("{}"));
    said.socket = thrown(() => element.connect("http://"));
    said.motion = await messageOf(element.play("cuont"));
    said.file = await messageOf(element.play(new File(["{"], "poses.json")));
    said.mediapipe = await messageOf(element.webcam());
    said.served = await messageOf(element.webcam({ mediapipe: "/nothing" }));
    said.picture = await messageOf(element.picture({ width: 0, height: 10 }));
    said.elsewhere = await messageOf(element.play("http://127.0.0.1:9/poses.json"));
    // What failed has left the hand as it was.
    assert(element.joints().every((value) => value === 0), "the hand has moved");
    element.remove();
    said.closed = thrown(() => element.pose("fist"));
    return said;
  },

  async dropped_files() {
    const element = await shown({ src: "demo.ghand" });
    const drop = (file) => {
      const transfer = new DataTransfer();
      transfer.items.add(file);
      const dropped = new DragEvent("drop", { dataTransfer: transfer, bubbles: true, composed: true });
      element.shadowRoot.querySelector("canvas").dispatchEvent(dropped);
    };
    const rotations = element.hands[0].joints.map(() => [0, 0, 0]);
    rotations[4] = [0.3, 0, 0];
    const poses = JSON.stringify({ fps: 10, frames: [{ pose: rotations }, { pose: rotations }] });
    drop(new File([poses], "poses.json"));
    await until(() => element.playback(), "the poses are not read");
    assert(Math.abs(element.joints()[12] - 0.3) < 1e-6, "the poses are not played");
    const failed = event(element, "error");
    drop(new File(["nothing"], "hand.ghand"));
    const { detail } = await failed;
    drop(new File([await (await fetch("demo.ghand")).arrayBuffer()], "hand.ghand"));
    await until(() => element.hands.length === 1, "the avatar is not shown");
    element.remove();
    return detail.message;
  },

  async keys_and_controls() {
    const element = await shown({ src: "demo.ghand", controls: "", alt: "My hand" });
    const canvas = element.shadowRoot.querySelector("canvas");
    assert(canvas.getAttribute("aria-label") === "My hand" && canvas.tabIndex === 0, "it cannot be reached or named");
    const before = JSON.stringify(element.camera());
    const press = (key) => canvas.dispatchEvent(new KeyboardEvent("keydown", { key, cancelable: true }));
    press("ArrowLeft");
    const turned = JSON.stringify(element.camera());
    press("Home");
    assert(turned !== before && JSON.stringify(element.camera()) === before, "keys do not move the view");
    const panel = element.shadowRoot.querySelector(".controls");
    const unnamed = [...panel.querySelectorAll("select, input, button")]
      .filter((control) => !control.closest("label") && !control.ariaLabel && !control.textContent && control.tagName !== "BUTTON");
    assert(unnamed.length === 0, `${unnamed.length} controls have no name`);
    const [pose] = panel.querySelectorAll("select");
    pose.value = "fist";
    pose.dispatchEvent(new Event("change"));
    const posed = () => element.joints().some((value) => Math.abs(value) > 0.5);
    await until(posed, "the panel does not pose the hand");
    element.removeAttribute("controls");
    assert(!element.shadowRoot.querySelector(".controls"), "the panel stays");
    element.remove();
  },
};

for (const [name, act] of Object.entries(checks)) {
  const begin = performance.now();
  let result;
  try {
    result = { value: (await act()) ?? null };
  } catch (error) {
    result = { error: error.stack ?? error.message };
  }
  document.body.replaceChildren();
  await post(`result/${name}`, JSON.stringify({ ...result, seconds: (performance.now() - begin) / 1000 }));
}
await post("end", "");
