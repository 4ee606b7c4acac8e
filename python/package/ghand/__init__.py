"""Real-time, animatable hand avatars from a few camera views.

Lengths are metres, angles radians, cameras those of OpenCV (x right, y down, z forward). Pictures are drawn on a graphics
device, which is opened when something is first drawn; the environment variable `GHAND_ADAPTER` chooses it. Lines and
warnings go to the logger `ghand` of `logging`.

    import ghand

    hand = ghand.load("hand.ghand")
    fist = hand.pose("fist")
    picture = fist.render(fist.camera("palm", size=(334, 512)))  # (512, 334, 4), float32
    splats = fist.gaussians()  # means, quats, scales, opacities, colors
"""

import atexit

from ghand._ghand import (
    MOTIONS,
    POSES,
    Avatar,
    Camera,
    Error,
    Pose,
    PosedAvatar,
    Poses,
    Progress,
    TrainResult,
    __version__,
    close_device,
    evaluate,
    load,
    read_cameras,
    read_poses,
    train,
)

__all__ = [
    "MOTIONS",
    "POSES",
    "Avatar",
    "Camera",
    "Error",
    "Pose",
    "PosedAvatar",
    "Poses",
    "Progress",
    "TrainResult",
    "__version__",
    "evaluate",
    "load",
    "read_cameras",
    "read_poses",
    "train",
]

# The driver must not be unloaded while it works.
atexit.register(close_device)
