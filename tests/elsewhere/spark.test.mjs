/** Spark: the page that `--spark` writes, as it is, in a frame of its motion. */
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { test } from "node:test";

import { WITHOUT_BROWSER, still, withBrowser } from "./browser.mjs";
import { Folder, ROOT } from "./ghand.mjs";
import { assertAgrees } from "./picture.mjs";

const FRAME = 45;
const GAUSSIANS = { all: 33, inside: 39 };
const SIZE = { width: 360, height: 360 };
/** Of the page's own camera: the vertical field of view, degrees, and the distance to the hand's middle, metres. */
const [FIELD, DISTANCE] = [30, 0.6];

/** The page's camera, which looks along -x with -y up, as ghand has it. */
function camera([x, y, z]) {
  const focal = SIZE.height / 2 / Math.tan((FIELD / 2) * (Math.PI / 180));
  return {
    id: "page", ...SIZE,
    intrinsics: [[focal, 0, SIZE.width / 2], [0, focal, SIZE.height / 2], [0, 0, 1]],
    rotation: [[0, 0, 1], [0, 1, 0], [-1, 0, 0]],
    translation: [-z, -y, x + DISTANCE],
  };
}

/** Serves what the page takes from the web: the installed packages, which must be of the versions that it names. */
async function servePackages(page) {
  await page.route(/\/npm\//, (route) => {
    const [, name, version, path] = /\/npm\/((?:@[^/]+\/)?[^@/]+)@([^/]+)\/(.+)$/.exec(route.request().url());
    const folder = join(ROOT, "node_modules", name);
    assert.equal(JSON.parse(readFileSync(join(folder, "package.json"))).version, version, `version of ${name}`);
    const headers = { "access-control-allow-origin": "*" };
    return route.fulfill({ path: join(folder, path), contentType: "text/javascript", headers });
  });
}

test("Spark's page shows ghand's picture", { skip: WITHOUT_BROWSER }, async () => {
  const folder = new Folder("spark");
  const unlit = folder.unlit();
  folder.ghand("export", unlit, "--motion", "count", "--spark", "page");
  const motion = JSON.parse(readFileSync(folder.file("page/motion.json")));
  const ours = folder.render(unlit, ["--pose", "count", "--frame", `${FRAME}`], camera(motion.middle));
  // The middle of the frame, so that rounding does not choose another.
  const milliseconds = ((FRAME + 0.5) / motion.fps) * 1000;
  await withBrowser("webgl", async (pages) => {
    const drawn = (replaced = {}) => pages.page(async (page) => {
      // One moment of the motion, drawn when the test asks for it: a page that draws all the time is not photographed.
      await page.addInitScript((milliseconds) => {
        window.requestAnimationFrame = (draw) => {
          window.drawn = () => {
            draw(milliseconds);
            return document.querySelector("canvas").toDataURL();
          };
        };
      }, milliseconds);
      await servePackages(page);
      for (const [file, body] of Object.entries(replaced)) {
        await page.route(`**/${file}`, (route) => route.fulfill({ body }));
      }
      await page.goto(pages.origin + folder.url("page/index.html"));
      await page.waitForFunction(() => window.drawn, null, { polling: 100 });
      return still(async () => Buffer.from((await page.evaluate(() => window.drawn())).split(",")[1], "base64"));
    }, SIZE);
    const withMotion = (changes) => drawn({ "motion.json": JSON.stringify({ ...motion, ...changes }) });
    const bones = readFileSync(folder.file("page/bones.bin"));
    assertAgrees(folder, "spark", ours, await drawn(), GAUSSIANS, {
      "w first": await withMotion({ frames: motion.frames.map((frame) => frame.map(wFirst)) }),
      "weights before bones": await drawn({ "bones.bin": weightsFirst(bones) }),
      "another frame": await withMotion({ fps: 2 * motion.fps }),
    });
  });
});

const wFirst = ([x, y, z, w, ...shift]) => [w, x, y, z, ...shift];

/** Weights and bones of each splat exchanged. */
function weightsFirst(bytes) {
  const swapped = Buffer.alloc(bytes.length);
  for (let i = 0; i < bytes.length; i += 8) {
    bytes.copy(swapped, i, i + 4, i + 8);
    bytes.copy(swapped, i + 4, i, i + 4);
  }
  return swapped;
}
