/** The program `ghand`, its demo avatar, and what the tests read of its files. */
import { execFileSync } from "node:child_process";
import { mkdirSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { fileURLToPath } from "node:url";

import { picture } from "./picture.mjs";

const PROGRAM = process.env.GHAND_PROGRAM;
/** The folder of these files. */
export const SUITE = fileURLToPath(new URL(".", import.meta.url));

/** The camera of all pictures, which sees the hand from aside: no axis of the picture is one of the hand's. */
export const CAMERA = JSON.parse(readFileSync(join(SUITE, "camera.json")));
/** An avatar whose skin and light are apart. */
export const LIT = process.env.GHAND_DEMO_AVATAR;
/** Beside the suite: the folder that the pages see. */
export const ROOT = join(SUITE, "..");

/** A new folder in which a test runs ghand. It stays, so that its pictures can be looked at. */
export class Folder {
  constructor(name) {
    this.name = name;
    this.path = join(ROOT, "out", name);
    rmSync(this.path, { recursive: true, force: true });
    mkdirSync(this.path, { recursive: true });
  }

  file(name) {
    return join(this.path, name);
  }

  /** Its address in a page. */
  url(name) {
    return `/out/${this.name}/${name}`;
  }

  ghand(...args) {
    return execFileSync(PROGRAM, args, { cwd: this.path, encoding: "utf8", stdio: ["ignore", "pipe", "pipe"] });
  }

  /** ghand's picture of an avatar. */
  render(avatar, pose, camera = CAMERA) {
    writeFileSync(this.file("camera.json"), JSON.stringify(camera));
    this.ghand("render", avatar, ...pose, "--camera", "camera.json", "--out", "ghand.png");
    return picture(readFileSync(this.file("ghand.png")));
  }

  /** The demo avatar's skin: the avatar without its light, which shows its colours as they are. */
  unlit() {
    const bytes = readFileSync(LIT);
    const length = Number(bytes.readBigUInt64LE(0));
    const { __metadata__: metadata, ...tensors } = JSON.parse(bytes.subarray(8, 8 + length));
    const kept = Object.entries(tensors).filter(([name]) => !name.startsWith("light."));
    const { light, ...description } = JSON.parse(metadata.ghand);
    if (!light) throw new Error(`${LIT} has no light`);
    const header = { __metadata__: { ...metadata, ghand: JSON.stringify(description) } };
    const parts = [];
    let offset = 0;
    for (const [name, tensor] of kept.sort(([, a], [, b]) => a.data_offsets[0] - b.data_offsets[0])) {
      const [begin, end] = tensor.data_offsets;
      header[name] = { ...tensor, data_offsets: [offset, (offset += end - begin)] };
      parts.push(bytes.subarray(8 + length + begin, 8 + length + end));
    }
    const text = Buffer.from(JSON.stringify(header));
    const padded = Buffer.concat([text, Buffer.alloc((8 - (text.length % 8)) % 8, " ")]);
    const size = Buffer.alloc(8);
    size.writeBigUInt64LE(BigInt(padded.length));
    writeFileSync(this.file("unlit.ghand"), Buffer.concat([size, padded, ...parts]));
    return "unlit.ghand";
  }

  /** Where ghand has the joints in a motion, `[frame][name]`, metres: from `--spark`, which writes no glTF. */
  joints(avatar, motion) {
    this.ghand("export", avatar, "--motion", motion, "--spark", "bones");
    const { fps, bones, frames } = JSON.parse(readFileSync(this.file("bones/motion.json")));
    const rest = restJoints(avatar === LIT ? LIT : this.file(avatar));
    const posed = (frame) => Object.fromEntries(frame.map((bone, k) => [bones[k], moved(bone, rest[k])]));
    return { fps, frames: frames.map(posed) };
  }
}

function restJoints(path) {
  const bytes = readFileSync(path);
  const length = Number(bytes.readBigUInt64LE(0));
  const { joints } = JSON.parse(bytes.subarray(8, 8 + length));
  const at = 8 + length + joints.data_offsets[0];
  const joint = (k) => [0, 1, 2].map((c) => bytes.readDoubleLE(at + 8 * (3 * k + c)));
  return Array.from({ length: joints.shape[0] }, (_, k) => joint(k));
}

/** A point after a turn by a quaternion (x, y, z, w) and a shift. */
function moved([x, y, z, w, ...shift], [a, b, c]) {
  const [u, v, n] = [2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)];
  const turned = [a + w * u + y * n - z * v, b + w * v + z * u - x * n, c + w * n + x * v - y * u];
  return turned.map((value, k) => value + shift[k]);
}
