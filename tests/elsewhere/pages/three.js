/** three.js draws a .glb: its mesh by WebGL, or its Gaussians by WebGPU. */
import * as THREE from "three";
import { WebGPURenderer } from "three/webgpu";
import { GLTFGaussianSplatLoaderExtension } from "three/addons/loaders/GLTFGaussianSplatLoaderExtension.js";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";

import { FAR, NEAR, fieldOfView, viewMatrix } from "./camera.js";

/** The first frame compiles shaders and sorts the Gaussians; the second has them. */
const FRAMES = 2;

function cameraOf(camera) {
  const [degrees, aspect] = [THREE.MathUtils.radToDeg(fieldOfView(camera)), camera.width / camera.height];
  const own = new THREE.PerspectiveCamera(degrees, aspect, NEAR, FAR);
  new THREE.Matrix4().fromArray(viewMatrix(camera)).invert().decompose(own.position, own.quaternion, own.scale);
  return own;
}

/** Draws a scene of `url`, 0 the mesh, 1 the Gaussians: `seconds` into its first animation, else as it opens. */
export async function draw({ url, camera, scene = 0, seconds, linear = false }) {
  const gaussians = scene > 0;
  const loader = new GLTFLoader();
  if (gaussians) loader.register((parser) => new GLTFGaussianSplatLoaderExtension(parser));
  const { scenes, animations } = await loader.loadAsync(url);
  if (seconds !== undefined) {
    const mixer = new THREE.AnimationMixer(scenes[scene]);
    mixer.clipAction(animations[0]).play();
    mixer.setTime(seconds);
  }
  // Light from everywhere, which shows the albedo of a lit material.
  const world = new THREE.Scene().add(scenes[scene], new THREE.AmbientLight(0xffffff, Math.PI));
  world.background = new THREE.Color(0);
  const options = { canvas: document.querySelector("canvas"), antialias: !gaussians };
  const renderer = gaussians ? new WebGPURenderer(options) : new THREE.WebGLRenderer(options);
  if (gaussians) await renderer.init();
  if (linear) renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
  renderer.setSize(camera.width, camera.height);
  const own = cameraOf(camera);
  for (let frame = 0; frame < FRAMES; frame++) {
    await new Promise(requestAnimationFrame);
    await renderer.render(world, own);
  }
}
