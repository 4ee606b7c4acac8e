/** Blender: joints where ghand has them, and the mesh with its correctives where three.js has it. */
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { join } from "node:path";
import { test } from "node:test";

import { Folder, LIT, SUITE } from "./ghand.mjs";
import { broken, wFirst } from "./glb.mjs";
import { posedByThree } from "./posed_by_three.mjs";

/** Blender, or a Python that has it as a module, which takes a script at once. */
const PROGRAM = process.env.GHAND_BLENDER_PROGRAM;
const SCRIPT = ["--background", "--factory-startup", "--python-exit-code", "1", "--python"];
const FRAMES = [0, 20, 67, 91, 150];
const FPS = 30;
/** Largest distance of joints and vertices, metres. */
const MOST_APART = 1e-5;
/** Correctives move vertices by a millimetre or so. */
const MOVED = 2e-4;

function posedByBlender(file) {
  const options = PROGRAM.endsWith("blender") ? SCRIPT : [];
  const args = [...options, join(SUITE, "blender.py"), "--", file, ...FRAMES.map(String)];
  const text = execFileSync(PROGRAM, args, { encoding: "utf8", maxBuffer: 1 << 30, stdio: ["ignore", "pipe", "pipe"] });
  const result = text.split("\n").find((line) => line.startsWith("RESULT "));
  return JSON.parse(result.slice("RESULT ".length));
}

const distance = (a, b) => Math.hypot(...a.map((value, k) => value - b[k]));

/** Largest distance of a joint in any frame. */
function jointsApart(found, truth) {
  const names = Object.keys(truth[0]);
  assert.deepEqual(Object.keys(found[0].joints).sort(), [...names].sort());
  return Math.max(...found.flatMap(({ joints }, k) => names.map((name) => distance(joints[name], truth[k][name]))));
}

/** Largest distance of a vertex in any frame. */
function verticesApart(found, truth) {
  assert.equal(found[0].vertices.length, truth[0].length);
  return Math.max(...found.flatMap(({ vertices }, k) => vertices.map((vertex, i) => distance(vertex, truth[k][i]))));
}

test("Blender moves the hand as ghand does", { skip: PROGRAM ? false : "there is no Blender" }, async () => {
  const folder = new Folder("blender");
  folder.ghand("export", LIT, "--motion", "count", "--texture", "256", "--out", "hand.glb");
  const { fps, frames } = folder.joints(LIT, "count");
  assert.equal(fps, FPS);
  const joints = FRAMES.map((frame) => frames[frame]);
  const found = posedByBlender(folder.file("hand.glb"));
  assert(found.some(({ correctives }) => correctives.some((weight) => Math.abs(weight) > 0.1)));
  const seconds = FRAMES.map((frame) => frame / FPS);
  const vertices = await posedByThree(folder.file("hand.glb"), seconds);
  const apart = [jointsApart(found, joints), verticesApart(found, vertices)];
  console.log(`joints ${apart[0].toExponential(1)} m, vertices ${apart[1].toExponential(1)} m`);
  assert(apart.every((most) => most <= MOST_APART), `${apart}`);

  broken(folder, "hand.glb", "w first.glb", (glb) => {
    const { channels, samplers } = glb.json.animations[0];
    const turn = channels.find((channel) => channel.target.path === "rotation" && channel.target.node === 6);
    wFirst(glb.floats(samplers[turn.sampler].output));
  });
  assert(jointsApart(posedByBlender(folder.file("w first.glb")), joints) > 1000 * MOST_APART);
  broken(folder, "hand.glb", "rigid.glb", ({ json }) => {
    json.animations[0].channels = json.animations[0].channels.filter((channel) => channel.target.path !== "weights");
  });
  const rigid = posedByBlender(folder.file("rigid.glb"));
  assert(jointsApart(rigid, joints) <= MOST_APART);
  assert(verticesApart(rigid, vertices) > MOVED);
});
