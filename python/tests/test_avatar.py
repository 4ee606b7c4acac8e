"""Avatars, poses, arrays and pictures."""

import copy
import pickle
import threading
import time

import ghand
import numpy as np
import pytest
from conftest import AVATAR


def test_an_avatar_describes_itself(hand):
    joints = len(hand.joint_names)
    assert hand.side == "right" and len(hand) > 20_000 and hand.antialiased is True
    assert hand.parents[0] == -1 and len(hand.parents) == joints
    assert hand.faces.shape[1] == 3 and hand.faces.max() + 1 == len(hand.pose().vertices())
    assert repr(hand).startswith("<ghand.Avatar ")
    assert hand.pose().joints().shape == (joints, 3)


def test_a_pose_is_given_in_any_form(hand):
    fist = hand.pose("fist").pose
    angle = np.linalg.norm(fist.rotations, axis=1, keepdims=True)
    axis = fist.rotations / np.maximum(angle, 1e-12)
    quaternions = np.hstack([np.cos(angle / 2), np.sin(angle / 2) * axis])
    expected = hand.pose("fist").vertices()
    by_name = dict(zip(hand.joint_names, fist.rotations))
    forms = [
        fist,
        hand.pose(fist),
        fist.rotations,
        fist.rotations.tolist(),
        quaternions,
        matrices(quaternions),
        by_name,
    ]
    for form in forms:
        assert np.abs(hand.pose(form).vertices() - expected).max() < 1e-6
    fortran = np.asfortranarray(fist.rotations)
    assert np.array_equal(hand.pose(fortran).pose.rotations, fist.rotations)
    moved = hand.pose("fist", translation=[0.1, 0, 0]).vertices()
    assert np.abs(moved - expected - [0.1, 0, 0]).max() < 1e-6


def matrices(quaternions):
    w, x, y, z = quaternions.T
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    ).transpose(2, 0, 1)


def test_poses_are_a_sequence(hand):
    poses = ghand.read_poses("count", hand)
    count = len(poses)
    assert poses.rotations.shape == (count, len(hand.joint_names), 3) and poses.translations.shape == (count, 3)
    assert np.array_equal(poses[-1].rotations, poses.rotations[-1])
    assert [len(poses[2:8:3]), len(list(poses)), len(poses.ids)] == [2, count, count]
    assert np.array_equal(poses.at(1 / poses.fps).rotations, poses[1].rotations) and poses.duration > 1
    half = ghand.read_poses("count", hand, fps=poses.fps / 2)
    assert abs(len(half) - count / 2) <= 1
    with pytest.raises(IndexError):
        poses[count]
    # For the built-in hand, without an avatar.
    assert len(ghand.read_poses("fist")) == 1


def test_a_picture_is_what_the_camera_sees(hand):
    posed = hand.pose("spread")
    camera = posed.camera("palm", size=(120, 160))
    picture = posed.render(camera)
    assert picture.shape == (160, 120, 4) and picture.dtype == np.float32 and picture.flags.c_contiguous
    assert picture.min() >= 0 and picture.max() <= 1
    pixels, depths = camera.project(posed.vertices())
    covered = np.argwhere(picture[..., 3] > 0.5)[:, ::-1] + 0.5
    assert np.abs(covered.min(axis=0) - pixels.min(axis=0)).max() < 3
    assert np.abs(covered.max(axis=0) - pixels.max(axis=0)).max() < 3
    depth = posed.depth(camera)
    seen = depth[picture[..., 3] > 0.9]
    assert depth.shape == (160, 120) and depth[0, 0] == 0
    assert depths.min() - 0.005 < seen.min() and seen.max() < depths.max() + 0.005
    # Background, and the same bytes again.
    white = posed.render(camera, background=[1, 1, 1])
    assert np.allclose(white[0, 0], [1, 1, 1, 0])
    assert np.array_equal(posed.render(camera), picture)


def test_landmarks_follow_the_joints(hand):
    posed = hand.pose("fist", translation=[0.2, -0.1, 0.3])
    landmarks = posed.landmarks()
    assert landmarks.shape == (21, 3) and np.abs(landmarks[0] - posed.joints()[0]).max() < 1e-6
    nearest = np.linalg.norm(landmarks[:, None] - posed.vertices()[None], axis=2).min(axis=1)
    assert nearest.max() < 0.03


