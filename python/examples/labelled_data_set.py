"""Renders a labelled synthetic data set of a hand: pictures, masks, depths, joints in space and in the pictures.

    pip install pillow
    python labelled_data_set.py AVATAR.ghand [OUT [COUNT]]

Each sample has a random pose between two of ghand's, a random turn of the hand, a random camera and a random background.
`labels.json` has a list with `image`, `mask`, `depth` (an .npy, metres), `intrinsics`, `world_to_camera`, the pose
(`rotations`, `translation`), `landmarks` (21 in MediaPipe's order, metres), `landmarks_2d` (pixels) and `visible`.
"""

import json
import sys
from pathlib import Path

import ghand
import numpy as np
from PIL import Image

SIZE = (256, 256)
# A landmark deeper than this under the surface that the camera sees is hidden, metres.
FLESH = 0.025


def random_pose(hand: ghand.Avatar, random: np.random.Generator) -> ghand.PosedAvatar:
    """A pose on the way from one of ghand's to another, with the whole hand turned."""
    a, b = (hand.pose(name).pose.rotations for name in random.choice(ghand.POSES, 2))
    rotations = a + random.uniform() * (b - a)
    axis = random.normal(size=3)
    rotations[0] = random.uniform(0, np.pi) * axis / np.linalg.norm(axis)
    return hand.pose(rotations)


def random_camera(posed: ghand.PosedAvatar, random: np.random.Generator) -> ghand.Camera:
    """A camera at 35 to 70 cm that looks at the hand's middle, more or less."""
    middle = posed.vertices().mean(axis=0) + random.normal(scale=0.01, size=3)
    direction = random.normal(size=3)
    eye = middle + random.uniform(0.35, 0.7) * direction / np.linalg.norm(direction)
    return ghand.Camera.look_at(eye, middle, *SIZE, up=random.normal(size=3), fov=0.5)


def sample(hand: ghand.Avatar, out: Path, name: str, random: np.random.Generator) -> dict[str, object]:
    """Renders a sample and returns its labels."""
    posed = random_pose(hand, random)
    camera = random_camera(posed, random)
    picture = posed.render(camera, background=random.uniform(size=3))
    depth = posed.depth(camera)
    landmarks = posed.landmarks()
    pixels, depths = camera.project(landmarks)
    column, row = np.clip(pixels.astype(int), 0, np.array(SIZE) - 1).T
    inside = np.all((pixels >= 0) & (pixels < SIZE), axis=1)
    visible = inside & (depths < depth[row, column] + FLESH)

    Image.fromarray((picture[..., :3] * 255).round().astype(np.uint8)).save(out / f"{name}.png")
    Image.fromarray((picture[..., 3] > 0.5).astype(np.uint8) * 255).save(out / f"{name}_mask.png")
    np.save(out / f"{name}_depth.npy", depth)
    return {
        "image": f"{name}.png",
        "mask": f"{name}_mask.png",
        "depth": f"{name}_depth.npy",
        "intrinsics": camera.intrinsics.tolist(),
        "world_to_camera": camera.world_to_camera.tolist(),
        "rotations": posed.pose.rotations.tolist(),
        "translation": posed.pose.translation.tolist(),
        "landmarks": landmarks.tolist(),
        "landmarks_2d": pixels.tolist(),
        "visible": visible.tolist(),
    }


def main(avatar: str, out: str = "data_set", count: str = "16") -> None:
    folder = Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    random = np.random.default_rng(0)
    with ghand.load(avatar) as hand:
        labels = [sample(hand, folder, f"{number:06}", random) for number in range(int(count))]
    (folder / "labels.json").write_text(json.dumps(labels, indent=1))
    print(f"{folder}: {count} samples")


if __name__ == "__main__":
    main(*sys.argv[1:])
