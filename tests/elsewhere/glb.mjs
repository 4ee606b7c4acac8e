/** Binary glTF files in parts, to break them. */
import { readFileSync, writeFileSync } from "node:fs";

const COUNTS = { SCALAR: 1, VEC2: 2, VEC3: 3, VEC4: 4, MAT4: 16 };
const FLOAT = 5126;

export class Glb {
  constructor(path) {
    const bytes = readFileSync(path);
    const length = bytes.readUInt32LE(12);
    this.json = JSON.parse(bytes.subarray(20, 20 + length));
    // Copied, so that its floats are aligned.
    this.buffer = new Uint8Array(bytes.subarray(28 + length)).buffer;
  }

  /** The elements of an accessor, to be changed. */
  floats(index) {
    const accessor = this.json.accessors[index];
    const view = this.json.bufferViews[accessor.bufferView];
    const size = COUNTS[accessor.type];
    const inRow = (view.byteStride ?? 4 * size) === 4 * size;
    if (accessor.componentType !== FLOAT || !inRow) throw new Error("not floats in a row");
    const offset = (view.byteOffset ?? 0) + (accessor.byteOffset ?? 0);
    return Array.from({ length: accessor.count }, (_, i) => new Float32Array(this.buffer, offset + 4 * size * i, size));
  }

  bytes() {
    const text = Buffer.from(JSON.stringify(this.json));
    const json = Buffer.concat([text, Buffer.alloc((4 - (text.length % 4)) % 4, " ")]);
    const header = Buffer.alloc(20);
    [0x46546c67, 2, 28 + json.length + this.buffer.byteLength, json.length, 0x4e4f534a].forEach((word, i) =>
      header.writeUInt32LE(word, 4 * i));
    const chunk = Buffer.alloc(8);
    [this.buffer.byteLength, 0x004e4942].forEach((word, i) => chunk.writeUInt32LE(word, 4 * i));
    return Buffer.concat([header, json, chunk, Buffer.from(this.buffer)]);
  }
}

/** Writes a changed copy of a file. */
export function broken(folder, file, name, change) {
  const glb = new Glb(folder.file(file));
  change(glb);
  writeFileSync(folder.file(name), glb.bytes());
  return folder.url(name);
}

/** The order of quaternions that other programs use: w first. */
export function wFirst(quaternions) {
  for (const q of quaternions) q.set([q[3], q[0], q[1], q[2]]);
}

/** Addresses of copies whose Gaussians have one fault each. */
export function gaussianFaults(folder, file) {
  const splats = ({ json }) => json.meshes[1].primitives[0];
  const values = (glb, name) => glb.floats(splats(glb).attributes[`KHR_gaussian_splatting:${name}`]);
  const fault = (name, change) => [name, broken(folder, file, `${name}.glb`, change)];
  return Object.fromEntries([
    fault("w first", (glb) => wFirst(values(glb, "ROTATION"))),
    fault("half as large", (glb) => values(glb, "SCALE").forEach((scale) => scale.set(scale.map((s) => s / 2)))),
    fault("mirrored", (glb) => glb.floats(splats(glb).attributes.POSITION).forEach((p) => (p[2] *= -1))),
    fault("fainter", (glb) => values(glb, "OPACITY").forEach((o) => (o[0] /= 2))),
  ]);
}
