"""Draws an avatar from its arrays, as gsplat does: with gsplat itself on a CUDA device, else in NumPy.

    python gsplat_arrays.py AVATAR.ghand [POSE]

Prints how far the picture is from ghand's. In PyTorch the arrays are leaves that can be optimised.
"""

import sys

import ghand
import numpy as np
from numpy.typing import NDArray

# gsplat's: the least and the largest opacity of a splat in a pixel.
LEAST, LARGEST = 1 / 255, 0.999


def with_gsplat(splats: dict[str, NDArray[np.float32]], camera: ghand.Camera, hand: ghand.Avatar) -> NDArray[np.float64]:
    """A picture (height, width, 3) by gsplat, over black."""
    import torch
    from gsplat import rasterization

    def tensor(values: NDArray[np.floating]) -> torch.Tensor:
        return torch.tensor(values, dtype=torch.float32, device="cuda")

    arrays = {name: tensor(values).requires_grad_() for name, values in splats.items()}
    picture, _, _ = rasterization(
        **arrays,
        viewmats=tensor(camera.world_to_camera)[None],
        Ks=tensor(camera.intrinsics)[None],
        width=camera.width,
        height=camera.height,
        rasterize_mode="antialiased" if hand.antialiased else "classic",
        eps2d=hand.blur,
    )
    return picture[0].detach().cpu().double().numpy()


def with_numpy(splats: dict[str, NDArray[np.float32]], camera: ghand.Camera, hand: ghand.Avatar) -> NDArray[np.float64]:
    """The same picture in NumPy, slowly."""
    to_camera, k = camera.world_to_camera, camera.intrinsics
    means = splats["means"] @ to_camera[:3, :3].T + to_camera[:3, 3]
    w, x, y, z = splats["quats"].T.astype(np.float64)
    rotations = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    ).transpose(2, 0, 1)
    axes = to_camera[:3, :3] @ rotations * splats["scales"][:, None, :]
    (px, py, pz), (fx, fy) = means.T, (k[0, 0], k[1, 1])
    jacobian = np.zeros((len(means), 2, 3))
    jacobian[:, 0, 0], jacobian[:, 1, 1] = fx / pz, fy / pz
    jacobian[:, 0, 2], jacobian[:, 1, 2] = -fx * px / pz**2, -fy * py / pz**2
    shape = jacobian @ axes
    sharp = shape @ shape.transpose(0, 2, 1)
    blurred = sharp + hand.blur * np.eye(2)
    opacities = splats["opacities"].astype(np.float64)
    if hand.antialiased:
        opacities *= np.sqrt(np.clip(np.linalg.det(sharp) / np.linalg.det(blurred), 0, None))
    conics = np.linalg.inv(blurred)
    pixels = np.stack([fx * px / pz + k[0, 2], fy * py / pz + k[1, 2]], axis=1)
    radii = np.ceil(3.33 * np.sqrt(np.linalg.eigvalsh(blurred)[:, 1]))

    picture = np.zeros((camera.height, camera.width, 3))
    left = np.ones((camera.height, camera.width))
    for i in np.argsort(pz):
        low = np.maximum(np.floor(pixels[i] - radii[i]), 0).astype(int)
        high = np.minimum(np.ceil(pixels[i] + radii[i]), (camera.width, camera.height)).astype(int)
        if np.any(low >= high):
            continue
        part = np.s_[low[1] : high[1], low[0] : high[0]]
        dx = np.arange(low[0], high[0]) + 0.5 - pixels[i, 0]
        dy = (np.arange(low[1], high[1]) + 0.5 - pixels[i, 1])[:, None]
        (a, b), (_, c) = conics[i]
        alpha = np.minimum(opacities[i] * np.exp(-0.5 * (a * dx**2 + c * dy**2) - b * dx * dy), LARGEST)
        weight = np.where(alpha >= LEAST, alpha, 0) * left[part]
        picture[part] += weight[..., None] * splats["colors"][i]
        left[part] -= weight
    return picture


def main(avatar: str, pose: str = "point") -> None:
    with ghand.load(avatar) as hand:
        posed = hand.pose(pose)
        camera = posed.camera(size=(167, 256))
        expected = posed.render(camera)[..., :3]
        splats = posed.gaussians(camera)
        try:
            import torch

            draw = with_gsplat if torch.cuda.is_available() else with_numpy
        except ImportError:
            draw = with_numpy
        picture = draw(splats, camera, hand)
    difference = np.clip(picture, 0, 1) - np.clip(expected, 0, 1)
    psnr = -10 * np.log10(np.mean(difference**2) + 1e-12)
    print(f"{draw.__name__}: {psnr:.1f} dB from ghand, largest difference {255 * np.abs(difference).max():.1f} of 255")


if __name__ == "__main__":
    main(*sys.argv[1:])
