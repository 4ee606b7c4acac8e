"""What is refused, and with which sentence."""

import multiprocessing
import subprocess
import sys

import ghand
import numpy as np
import pytest
from conftest import AVATAR, ROOT


def test_files_that_are_no_avatars_are_refused(tmp_path):
    damaged = tmp_path / "damaged.ghand"
    damaged.write_bytes(AVATAR.read_bytes()[:5000])
    foreign = tmp_path / "foreign.ghand"
    foreign.write_bytes(b"\x89PNG not an avatar")
    for path in [damaged, foreign, tmp_path / "missing.ghand", tmp_path]:
        with pytest.raises(ghand.Error, match=path.name):
            ghand.load(path)
    with pytest.raises(ghand.Error, match="light"):
        ghand.load(AVATAR, light="moon.png")


def test_wrong_poses_are_refused(hand):
    joints = len(hand.joint_names)
    with_nan = np.zeros((joints, 3))
    with_nan[2, 1] = np.nan
    cases = [
        ("waving", ghand.Error, 'unknown pose "waving"'),
        ("count", ghand.Error, "choose one with frame="),
        ("missing.json", ghand.Error, "missing.json"),
        (np.zeros((joints, 2)), ValueError, r"rotations: has the shape \(25, 2\)"),
        (np.zeros(joints * 3), ValueError, r"rotations: has the shape \(75,\), must have"),
        (np.zeros((joints - 1, 3)), ValueError, "has 24 joints, and the hand 25"),
        (np.zeros((joints, 4)), ValueError, "must have the length 1"),
        (np.zeros((joints, 3, 3)), ValueError, r"rotations\[0\]: is no rotation"),
        (with_nan, ValueError, "number 7 is NaN"),
        (np.full((joints, 3), 1e6), ValueError, "radians"),
        (np.zeros((joints, 3), complex), TypeError, "complex"),
        ([["a"] * 3] * joints, TypeError, "pose: must be a name.*not of type"),
        (object(), TypeError, "pose: must be a name.*not of type"),
        ({"elbow": [0, 0, 0]}, ValueError, 'there is no joint "elbow"'),
        ({"wrist": [0, 0]}, ValueError, r"wrist: has the shape \(2,\)"),
    ]
    for pose, kind, sentence in cases:
        with pytest.raises(kind, match=sentence):
            hand.pose(pose)
    with pytest.raises(ghand.Error, match="has no frame 999"):
        hand.pose("count", frame=999)
    assert hand.pose("count", frame=3)
    with pytest.raises(ValueError, match="frame: chooses"):
        hand.pose(np.zeros((joints, 3)), frame=1)
    with pytest.raises(ValueError, match="metres"):
        hand.pose(translation=[1e9, 0, 0])
    with pytest.raises(ghand.Error, match="does not know how its capture's tracker is off"):
        hand.pose("fist", same_tracker=True)
    with pytest.raises(ValueError, match="same_tracker: an avatar knows"):
        ghand.read_poses("fist", same_tracker=True)
    with pytest.raises(ValueError, match="side"):
        ghand.read_poses("fist", side="both")


def test_wrong_cameras_are_refused(hand):
    k = np.diag([500.0, 500, 1])
    with pytest.raises(ValueError, match="focal lengths"):
        ghand.Camera(10, 10, np.diag([0.0, 5, 1]))
    with pytest.raises(ValueError, match="skew"):
        ghand.Camera(10, 10, [[5, 1, 0], [0, 5, 0], [0, 0, 1]])
    with pytest.raises(ValueError, match="rotation: is no rotation"):
        ghand.Camera(10, 10, k, np.diag([1, 1, -1.0]))
    with pytest.raises(ValueError, match="pixels"):
        ghand.Camera(0, 10, k)
    with pytest.raises(ValueError, match="pixels"):
        ghand.Camera(10, 100_000, k)
    with pytest.raises(ValueError, match="look somewhere"):
        ghand.Camera.look_at([0, 0, 0], [0, 0, 0])
    with pytest.raises(OverflowError):
        ghand.Camera(-1, 10, k)
    with pytest.raises(TypeError):
        hand.pose().render("camera")
    with pytest.raises(ValueError, match='there is no "front"'):
        hand.pose().camera("front")
    with pytest.raises(ValueError, match="background"):
        hand.pose().render(ghand.Camera(4, 4, k), background=[2, 0, 0])
    with pytest.raises(ghand.Error, match="missing.json"):
        ghand.read_cameras("missing.json")


def test_wrong_batches_are_refused(hand):
    a, b = (hand.pose().camera(size=size) for size in [(8, 8), (8, 9)])
    for poses, cameras, sentence in [
        ([], a, "are 0 and 1"),
        (["rest"] * 3, [a, a], "are 3 and 2"),
        ("rest", [a, b], "8x9"),
    ]:
        with pytest.raises(ValueError, match=sentence):
            hand.render_batch(poses, cameras)


def test_a_closed_avatar_says_so():
    hand = ghand.load(AVATAR)
    posed = hand.pose()
    camera = posed.camera(size=(8, 8))
    posed.render(camera)
    hand.close()
    hand.close()
    for use in [lambda: posed.render(camera), posed.gaussians, posed.vertices, lambda: posed.depth(camera), hand.pose]:
        with pytest.raises(ghand.Error, match="is closed"):
            use()


def test_a_picture_larger_than_a_band_is_whole(hand):
    camera = hand.pose().camera(size=(480, 640))
    small = hand.pose().render(camera)
    large = hand.pose().render(camera.resized(4800, 6400))
    assert large.shape == (6400, 4800, 4)
    blocks = large[..., 3].reshape(640, 10, 480, 10).mean(axis=(1, 3))
    assert np.abs(blocks - small[..., 3]).mean() < 0.002


def draw_in_child(queue):
    try:
        with ghand.load(AVATAR) as hand:
            hand.pose().render(hand.pose().camera(size=(8, 8)))
        queue.put("drawn")
    except ghand.Error as error:
        queue.put(str(error))


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="fork")
def test_a_forked_process_is_told_to_spawn(hand):
    hand.pose().render(hand.pose().camera(size=(8, 8)))
    for method, answer in [("fork", "was forked"), ("spawn", "drawn")]:
        context = multiprocessing.get_context(method)
        queue = context.Queue()
        process = context.Process(target=draw_in_child, args=(queue,))
        process.start()
        assert answer in queue.get(timeout=60)
        process.join()


def test_an_adapter_that_is_not_there_is_named():
    code = f"import ghand; h = ghand.load({str(AVATAR)!r}); p = h.pose(); p.render(p.camera())"
    environment = {"GHAND_ADAPTER": "nonexistent", "PATH": "/usr/bin"}
    done = subprocess.run(
        [sys.executable, "-c", code], check=False, env=environment, capture_output=True, text=True, cwd=ROOT
    )
    assert done.returncode == 1 and "ghand.Error" in done.stderr and "nonexistent" in done.stderr
