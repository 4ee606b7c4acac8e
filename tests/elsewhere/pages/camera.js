/** ghand's cameras as WebGL has them: y up, and the camera looks along -z. Matrices are column by column. */

export const NEAR = 0.01;
export const FAR = 10;

/** From the world to the camera. */
export function viewMatrix({ rotation: [right, down, forward], translation: [x, y, z] }) {
  return [0, 1, 2].flatMap((c) => [right[c], -down[c], -forward[c], 0]).concat([x, -y, -z, 1]);
}

/** Vertical field of view, radians. The axis goes through the middle of the picture. */
export function fieldOfView({ height, intrinsics }) {
  return 2 * Math.atan(height / 2 / intrinsics[1][1]);
}
