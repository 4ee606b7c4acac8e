/** PlayCanvas draws Gaussians: those of a .glb or a .ply. */
import * as pc from "playcanvas";

import { FAR, NEAR, fieldOfView, viewMatrix } from "./camera.js";

function load(app, kind, url) {
  const asset = new pc.Asset("hand", kind, { url, filename: url.split("/").pop() });
  return new Promise((loaded, fail) => {
    asset.on("load", () => loaded(asset));
    asset.on("error", (problem) => fail(new Error(problem)));
    app.assets.add(asset);
    app.assets.load(asset);
  });
}

function cameraOf(camera) {
  const own = new pc.Entity();
  const fov = (fieldOfView(camera) * 180) / Math.PI;
  own.addComponent("camera", { clearColor: new pc.Color(0, 0, 0), nearClip: NEAR, farClip: FAR, fov });
  const world = new pc.Mat4();
  world.set(viewMatrix(camera));
  world.invert();
  own.setPosition(world.getTranslation());
  own.setRotation(new pc.Quat().setFromMat4(world));
  return own;
}

/** Draws a .ply, or the scene of a .glb in which ghand has the Gaussians. */
export async function draw({ url, camera }) {
  const app = new pc.Application(document.querySelector("canvas"), { graphicsDeviceOptions: { antialias: false } });
  app.setCanvasFillMode(pc.FILLMODE_NONE, camera.width, camera.height);
  app.setCanvasResolution(pc.RESOLUTION_FIXED, camera.width, camera.height);
  app.start();
  app.root.addChild(cameraOf(camera));
  let hand = new pc.Entity();
  if (url.endsWith(".ply")) {
    hand.addComponent("gsplat", { asset: await load(app, "gsplat", url) });
  } else {
    hand = (await load(app, "container", url)).resource.instantiateRenderEntity();
    // It has all scenes.
    for (const scene of hand.children) scene.enabled = scene.name === "gaussians";
  }
  const sorted = new Promise((done) => {
    app.systems.gsplat.on("frame:ready", (_camera, _layer, ready, loading) => ready && loading === 0 && done());
  });
  app.root.addChild(hand);
  await sorted;
  // The next frame has all; more would only delay the photograph.
  await new Promise((drawn) => app.once("frameend", drawn));
  app.autoRender = false;
}
