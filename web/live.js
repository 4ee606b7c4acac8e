// What drives the hands from outside: a WebSocket, a webcam, WebXR. Each gives packets, as docs/poses.md has them, to
// `take(text)`, and returns a function that stops it.

const RECONNECT_MS = 1000;

/** Packets from a WebSocket; connects again when it is lost. */
export function followSocket(url, take, say) {
  let stopped = false;
  let socket = null;
  const connect = () => {
    socket = new WebSocket(url);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => say("connected");
    socket.onmessage = ({ data }) => take(typeof data === "string" ? data : new Uint8Array(data));
    socket.onclose = () => {
      if (stopped) return;
      say(`waiting for ${url}`);
      setTimeout(() => { if (!stopped) connect(); }, RECONNECT_MS);
    };
  };
  try {
    connect();
  } catch {
    throw new Error(`${url} is no address of a WebSocket; give ws:// or wss://`);
  }
  return () => {
    stopped = true;
    socket.close();
  };
}

// A packet of MediaPipe's result: pictures of a webcam are not mirrored.
function packetOf(result) {
  const points = (hand) => hand.map(({ x, y, z }) => ({ x, y, z }));
  return {
    worldLandmarks: result.worldLandmarks.map(points),
    handedness: result.handedness.map(([best]) => best.categoryName.toLowerCase()),
  };
}

/**
 * Packets from a webcam, or from a <video> that the page gives. `folder` has MediaPipe: `vision_bundle.mjs` and `wasm/`
 * of @mediapipe/tasks-vision, and `hand_landmarker.task`.
 */
export async function followWebcam(folder, video, take, say) {
  // MediaPipe draws pictures with WebGL, wherever it computes.
  if (!document.createElement("canvas").getContext("webgl2")) {
    throw new Error("MediaPipe needs WebGL 2; turn on hardware acceleration in the browser's settings");
  }
  const base = new URL(folder.endsWith("/") ? folder : `${folder}/`, document.baseURI);
  const file = (name) => new URL(name, base).href;
  say("loading MediaPipe");
  const missing = (name) => {
    throw new Error(`${file(name)} cannot be loaded; serve @mediapipe/tasks-vision and hand_landmarker.task there`);
  };
  const { FilesetResolver, HandLandmarker } = await import(file("vision_bundle.mjs")).catch(() => missing("vision_bundle.mjs"));
  const model = await fetch(file("hand_landmarker.task")).catch(() => null);
  if (!model?.ok) missing("hand_landmarker.task");
  const files = await FilesetResolver.forVisionTasks(file("wasm").replace(/\/$/, "")).catch(() => missing("wasm/"));
  const landmarker = await HandLandmarker.createFromOptions(files, {
    baseOptions: { modelAssetBuffer: new Uint8Array(await model.arrayBuffer()) },
    runningMode: "VIDEO",
    numHands: 2,
  });
  let stream = null;
  if (!video) {
    if (!navigator.mediaDevices) throw new Error("there is no camera here; open the page by https or from localhost");
    stream = await navigator.mediaDevices.getUserMedia({ video: { width: 640, height: 480 } }).catch((error) => {
      landmarker.close();
      throw new Error(`the camera cannot be used: ${error.message}`);
    });
    video = document.createElement("video");
    [video.muted, video.playsInline, video.srcObject] = [true, true, stream];
    await video.play();
  }
  say("shows no hand");
  let stopped = false;
  let shown = -1;
  const stop = () => {
    stopped = true;
    stream?.getTracks().forEach((track) => track.stop());
  };
  const step = () => {
    if (stopped) return;
    if (video.currentTime !== shown && video.videoWidth > 0) {
      shown = video.currentTime;
      let result;
      try {
        result = landmarker.detectForVideo(video, performance.now());
      } catch (error) {
        say(`MediaPipe has stopped: ${error.message}`);
        stop();
        return;
      }
      const count = result.worldLandmarks.length;
      say(["shows no hand", "shows one hand", "shows two hands"][Math.min(count, 2)]);
      if (count > 0) take(JSON.stringify(packetOf(result)));
    }
    requestAnimationFrame(step);
  };
  step();
  return () => {
    stop();
    landmarker.close();
  };
}

/** The packet of both hands of a frame of a WebXR session; null if none is tracked. */
export function xrPacket(frame, referenceSpace) {
  const hands = [];
  for (const { hand, handedness } of frame.session.inputSources) {
    if (!hand) continue;
    const joints = {};
    for (const [name, space] of hand) {
      const pose = frame.getJointPose(space, referenceSpace);
      if (pose) joints[name] = { transform: { matrix: Array.from(pose.transform.matrix) } };
    }
    if (Object.keys(joints).length === hand.size) hands.push({ handedness, joints });
  }
  return hands.length > 0 ? JSON.stringify({ hands }) : null;
}