def test_gaussians_have_the_convention_of_gsplat(hand):
    splats = hand.pose("point").gaussians()
    count = len(hand)
    shapes = {
        "means": (count, 3),
        "quats": (count, 4),
        "scales": (count, 3),
        "opacities": (count,),
        "colors": (count, 3),
    }
    assert {name: values.shape for name, values in splats.items()} == shapes
    assert all(values.dtype == np.float32 and np.isfinite(values).all() for values in splats.values())
    assert np.allclose(np.linalg.norm(splats["quats"], axis=1), 1, atol=1e-5)
    assert splats["scales"].min() > 0 and splats["scales"].max() < 0.01
    vertices = hand.pose("point").vertices()
    assert np.abs(splats["means"].min(axis=0) - vertices.min(axis=0)).max() < 0.005


def test_a_batch_is_its_pictures(hand):
    poses = ghand.read_poses("grasp", hand)[:6:2]
    cameras = hand.pose().turntable(3, (40, 50))
    batch = hand.render_batch(poses, cameras)
    assert batch.shape == (3, 50, 40, 4)
    for picture, pose, camera in zip(batch, poses, cameras):
        assert np.array_equal(picture, hand.pose(pose).render(camera))
    assert np.array_equal(hand.render_batch("rest", cameras)[1], hand.pose().render(cameras[1]))
    assert hand.render_batch(poses, cameras[0]).shape[0] == 3
    assert hand.render_batch(hand.pose("fist"), cameras[0]).shape[0] == 1
    assert hand.render_batch(ghand.read_poses("grasp", hand).rotations[:2], cameras[0]).shape[0] == 2


def test_light_can_be_chosen(hand):
    camera = hand.pose().camera(size=(64, 64))
    with ghand.load(AVATAR, light="studio", light_turn=90) as lit:
        assert np.abs(lit.pose().render(camera) - hand.pose().render(camera)).max() > 0.05


def test_a_camera_is_its_calibration():
    turn = matrices(np.array([[np.cos(0.3), np.sin(0.3), 0, 0]]))[0]
    k = [[500, 0, 60.5], [0, 510, 40], [0, 0, 1]]
    camera = ghand.Camera(120, 80, k, turn, [0.1, 0.2, 0.5])
    assert np.allclose(camera.intrinsics, k) and (camera.width, camera.height) == (120, 80)
    assert np.allclose(camera.world_to_camera[:3, :3], turn) and np.allclose(
        camera.world_to_camera[:3, 3], [0.1, 0.2, 0.5]
    )
    assert np.allclose(turn @ camera.center + [0.1, 0.2, 0.5], 0)
    pixels, depths = camera.project([[0, 0, 0]])
    assert np.allclose(pixels, [[500 * 0.1 / 0.5 + 60.5, 510 * 0.2 / 0.5 + 40]]) and np.allclose(depths, 0.5)
    ahead = ghand.Camera.look_at([0, 0, -1], [0, 0, 0], 10, 20)
    assert np.allclose(ahead.project([[0, 0, 0]])[0], [[5, 10]])


def test_threads_share_an_avatar(hand):
    camera = hand.pose().camera(size=(64, 64))
    expected = {name: hand.pose(name).render(camera) for name in ghand.POSES[:4]}
    wrong = []

    def draw(name):
        for _ in range(5):
            if not np.array_equal(hand.pose(name).render(camera), expected[name]):
                wrong.append(name)

    threads = [threading.Thread(target=draw, args=(name,)) for name in expected]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    assert not wrong


def test_other_threads_run_while_a_picture_is_drawn(hand):
    steps, drawn = [], threading.Event()

    def count():
        while not drawn.is_set():
            steps.append(time.monotonic())
            time.sleep(0.001)

    camera = hand.pose().camera(size=(3000, 3000))
    thread = threading.Thread(target=count)
    thread.start()
    begun = time.monotonic()
    hand.pose().render(camera)
    seconds = time.monotonic() - begun
    drawn.set()
    thread.join()
    assert np.diff(steps).max() < max(0.5 * seconds, 0.1)


def test_poses_and_cameras_can_be_sent_to_other_processes(hand):
    pose = hand.pose("fist", translation=[0.1, 0.2, 0.3]).pose
    camera = hand.pose().camera("palm", size=(30, 40))
    for value in [pose, camera]:
        sent = pickle.loads(pickle.dumps(value))
        assert sent == value and sent is not value and copy.deepcopy(value) == value
    assert pose != hand.pose().pose and camera != camera.resized(40, 30) and pose != camera


def test_an_empty_picture_says_why(hand):
    intrinsics = [[500, 0, 32], [0, 500, 32], [0, 0, 1]]
    for translation, reason in [
        ([0, 0, -1], "behind the camera"),
        ([1, 0, 1], "outside"),
        ([0, 0, 900], "check the units"),
    ]:
        with pytest.warns(UserWarning, match=f"the picture is empty: .*{reason}"):
            hand.pose().render(ghand.Camera(64, 64, intrinsics, translation=translation))
