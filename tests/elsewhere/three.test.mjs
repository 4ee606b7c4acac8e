/** three.js: the textured hand in a pose of its animation, and the Gaussians at rest. */
import { test } from "node:test";

import { WITHOUT_BROWSER, withBrowser } from "./browser.mjs";
import { Folder, LIT } from "./ghand.mjs";
import { broken, gaussianFaults, wFirst } from "./glb.mjs";
import { assertAgrees } from "./picture.mjs";

const MOTION = "count";
/** A frame in which fingers are bent. */
const FRAME = 45;
const SECONDS = FRAME / 30;
/** A mesh has other outlines than Gaussians. */
const MESH = { all: 30, inside: 33 };
const GAUSSIANS = { all: 33, inside: 41 };

function faults(folder, file) {
  const fault = (name, change) => broken(folder, file, `${name}.glb`, change);
  const mesh = ({ json }) => json.meshes[0].primitives[0];
  return {
    "w first": fault("w first", (glb) => {
      const { channels, samplers } = glb.json.animations[0];
      const turns = channels.filter((channel) => channel.target.path === "rotation");
      for (const { sampler } of turns) wFirst(glb.floats(samplers[sampler].output));
    }),
    "texture upside down": fault("texture upside down", (glb) => {
      for (const uv of glb.floats(mesh(glb).attributes.TEXCOORD_0)) uv[1] = 1 - uv[1];
    }),
    "motion too fast": fault("motion too fast", (glb) => {
      const inputs = new Set(glb.json.animations[0].samplers.map(({ input }) => input));
      for (const input of inputs) for (const time of glb.floats(input)) time[0] /= 2;
    }),
    "too large": fault("too large", (glb) => {
      glb.json.nodes.push({ children: glb.json.scenes[0].nodes, scale: [1.05, 1.05, 1.05] });
      glb.json.scenes[0].nodes = [glb.json.nodes.length - 1];
    }),
  };
}

test("three.js moves the textured hand as ghand does", { skip: WITHOUT_BROWSER }, async () => {
  const folder = new Folder("three");
  const unlit = folder.unlit();
  folder.ghand("export", unlit, "--motion", MOTION, "--out", "unlit.glb");
  const ours = folder.render(unlit, ["--pose", MOTION, "--frame", `${FRAME}`]);
  await withBrowser("webgl", async (pages) => {
    const drawn = (url, options) => pages.draw("three", { url, seconds: SECONDS, ...options });
    const images = { "linear colours": await drawn(folder.url("unlit.glb"), { linear: true }) };
    for (const [name, url] of Object.entries(faults(folder, "unlit.glb"))) images[name] = await drawn(url);
    assertAgrees(folder, "unlit", ours, await drawn(folder.url("unlit.glb")), MESH, images);
  });
});

test("three.js shows the albedo of a lit hand in its opening pose", { skip: WITHOUT_BROWSER }, async () => {
  const folder = new Folder("three-lit");
  folder.ghand("export", LIT, "--pose", "fist", "--out", "lit.glb");
  const ours = folder.render(folder.unlit(), ["--pose", "fist"]);
  const rest = broken(folder, "lit.glb", "rest.glb", ({ json }) => json.nodes.forEach((node) => delete node.rotation));
  await withBrowser("webgl", async (pages) => {
    const theirs = await pages.draw("three", { url: folder.url("lit.glb") });
    assertAgrees(folder, "lit", ours, theirs, MESH, { rest: await pages.draw("three", { url: rest }) });
  });
});

test("three.js draws the Gaussians of a .glb as ghand does", { skip: WITHOUT_BROWSER }, async () => {
  const folder = new Folder("three-gaussians");
  folder.ghand("export", LIT, "--gaussians", "--texture", "256", "--out", "hand.glb");
  const ours = folder.render(LIT, []);
  await withBrowser("webgpu", async (pages) => {
    // three 0.187 takes display colours for linear ones, which it would make brighter.
    const drawn = (url, linear = true) => pages.draw("three", { url, scene: 1, linear });
    const theirs = await drawn(folder.url("hand.glb"));
    const faults = gaussianFaults(folder, "hand.glb");
    // A picture takes seconds here; PlayCanvas gets the other faults.
    assertAgrees(folder, "gaussians", ours, theirs, GAUSSIANS, {
      "brighter": await drawn(folder.url("hand.glb"), false),
      "w first": await drawn(faults["w first"]),
    });
  });
});
