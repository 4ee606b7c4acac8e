/** PLY files of Gaussians: lines that name the columns, then rows of floats. */
import { readFileSync, writeFileSync } from "node:fs";

const END = "end_header\n";

export class Ply {
  constructor(path) {
    const bytes = readFileSync(path);
    const begin = bytes.indexOf(END) + END.length;
    this.header = bytes.subarray(0, begin);
    this.columns = [...this.header.toString().matchAll(/^property float (\w+)$/gm)].map((match) => match[1]);
    // Copied, so that its floats are aligned.
    const floats = new Float32Array(new Uint8Array(bytes.subarray(begin)).buffer);
    const size = this.columns.length;
    this.rows = Array.from({ length: floats.length / size }, (_, i) => floats.subarray(size * i, size * (i + 1)));
  }

  /** Replaces values of each row by those that `change` makes of them. */
  change(names, change) {
    const at = names.map((name) => this.columns.indexOf(name));
    for (const row of this.rows) change(at.map((i) => row[i])).forEach((value, k) => (row[at[k]] = value));
  }

  save(path) {
    writeFileSync(path, Buffer.concat([this.header, new Uint8Array(this.rows[0].buffer)]));
  }
}

/** Addresses of copies that have one fault each. */
export function plyFaults(folder, file) {
  const fault = (name, columns, change) => {
    const ply = new Ply(folder.file(file));
    ply.change(columns, change);
    ply.save(folder.file(`${name}.ply`));
    return [name, folder.url(`${name}.ply`)];
  };
  return Object.fromEntries([
    fault("w last", ["rot_0", "rot_1", "rot_2", "rot_3"], ([w, x, y, z]) => [x, y, z, w]),
    fault("half as large", ["scale_0", "scale_1", "scale_2"], (scales) => scales.map((log) => log - Math.LN2)),
    fault("mirrored", ["z"], ([z]) => [-z]),
    fault("brighter", ["f_dc_0", "f_dc_1", "f_dc_2"], (color) => color.map((c) => c + 0.2)),
    fault("fainter", ["opacity"], ([logit]) => [Math.min(logit, 0)]),
  ]);
}
