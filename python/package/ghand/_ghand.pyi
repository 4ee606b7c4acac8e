from collections.abc import Callable, Iterable, Sequence
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, TypeAlias, final, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import Self

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
    "close_device",
    "evaluate",
    "load",
    "read_cameras",
    "read_poses",
    "train",
]

__version__: str
POSES: list[str]
"""Names of the poses that every hand can take."""
MOTIONS: list[str]
"""Names of the motions that every hand can play."""

_Path: TypeAlias = str | PathLike[str]
_Side: TypeAlias = Literal["back", "palm", "thumb-side", "little-finger-side", "fingertips"]
_AnyPose: TypeAlias = Pose | PosedAvatar | _Path | ArrayLike | dict[str, ArrayLike]

class Error(Exception):
    """What ghand refuses, or what has failed, in one sentence."""

@final
class Camera:
    """A pinhole camera of OpenCV: x right, y down, z forward; pixel centres at half-integers."""

    def __new__(
        cls,
        width: int,
        height: int,
        intrinsics: ArrayLike,
        rotation: ArrayLike | None = None,
        translation: ArrayLike | None = None,
    ) -> Self:
        """A calibrated camera: `intrinsics` `(3, 3)` in pixels; `rotation` `(3, 3)` and `translation` `(3,)` in metres take
        world to camera."""
    @staticmethod
    def look_at(
        eye: ArrayLike,
        target: ArrayLike,
        width: int = 512,
        height: int = 512,
        up: ArrayLike | None = None,
        fov: float = 0.6,
    ) -> Camera:
        """A camera at `eye` that looks at `target`; `up` is -y by default, `fov` that of the height in radians."""
    @property
    def id(self) -> str:
        """Its name in the file that it was read from."""
    @property
    def width(self) -> int: ...
    @property
    def height(self) -> int: ...
    @property
    def intrinsics(self) -> NDArray[np.float64]:
        """`K`, `(3, 3)`, pixels."""
    @property
    def world_to_camera(self) -> NDArray[np.float64]:
        """`(4, 4)`: gsplat's `viewmats`."""
    @property
    def center(self) -> NDArray[np.float64]:
        """Its place in the world, metres, `(3,)`."""
    def project(self, points: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Pixels `(N, 2)` and depths `(N,)` in metres of points `(N, 3)`."""
    def resized(self, width: int, height: int) -> Camera:
        """The same view in another size."""
    def __eq__(self, other: object, /) -> bool: ...
    def __getnewargs__(self) -> tuple[int, int, NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]: ...

@final
class Pose:
    """A rotation for each joint, relative to its parent, and the translation of the hand."""

    def __new__(cls, rotations: ArrayLike, translation: ArrayLike | None = None) -> Self:
        """From axis-angle rotations `(J, 3)` in radians, quaternions `(J, 4)` w first, or matrices `(J, 3, 3)`;
        `translation` in metres."""
    @property
    def rotations(self) -> NDArray[np.float64]:
        """Axis-angle, radians, `(J, 3)`."""
    @property
    def translation(self) -> NDArray[np.float64]:
        """Metres, `(3,)`."""
    def __eq__(self, other: object, /) -> bool: ...
    def __getnewargs__(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...

@final
class Poses(Sequence[Pose]):
    """Poses at a constant rate."""

    @property
    def fps(self) -> float:
        """Frames per second."""
    @property
    def duration(self) -> float:
        """Seconds from the first to the last."""
    @property
    def joint_names(self) -> list[str]:
        """`J` names."""
    @property
    def ids(self) -> list[str]:
        """The names of the frames, `T`."""
    @property
    def rotations(self) -> NDArray[np.float64]:
        """Axis-angle, radians, `(T, J, 3)`."""
    @property
    def translations(self) -> NDArray[np.float64]:
        """Metres, `(T, 3)`."""
    def at(self, seconds: float) -> Pose:
        """The pose at a time, interpolated."""
    def __len__(self) -> int: ...
    @overload
    def __getitem__(self, index: int, /) -> Pose: ...
    @overload
    def __getitem__(self, index: slice, /) -> list[Pose]: ...

@final
class PosedAvatar:
    """An avatar in a pose."""

    @property
    def pose(self) -> Pose: ...
    def vertices(self) -> NDArray[np.float32]:
        """The vertices of the hand model, metres, `(V, 3)`."""
    def joints(self) -> NDArray[np.float32]:
        """The joints, metres, `(J, 3)`."""
    def landmarks(self) -> NDArray[np.float32]:
        """The 21 landmarks in MediaPipe's order (wrist, then four of each finger, thumb to little finger), metres."""
    def gaussians(self, camera: Camera | None = None) -> dict[str, NDArray[np.float32]]:
        """The Gaussians in gsplat's convention: `means` `(N, 3)` in metres, `quats` `(N, 4)` w first, `scales` `(N, 3)`,
        `opacities` `(N,)`, `colors` `(N, 3)`: display values from 0 to 1, which highlights exceed. Gloss is as `camera`
        sees it, if given."""
    def render(self, camera: Camera, background: ArrayLike | None = None) -> NDArray[np.float32]:
        """A picture `(height, width, 4)`: display colours from 0 to 1 over the background (black), and coverage. Over black
        they are premultiplied. A warning says why a picture is empty."""
    def depth(self, camera: Camera) -> NDArray[np.float32]:
        """Depths along the camera's axis, metres, `(height, width)`; 0 where there is no hand."""
    def camera(self, side: _Side | None = None, size: tuple[int, int] = (512, 512)) -> Camera:
        """A camera whose picture (width, height) the hand fills, from its back and a little from the thumb, or from a
        side."""
    def turntable(self, views: int, size: tuple[int, int] = (512, 512)) -> list[Camera]:
        """Cameras around the hand, from its back on."""

@final
class Avatar:
    """A hand that takes any pose. A context manager: its end frees its memory on the device."""

    @property
    def side(self) -> Literal["left", "right"]: ...
    @property
    def joint_names(self) -> list[str]:
        """`J` names."""
    @property
    def parents(self) -> list[int]:
        """The parent of each joint, -1 of the root."""
    @property
    def faces(self) -> NDArray[np.uint32]:
        """The triangles of its mesh, `(F, 3)`."""
    @property
    def antialiased(self) -> bool:
        """Whether Gaussians smaller than a pixel become fainter: gsplat's `rasterize_mode="antialiased"`."""
    @property
    def blur(self) -> float:
        """The blur of a pixel, square pixels: gsplat's `eps2d`."""
    def __len__(self) -> int:
        """Number of its Gaussians."""
    def pose(
        self,
        pose: _AnyPose | None = None,
        translation: ArrayLike | None = None,
        *,
        frame: int | str | None = None,
        same_tracker: bool = False,
    ) -> PosedAvatar:
        """The avatar in a pose (at rest by default): one of `ghand.POSES`, a file (of several poses with `frame`), a
        `Pose`, rotations of all joints as `Pose` takes them, or axis-angle rotations by joint names.
        `same_tracker`: it comes from the tracker that gave the avatar's training poses, whose constant errors are undone."""
    def render_batch(
        self,
        poses: _AnyPose | Iterable[_AnyPose],
        cameras: Camera | Iterable[Camera],
        background: ArrayLike | None = None,
    ) -> NDArray[np.float32]:
        """Pictures `(B, height, width, 4)` of `poses` from `cameras`: one of each picture, or one for all."""
    def close(self) -> None: ...
    def __enter__(self) -> Self: ...
    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...

@final
class Progress:
    """How far a training is."""

    iteration: int
    iterations: int
    stage: int
    """1 while poses are refined, then 2."""
    l1: float | None
    """Mean absolute error of the last images, once there are enough."""
    held_out_psnr: float | None
    """PSNR of images held out, dB, once it was measured."""

@final
class TrainResult:
    """What a training has made."""

    folder: Path
    avatar: Path
    """The avatar's file."""
    metrics: dict[str, Any] | None
    """The contents of `metrics.json`."""

def load(path: _Path, *, light: _Path | None = None, light_turn: float = 0.0) -> Avatar:
    """Loads an avatar: a `.ghand` file, or a `.glb` with `GHAND_gaussian_avatar`. `light` is "capture", "studio" or a
    panorama (.exr, .hdr), turned about the vertical by `light_turn` degrees."""

def read_poses(
    source: _Path,
    avatar: Avatar | None = None,
    *,
    side: Literal["left", "right"] | None = None,
    pose_model: _Path | None = None,
    flat_mean: bool = False,
    mirrored: bool | None = None,
    take: str | None = None,
    in_place: bool = False,
    cameras: _Path | None = None,
    file_fps: float | None = None,
    smooth: bool = False,
    fps: float | None = None,
    same_tracker: bool = False,
) -> Poses:
    """Reads one of `ghand.POSES` or `ghand.MOTIONS`, or a file of poses of any kind that ghand reads, for an avatar's
    skeleton; without one, for the built-in right hand. The keywords are the options of `ghand render`."""

def read_cameras(path: _Path) -> dict[str, Camera]:
    """The cameras of a capture or of another tool's calibration, by their ids, without the distortion of lenses."""

def train(
    capture: _Path | None = None,
    out: _Path | None = None,
    settings: dict[str, Any] | None = None,
    on_progress: Callable[[Progress], object] | None = None,
    **options: Any,
) -> TrainResult:
    """Trains an avatar, as the program `train` does; without a capture, on a synthetic one. `settings` are those of
    `train --set`, `options` its other options: `preset="quick"`, `poses="truth"`, `resume=True`, `max_time="5m"`. Ctrl-C, or
    an exception in `on_progress`, stops the training after an iteration and saves the avatar."""

def evaluate(avatar: _Path, capture: _Path, out: _Path | None = None, **options: Any) -> dict[str, Any]:
    """Compares an avatar with images of a capture, as `ghand evaluate` does, and returns the figures. `options` are its
    other options: `split="test"`, `protocol="masks"`."""

def close_device() -> None: ...
