/** Where three.js moves the vertices of a .glb, without a browser. */
import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";

import { Glb } from "./glb.mjs";

/** Positions of the vertices at some times of the first animation, `[time][vertex]`, metres. */
export async function posedByThree(path, times) {
  const glb = new Glb(path);
  // Node has no decoder for pictures.
  for (const unused of ["images", "textures", "samplers", "materials"]) delete glb.json[unused];
  for (const { primitives } of glb.json.meshes) for (const primitive of primitives) delete primitive.material;
  const { scene, animations } = await new GLTFLoader().parseAsync(new Uint8Array(glb.bytes()).buffer, "");
  const mixer = new THREE.AnimationMixer(scene);
  mixer.clipAction(animations[0]).play();
  let mesh;
  scene.traverse((item) => (mesh = item.isSkinnedMesh ? item : mesh));
  const { count } = mesh.geometry.attributes.position;
  return times.map((time) => {
    mixer.setTime(time);
    scene.updateMatrixWorld(true);
    return Array.from({ length: count }, (_, i) =>
      mesh.getVertexPosition(i, new THREE.Vector3()).applyMatrix4(mesh.matrixWorld).toArray());
  });
}
