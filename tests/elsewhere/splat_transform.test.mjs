/** splat-transform: what it reads of a .ply and of a .spz of the same pose. */
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { test } from "node:test";

import { Folder, LIT, ROOT } from "./ghand.mjs";
import { Ply, plyFaults } from "./ply.mjs";

const PROGRAM = join(ROOT, "node_modules/@playcanvas/splat-transform/bin/cli.mjs");
const alpha = (logit) => 1 / (1 + Math.exp(-logit));
/** Angle between two turns, radians; q and -q are the same turn. */
const angle = (a, b) => {
  const cosine = Math.abs(a.reduce((sum, value, k) => sum + value * b[k], 0)) / Math.hypot(...a) / Math.hypot(...b);
  return 2 * Math.acos(Math.min(1, cosine));
};
const most = (a, b) => Math.max(...a.map((value, k) => Math.abs(value - b[k])));
/** Columns of a Gaussian, how far two are apart, and half a step of what .spz stores, with a hundredth for rounding. */
const VALUES = {
  // 20 bits after the point.
  position: { columns: ["x", "y", "z"], apart: most, atMost: 1.01 * 2 ** -21 },
  // Sixteenths of the logarithm.
  scale: { columns: ["scale_0", "scale_1", "scale_2"], apart: most, atMost: 1.01 / 32 },
  // 255ths of a range of 1/0.15.
  color: { columns: ["f_dc_0", "f_dc_1", "f_dc_2"], apart: most, atMost: 1.01 / (2 * 255 * 0.15) },
  opacity: { columns: ["opacity"], apart: (a, b) => most(a.map(alpha), b.map(alpha)), atMost: 1.01 / (2 * 255) },
  // Three components in 511ths of 1/√2; the fourth follows, and doubles what they are off at most.
  turn: { columns: ["rot_0", "rot_1", "rot_2", "rot_3"], apart: angle, atMost: (2 * Math.sqrt(6)) / (2 * 511) },
};

/** A file's Gaussians as splat-transform reads it, `name: value`. */
function gaussians(folder, file) {
  const csv = `${file}.csv`;
  execFileSync(process.execPath, [PROGRAM, "--quiet", "--overwrite", file, csv], { cwd: folder.path });
  const [names, ...lines] = readFileSync(folder.file(csv), "utf8").trim().split("\n").map((line) => line.split(","));
  return lines.map((line) => Object.fromEntries(line.map((value, k) => [names[k].trim(), Number(value)])));
}

/** The same of a .ply, as it is in the file. */
function stored(folder, file) {
  const { rows, columns } = new Ply(folder.file(file));
  return rows.map((row) => Object.fromEntries(columns.map((name, k) => [name, row[k]])));
}

/** Names of the values in which two files differ. */
function differences(a, b) {
  assert.equal(a.length, b.length);
  return Object.entries(VALUES).filter(([, { columns, apart, atMost }]) => {
    const of = (row) => columns.map((column) => row[column]);
    const largest = a.reduce((largest, row, i) => Math.max(largest, apart(of(row), of(b[i]))), 0);
    return !(largest <= atMost);
  }).map(([name]) => name);
}

test("splat-transform reads the same Gaussians from .ply and .spz", () => {
  const folder = new Folder("splat-transform");
  for (const file of ["fist.ply", "fist.spz"]) folder.ghand("export", LIT, "--pose", "fist", "--out", file);
  const [ply, spz] = [gaussians(folder, "fist.ply"), gaussians(folder, "fist.spz")];
  assert.deepEqual(differences(stored(folder, "fist.ply"), ply), []);
  assert.deepEqual(differences(ply, spz), []);
  const faults = Object.keys(plyFaults(folder, "fist.ply"));
  const found = faults.map((fault) => differences(stored(folder, `${fault}.ply`), spz));
  assert.deepEqual(found, [["turn"], ["scale"], ["position"], ["color"], ["opacity"]]);
});
