/** PlayCanvas: the Gaussians of a .glb at rest, and of a posed .ply. */
import { test } from "node:test";

import { WITHOUT_BROWSER, withBrowser } from "./browser.mjs";
import { Folder, LIT } from "./ghand.mjs";
import { gaussianFaults } from "./glb.mjs";
import { assertAgrees } from "./picture.mjs";
import { plyFaults } from "./ply.mjs";

const GAUSSIANS = { all: 33, inside: 40 };

async function assertDrawn(folder, file, ours, faults) {
  await withBrowser("webgl", async (pages) => {
    const drawn = (url) => pages.draw("playcanvas", { url });
    const theirs = await drawn(folder.url(file));
    const images = {};
    for (const [name, url] of Object.entries(faults)) images[name] = await drawn(url);
    assertAgrees(folder, file, ours, theirs, GAUSSIANS, images);
  });
}

test("PlayCanvas draws the Gaussians of a .glb as ghand does", { skip: WITHOUT_BROWSER }, async () => {
  const folder = new Folder("playcanvas-glb");
  folder.ghand("export", LIT, "--gaussians", "--texture", "256", "--out", "hand.glb");
  await assertDrawn(folder, "hand.glb", folder.render(LIT, []), gaussianFaults(folder, "hand.glb"));
});

test("PlayCanvas draws a posed .ply as ghand does", { skip: WITHOUT_BROWSER }, async () => {
  const folder = new Folder("playcanvas-ply");
  folder.ghand("export", LIT, "--pose", "fist", "--out", "fist.ply");
  const { "w last": turns, brighter, mirrored } = plyFaults(folder, "fist.ply");
  const ours = folder.render(LIT, ["--pose", "fist"]);
  await assertDrawn(folder, "fist.ply", ours, { "w last": turns, brighter, mirrored });
});
