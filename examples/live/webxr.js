// Sends the joints of a hand of a WebXR session to the viewer: call this in each frame of the session. `socket` is a
// WebSocket to ws://127.0.0.1:4263; docs/poses.md has the packet.
function sendJoints(socket, frame, inputSource, referenceSpace) {
  const joints = {};
  for (const [name, space] of inputSource.hand) {
    const pose = frame.getJointPose(space, referenceSpace);
    if (!pose) return; // the hand is not tracked now
    joints[name] = { transform: { matrix: Array.from(pose.transform.matrix) } };
  }
  socket.send(JSON.stringify({ handedness: inputSource.handedness, joints, sent_ms: Date.now() }));
}
