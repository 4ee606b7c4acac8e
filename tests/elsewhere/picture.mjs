/** Pictures as bytes, and how far apart two of them are. */
import assert from "node:assert/strict";
import { writeFileSync } from "node:fs";
import { PNG } from "pngjs";

/** By how much a picture of a broken file must miss what a whole one has to reach, dB. */
const MARGIN = 1;
/** Brightest background, 255ths: pictures are compressed without loss. */
const BACKGROUND = 8;
/** Pixels next to the background that are not inside the hand. */
const EDGE = 4;

/** A PNG file's picture. */
export function picture(bytes) {
  const { width, height, data } = PNG.sync.read(bytes);
  return { width, height, data };
}

/**
 * How far two pictures are apart: peak signal-to-noise ratios, dB, over all pixels, which outlines dominate, and over
 * those well inside both hands, which colours do.
 */
function closeness(a, b) {
  assert.deepEqual([a.width, a.height], [b.width, b.height]);
  const [inA, inB] = [inner(a), inner(b)];
  return { all: psnr(a, b, () => true), inside: psnr(a, b, (i) => inA[i] && inB[i]) };
}

function psnr(a, b, counts) {
  let [sum, pixels] = [0, 0];
  for (let i = 0; i < a.width * a.height; i++) {
    if (!counts(i)) continue;
    pixels++;
    for (let c = 0; c < 3; c++) sum += ((a.data[4 * i + c] - b.data[4 * i + c]) / 255) ** 2;
  }
  return pixels === 0 ? 0 : -10 * Math.log10(sum / (3 * pixels));
}

/** Of each pixel whether no background is near. */
function inner({ width, height, data }) {
  const hand = (x, y) => Math.max(...data.subarray(4 * (y * width + x), 4 * (y * width + x) + 3)) > BACKGROUND;
  // A square is of the hand if all its rows and columns are: first along rows, then along columns.
  const erode = (is) => (x, y, dx, dy) => {
    for (let d = -EDGE; d <= EDGE; d++) if (!is(x + d * dx, y + d * dy)) return false;
    return true;
  };
  const within = (x, y) => x >= 0 && y >= 0 && x < width && y < height;
  const rows = Array.from({ length: width * height }, (_, i) =>
    erode((x, y) => within(x, y) && hand(x, y))(i % width, Math.floor(i / width), 1, 0));
  return rows.map((_, i) =>
    erode((x, y) => within(x, y) && rows[y * width + x])(i % width, Math.floor(i / width), 0, 1));
}

/** Saves two pictures side by side, with their difference, four times as strong. */
function saveSheet(path, ours, theirs) {
  const { width, height } = ours;
  const sheet = new PNG({ width: 3 * width, height });
  for (let y = 0; y < height; y++) {
    for (let x = 0; x < width; x++) {
      for (let c = 0; c < 4; c++) {
        const [a, b] = [ours, theirs].map((p) => p.data[4 * (y * width + x) + c]);
        const row = 4 * 3 * width * y + 4 * x + c;
        sheet.data[row] = a;
        sheet.data[row + 4 * width] = b;
        sheet.data[row + 8 * width] = c === 3 ? 255 : Math.min(255, 4 * Math.abs(a - b));
      }
    }
  }
  writeFileSync(path, PNG.sync.write(sheet));
}

/**
 * Checks that another program's picture is ghand's, to `atLeast` dB in both measures of `closeness`, and that those of
 * broken files (`name: picture`) are not. Saves all of them in a test's folder.
 */
export function assertAgrees(folder, name, ours, theirs, atLeast, broken) {
  const compared = (title, image) => {
    saveSheet(folder.file(`${title}.png`), ours, image);
    const { all, inside } = closeness(ours, image);
    console.log(`${title}: ${all.toFixed(1)} dB, inside ${inside.toFixed(1)} dB`);
    return Math.min(all - atLeast.all, inside - atLeast.inside);
  };
  const margin = compared(name, theirs);
  const passing = Object.entries(broken).filter(([fault, image]) => compared(`${name}, ${fault}`, image) > -MARGIN);
  assert(margin >= 0, `${name}: ${(-margin).toFixed(1)} dB below what it must reach; see ${folder.path}`);
  assert.deepEqual(passing.map(([fault]) => fault), [], "these faults are not found");
}
