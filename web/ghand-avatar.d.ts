/**
 * `<ghand-avatar>`: shows animatable hand avatars of ghand in a page, with WebGPU.
 *
 *     <script type="module" src="ghand-avatar.js"></script>
 *     <ghand-avatar src="hand.ghand" motion="count" controls></ghand-avatar>
 *
 * Attributes: `src` (URLs of .ghand files, separated by spaces), `pose`, `motion`, `light` (`capture`, `studio`),
 * `light-turn` (degrees), `layer` (`skin`, `albedo`, `views`), `controls`, `connect` (address of a WebSocket that sends packets of poses), `mediapipe` (folder
 * of MediaPipe, for the webcam), `poster` (a picture where there is no WebGPU), `alt` (text for screen readers).
 * The background is the page's: the canvas is transparent.
 *
 * World axes are ghand's: x right, y down, z forward, metres. Rotations are axis-angle vectors, radians.
 */

/** A pose: its name, numbers (an axis-angle vector for each joint, then optionally the translation), or an object in any
 * form that ghand reads from files. */
export type PoseLike = string | number[] | number[][] | Float32Array | Float64Array | object;
/** Rotation of a joint: an axis-angle vector, or some of its angles, radians. */
export type JointLike = [number, number, number] | Float32Array | Float64Array | Partial<JointAngles>;

export interface JointAngles {
  /** Towards the palm. */
  flexion: number;
  /** Away from the middle finger, or the thumb away from the palm. */
  abduction: number;
  /** Pronation. */
  twist: number;
}

export interface Joint {
  name: string;
  /** Number of its parent; null for the wrist. */
  parent: number | null;
  /** Ranges of a healthy adult, radians; null if the name is unknown. */
  limits: { [angle in keyof JointAngles]: [number, number] } | null;
}

export interface Hand {
  name: string;
  side: "left" | "right";
  joints: Joint[];
  gaussians: number;
  baked: boolean;
  /** Whether other lights than the capture's can be chosen. */
  relightable: boolean;
  /** The layers that it can show. */
  layers: Layer[];
  capture: string;
}

/** The hand in its light, its skin without light, or how much training saw of each place. */
export type Layer = "skin" | "albedo" | "views";

export interface View {
  /** Metres, world. */
  position: [number, number, number];
  target: [number, number, number];
  /** Upwards in the picture. */
  up: [number, number, number];
  /** Field of view along the shorter edge, degrees. */
  fov: number;
}

export type ViewSide = "back" | "palm" | "thumb-side" | "little-finger-side" | "fingertips";

export interface Playback {
  /** Seconds. */
  time: number;
  duration: number;
  playing: boolean;
  repeat: boolean;
  speed: number;
}

/** Events: `load` (detail: { hands }), `progress` ({ loaded, total } bytes; total 0 if unknown), `frame`, `error`
 * ({ message }), `live` ({ message }), `devicelost` ({ message }), `devicerestored`. */
export class GhandAvatar extends HTMLElement {
  /** Resolves when the avatars are shown; rejects with one sentence if they cannot be. */
  readonly ready: Promise<void>;
  readonly hands: Hand[];
  /** Names of poses and motions, once ready. */
  readonly poses: string[];
  readonly motions: string[];
  /** The graphics adapter and the kernels on it. */
  readonly device: string;
  readonly paused: boolean;
  /** The names of the pose or motion that is shown; "" for others; and the layer. */
  readonly shown: { pose: string; motion: string; layer: Layer };

  /** Goes to a pose; `hand` null is all hands. Seconds: 0.3. */
  pose(pose: PoseLike, options?: { hand?: number | null; seconds?: number }): void;
  /** The pose now: an axis-angle vector for each joint, then the translation. */
  joints(hand?: number): Float32Array;
  /** Sets joints by name, at once. */
  setJoints(joints: { [name: string]: JointLike }, options?: { hand?: number }): void;
  angles(joint: string, hand?: number): JointAngles | null;
  /** Plays a motion by name, or poses from a URL, a file or an object. Repeats unless told otherwise. */
  play(
    motion: string | URL | Blob | object,
    options?: { hand?: number | null; repeat?: boolean; speed?: number },
  ): Promise<void>;
  pause(): void;
  resume(): void;
  seek(seconds: number): void;
  playback(hand?: number): Playback | null;
  /** Sets the view, in part or by a side, and returns it. */
  camera(view?: Partial<View> | ViewSide): View | null;
  light(name: "capture" | "studio", turn?: number): void;
  /** Shows a layer of all hands. */
  layer(name: Layer): void;
  /** A picture in any size; the background in display values from 0 to 1. */
  picture(options?: { width?: number; height?: number; background?: [number, number, number] }): Promise<ImageData>;
  /** Drives the hands by one packet of live poses. */
  packet(packet: object | string | Uint8Array, options?: { inPlace?: boolean }): void;
  /** Drives the hands by the packets of a WebSocket. */
  connect(url: string): void;
  /** Drives the hands by the camera, or by a video of the page. */
  webcam(options?: { mediapipe?: string; video?: HTMLVideoElement | null }): Promise<void>;
  /** Drives the hands by a frame of the page's WebXR session with `hand-tracking`; false if no hand is tracked. */
  xrFrame(frame: XRFrame, referenceSpace: XRReferenceSpace, options?: { inPlace?: boolean }): boolean;
  stopLive(): void;
  /** Loses the graphics device, as a reset driver does: for tests of a page. */
  loseDevice(): void;
}

declare global {
  interface HTMLElementTagNameMap {
    "ghand-avatar": GhandAvatar;
  }
}
