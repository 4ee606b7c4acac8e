/** Khronos' glTF validator on every kind of .glb. */
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import validator from "gltf-validator";

import { Folder, LIT } from "./ghand.mjs";
import { Glb, broken } from "./glb.mjs";

const WARNING = 1;
/** The extension's specification names these attributes; the validator does not know it. */
const ATTRIBUTES = ["OPACITY", "ROTATION", "SCALE", "SH_DEGREE_0_COEF_0"];

const folder = new Folder("gltf-validator");
const UNLIT = folder.unlit();
const PLAIN = {
  "lit, at rest": [LIT],
  "lit, posed, with a motion, OpenXR's names": [LIT, "--pose", "fist", "--motion", "count", "--joint-names", "openxr"],
  "unlit, posed, WebXR's names": [UNLIT, "--pose", "fist", "--joint-names", "webxr"],
  "unlit, two motions": [UNLIT, "--motion", "count", "--motion", "wave"],
  "with fitted correctives": [LIT, "--fit-pose-correctives"],
};

/** Codes and places of errors and warnings. */
async function problems(file) {
  const { issues } = await validator.validateBytes(new Uint8Array(readFileSync(folder.file(file))), { maxIssues: 0 });
  return issues.messages.filter(({ severity }) => severity <= WARNING).map(({ code, pointer }) => `${code} ${pointer}`);
}

function exported(args) {
  folder.ghand("export", ...args, "--texture", "256", "--out", "hand.glb");
}

for (const [name, args] of Object.entries(PLAIN)) {
  test(`glTF validator: no error, no warning: ${name}`, async () => {
    exported(args);
    assert.deepEqual(await problems("hand.glb"), []);
  });
}

test("glTF validator: a hand model without an avatar", async () => {
  folder.ghand("export", "builtin", "--out", "hand.glb");
  assert.deepEqual(await problems("hand.glb"), []);
});

test("glTF validator: of Gaussians only what it does not know", async () => {
  exported([LIT, "--motion", "count", "--gaussians"]);
  const { meshes, nodes } = new Glb(folder.file("hand.glb")).json;
  const mesh = meshes.findIndex(({ name }) => name === "gaussians");
  const node = nodes.findIndex((node) => node.mesh === mesh);
  const attribute = (name) => `/meshes/${mesh}/primitives/0/attributes/KHR_gaussian_splatting:${name}`;
  const expected = ATTRIBUTES.map((name) => `MESH_PRIMITIVE_INVALID_ATTRIBUTE ${attribute(name)}`);
  // The weights are for readers that pose Gaussians; a skin would move the points in others, but not turn them.
  expected.push(`NODE_SKINNED_MESH_WITHOUT_SKIN /nodes/${node}`);
  const extensions = ["KHR_gaussian_splatting", "GHAND_gaussian_avatar"];
  const found = await problems("hand.glb");
  const unsupported = found.filter((problem) => problem.startsWith("UNSUPPORTED_EXTENSION"));
  assert(unsupported.length <= extensions.length);
  assert.deepEqual(found.filter((problem) => !unsupported.includes(problem)).sort(), expected.sort());
});

test("glTF validator: faults are found", async () => {
  exported([LIT, "--motion", "count"]);
  const attributes = (glb) => glb.json.meshes[0].primitives[0].attributes;
  const faults = {
    MESH_PRIMITIVE_ATTRIBUTES_ACCESSOR_INVALID_FORMAT: (glb) => (attributes(glb).NORMAL = attributes(glb).TEXCOORD_0),
    ACCESSOR_VECTOR3_NON_UNIT: (glb) => (glb.floats(attributes(glb).NORMAL)[0][0] += 2),
    ACCESSOR_MAX_MISMATCH: (glb) => (glb.floats(attributes(glb).POSITION)[0][0] += 1),
  };
  for (const [code, change] of Object.entries(faults)) {
    broken(folder, "hand.glb", "broken.glb", change);
    assert((await problems("broken.glb")).some((problem) => problem.startsWith(`${code} `)), code);
  }
});

test("weights of correctives are between 0 and 1, where programs keep them", () => {
  exported([LIT, "--pose", "fist", "--motion", "count"]);
  const glb = new Glb(folder.file("hand.glb"));
  const { channels, samplers } = glb.json.animations[0];
  const { sampler } = channels.find(({ target }) => target.path === "weights");
  const weights = glb.floats(samplers[sampler].output).map(([weight]) => weight).concat(glb.json.meshes[0].weights);
  assert(weights.some((weight) => weight > 0.5));
  assert(weights.every((weight) => weight >= 0 && weight <= 1));
});
