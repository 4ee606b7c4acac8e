"""Makes the calibrations in this folder: the same rig, written by several tools or in their layout, and `truth.json`
with pixels that the tools' own formulas project points to.

    pip install numpy opencv-contrib-python-headless pycolmap aniposelib caliscope toml pyyaml bpy
    python make.py
"""

import json
import os
from pathlib import Path

import cv2
import numpy as np
import toml
import yaml

ROOT = Path(__file__).parent
POINTS = np.array([[0, 0, 0], [0.08, 0.02, -0.05], [-0.07, 0.06, 0.04], [0.03, -0.09, 0.06], [-0.05, -0.04, -0.08]])
# Where OpenCV, ROS, Kalibr, anipose and Meshroom have the centre of the first pixel, ghand has 0.5.
SHIFT = 0.5
truth = {}


def look_at(eye, roll, target=(0.02, -0.03, 0.01)):
    """Rows of camera_from_world with OpenCV's axes, and the translation."""
    z = np.array(target) - eye
    z /= np.linalg.norm(z)
    x = np.cross(z, [0, 0, 1])
    x /= np.linalg.norm(x)
    rotation = np.array([x, np.cross(z, x), z])
    turned = cv2.Rodrigues(np.array([0, 0, roll]))[0] @ rotation
    return turned, -turned @ np.array(eye, float)


class Camera:
    def __init__(self, name, size, focal, principal, dist, eye, roll):
        self.name, self.size, self.dist = name, size, np.array(dist)
        self.K = np.array([[focal[0], 0, principal[0]], [0, focal[1], principal[1]], [0, 0, 1.0]])
        self.R, self.t = look_at(eye, roll)

    @property
    def rvec(self):
        return cv2.Rodrigues(self.R)[0].ravel()


CAMERAS = [
    Camera("cam0", (1280, 720), (905.5, 903.25), (633.75, 355.5), [-0.21, 0.08, 0.0011, -0.0007, -0.012], (0.5, -0.1, 0.2), 0.1),
    Camera("cam1", (1920, 1080), (1410.0, 1412.5), (955.25, 548.5), [0.05, -0.11, -0.0009, 0.0013, 0.02], (0.1, 0.6, 0.3), -0.2),
    Camera("cam2", (640, 480), (520.25, 519.0), (317.0, 243.25), [-0.3, 0.1, 0, 0, 0], (-0.4, -0.35, 0.45), 0.0),
]
FISHEYE = np.array([0.021, -0.008, 0.004, -0.0013])


def opencv_pixels(camera, points, dist=None, fisheye=False, R=None, t=None, K=None):
    R, t = camera.R if R is None else R, camera.t if t is None else t
    K, dist = camera.K if K is None else K, camera.dist if dist is None else dist
    rvec, points = cv2.Rodrigues(R)[0], np.asarray(points, float).reshape(-1, 1, 3)
    project = cv2.fisheye.projectPoints if fisheye else cv2.projectPoints
    args = (points, rvec, t, K, dist)
    return project(*args)[0].reshape(-1, 2)


def record(path, points, pixels):
    truth[path] = {"points": np.asarray(points).tolist(), "pixels": {k: np.asarray(v).tolist() for k, v in pixels.items()}}


def folder(name):
    path = ROOT / name
    path.mkdir(exist_ok=True, parents=True)
    return path


def storage(path, entries):
    writer = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, value in entries.items():
        writer.write(name, value)
    writer.release()


# OpenCV's FileStorage, one file per camera, in units of a board of 43 mm squares.
SQUARE = 0.043
for ending in ["yml", "xml", "json"]:
    place = folder(f"opencv_{ending}")
    for camera in CAMERAS:
        storage(place / f"{camera.name}.{ending}", {
            "calibration_time": "Fri Nov 27 02:40:32 2026",
            "image_width": camera.size[0],
            "image_height": camera.size[1],
            "square_size": 1.0,
            "camera_matrix": camera.K,
            "distortion_coefficients": camera.dist.reshape(1, -1),
            "R": camera.R if camera.name != "cam2" else camera.rvec.reshape(3, 1),
            "T": camera.t.reshape(3, 1) / SQUARE,
            "avg_reprojection_error": 0.31,
        })
    pixels = {c.name: opencv_pixels(c, POINTS) + SHIFT for c in CAMERAS}
    record(f"opencv_{ending}", POINTS / SQUARE, pixels)

# stereo_calib.cpp's pair: R and T lead from the first camera to the second.
first, second = CAMERAS[:2]
relative = second.R @ first.R.T
between = second.t - relative @ first.t
R1, R2, P1, P2, Q = cv2.stereoRectify(first.K, first.dist, second.K, second.dist, first.size, relative, between.reshape(3, 1))[:5]
place = folder("opencv_stereo")
storage(place / "intrinsics.yml", {"M1": first.K, "D1": first.dist.reshape(1, -1), "M2": second.K, "D2": second.dist.reshape(1, -1)})
storage(place / "extrinsics.yml", {"R": relative, "T": between.reshape(3, 1), "R1": R1, "R2": R2, "P1": P1, "P2": P2, "Q": Q})
in_first = POINTS @ first.R.T + first.t
record("opencv_stereo", in_first, {
    "camera1": opencv_pixels(first, in_first, R=np.eye(3), t=np.zeros(3)) + SHIFT,
    "camera2": opencv_pixels(second, in_first, R=relative, t=between) + SHIFT,
})

# ROS: camera_calibration's cameracalibrator.py, one file per camera, without extrinsics.
ROS = """image_width: {w}
image_height: {h}
camera_name: {name}
camera_matrix:
  rows: 3
  cols: 3
  data: {K}
distortion_model: {model}
distortion_coefficients:
  rows: 1
  cols: {n}
  data: {D}
rectification_matrix:
  rows: 3
  cols: 3
  data: [1., 0., 0., 0., 1., 0., 0., 0., 1.]
projection_matrix:
  rows: 3
  cols: 4
  data: {P}
"""
place = folder("ros")
pixels = {}
for camera, model, dist in [(CAMERAS[0], "plumb_bob", CAMERAS[0].dist), (CAMERAS[1], "equidistant", FISHEYE)]:
    P = np.hstack([camera.K, np.zeros((3, 1))])
    text = ROS.format(w=camera.size[0], h=camera.size[1], name=camera.name, K=camera.K.ravel().tolist(), model=model,
                      n=len(dist), D=dist.tolist(), P=P.ravel().tolist())
    (place / f"{camera.name}_info.yaml").write_text(text)
    in_camera = POINTS + [0, 0, 0.5]
    pixels[camera.name] = opencv_pixels(camera, in_camera, dist, model == "equidistant", np.eye(3), np.zeros(3)) + SHIFT
record("ros", POINTS + [0, 0, 0.5], pixels)

# handpose3d, in board squares: rot_trans_c1.dat repeats its sections, as in the project.
place = folder("dat_files")


def rows(matrix):
    return "".join("".join(f"{value} " for value in row) + "\n" for row in np.atleast_2d(matrix))


for k, camera in enumerate(CAMERAS[:2]):
    (place / f"c{k}.dat").write_text("intrinsic:\n" + rows(camera.K) + "distortion:\n" + rows(camera.dist))
    text = "R:\n" + rows(camera.R) + "T:\n" + rows(camera.t.reshape(3, 1) / SQUARE)
    if k == 1:
        text += "\n#below is rotation and translation to go from cam0 to cam1.\nR:\n" + rows(relative) + "T:\n" + rows(between.reshape(3, 1))
    (place / f"rot_trans_c{k}.dat").write_text(text)
record("dat_files", POINTS / SQUARE, {f"c{k}": opencv_pixels(c, POINTS) + SHIFT for k, c in enumerate(CAMERAS[:2])})

# python_stereo_camera_calibrate, the calibration program of the same author.
place = folder("dat_files_stereo")
for k, camera in enumerate(CAMERAS[:2]):
    (place / f"camera{k}_intrinsics.dat").write_text("intrinsic:\n" + rows(camera.K) + "distortion:\n" + rows(camera.dist))
    (place / f"camera{k}_rot_trans.dat").write_text("R:\n" + rows(camera.R) + "T:\n" + rows(camera.t.reshape(3, 1) / SQUARE))
record("dat_files_stereo", POINTS / SQUARE, {f"camera{k}": opencv_pixels(c, POINTS) + SHIFT for k, c in enumerate(CAMERAS[:2])})

# anipose, in millimetres of the board.
from aniposelib.cameras import Camera as AniposeCamera, CameraGroup, FisheyeCamera

kinds = [AniposeCamera, AniposeCamera, FisheyeCamera]
group = CameraGroup([
    kind(matrix=c.K, dist=FISHEYE if kind is FisheyeCamera else c.dist, size=c.size, rvec=c.rvec, tvec=1000 * c.t, name=c.name)
    for kind, c in zip(kinds, CAMERAS)
])
group.metadata = {"adjusted": False, "error": 0.42}
folder("anipose")
group.dump(str(ROOT / "anipose/calibration.toml"))
record("anipose/calibration.toml", 1000 * POINTS, {c.name: c.project(1000 * POINTS).reshape(-1, 2) + SHIFT for c in group.cameras})

# FreeMoCap 1.8.2: anipose's layout with two fields more and its own metadata.
dicts = {}
for k, c in enumerate(group.cameras[:2]):
    center = -cv2.Rodrigues(c.rvec)[0].T @ c.tvec
    dicts[f"cam_{k}"] = {**c.get_dict(), "name": f"Camera_00{k}_synchronized", "world_orientation": cv2.Rodrigues(c.rvec)[0].T.tolist(), "world_position": center.tolist()}
dicts["metadata"] = {"charuco_square_size": 43.0, "charuco_board_object": "<CharucoBoardDefinition>", "path_to_recorded_videos": "synchronized_videos", "date_time_calibrated": "2026-11-27T02:40:32", "groundplane_calibration": False}
folder("freemocap")
(ROOT / "freemocap/recording_camera_calibration.toml").write_text(toml.dumps(dicts))
record("freemocap", 1000 * POINTS, {f"Camera_00{k}_synchronized": c.project(1000 * POINTS).reshape(-1, 2) + SHIFT for k, c in enumerate(group.cameras[:2])})

# Caliscope, metres: today's camera_array.toml, and the config.toml of before.
from caliscope.cameras.camera_array import CameraArray, CameraData

array = CameraArray({
    k: CameraData(cam_id=k, size=c.size, matrix=c.K, distortions=FISHEYE if k == 2 else c.dist, rotation=c.R, translation=c.t, fisheye=k == 2, error=0.3, grid_count=20)
    for k, c in enumerate(CAMERAS)
})
folder("caliscope")
array.to_toml(ROOT / "caliscope/camera_array.toml")
pixels = {f"cam_{k}": opencv_pixels(c, POINTS, FISHEYE if k == 2 else None, k == 2) + SHIFT for k, c in enumerate(CAMERAS)}
record("caliscope/camera_array.toml", POINTS, pixels)
folder("caliscope_config")
config = {"CreationDate": "2023-11-27", "save_tracked_points_video": True, "charuco": {"columns": 4, "rows": 5, "board_height": 11.0, "board_width": 8.5, "dictionary": "DICT_4X4_50", "units": "inch", "aruco_scale": 0.75, "square_size_override_cm": 5.4, "inverted": True}}
for k, c in enumerate(CAMERAS[:2]):
    config[f"cam_{k}"] = {"port": k, "size": list(c.size), "rotation_count": 0, "error": 0.3, "matrix": c.K.tolist(), "distortions": c.dist.tolist(), "translation": c.t.tolist(), "rotation": c.rvec.tolist() if k == 0 else c.R.tolist(), "exposure": -5, "grid_count": 20, "ignore": False}
(ROOT / "caliscope_config/config.toml").write_text(toml.dumps(config))
record("caliscope_config", POINTS, {k: pixels[k] for k in ["cam_0", "cam_1"]})

# Kalibr's camchain: yaml.dump as in ConfigReader.py.
chain = {}
cameras = [CAMERAS[0], CAMERAS[1], CAMERAS[2]]
for k, c in enumerate(cameras):
    equidistant = k == 2
    entry = {"camera_model": "pinhole", "intrinsics": [float(v) for v in (c.K[0, 0], c.K[1, 1], c.K[0, 2], c.K[1, 2])],
             "distortion_model": "equidistant" if equidistant else "radtan",
             "distortion_coeffs": [float(v) for v in (FISHEYE if equidistant else c.dist[:4])],
             "resolution": list(c.size), "rostopic": f"/cam{k}/image_raw", "cam_overlaps": [j for j in range(3) if j != k]}
    if k:
        before = cameras[k - 1]
        T = np.eye(4)
        T[:3, :3] = c.R @ before.R.T
        T[:3, 3] = c.t - T[:3, :3] @ before.t
        entry["T_cn_cnm1"] = T.tolist()
    chain[f"cam{k}"] = entry
folder("kalibr")
(ROOT / "kalibr/camchain.yaml").write_text(yaml.dump(chain, default_flow_style=None))
pixels = {}
for k, c in enumerate(cameras):
    R = c.R @ first.R.T
    pixels[f"cam{k}"] = opencv_pixels(c, in_first, FISHEYE if k == 2 else c.dist[:4], k == 2, R, c.t - R @ first.t) + SHIFT
record("kalibr/camchain.yaml", in_first, pixels)

# EasyMocap: camera_utils.write_camera.
place = folder("easymocap")


def easymocap(path, entries):
    lines = ["%YAML:1.0", "---"]
    for name, value in entries:
        if isinstance(value, list):
            lines += [f"{name}:"] + [f'  - "{item}"' for item in value]
        elif isinstance(value, int):
            lines.append(f"{name}: {value}")
        else:
            data = ", ".join(f"{v:.6f}" for v in value.ravel())
            lines += [f"{name}: !!opencv-matrix", f"  rows: {value.shape[0]}", f"  cols: {value.shape[1]}", "  dt: d", f"  data: [{data}]"]
    path.write_bytes("".join(line + "\r\n" for line in lines).encode())


names = ["01", "02"]
intri, extri, pixels = [("names", names)], [("names", names)], {}
for name, c in zip(names, CAMERAS):
    intri += [(f"K_{name}", c.K), (f"dist_{name}", c.dist.reshape(1, -1))]
    intri += [(f"H_{name}", c.size[1]), (f"W_{name}", c.size[0])] if name == "01" else []
    extri += [(f"R_{name}", c.rvec.reshape(3, 1)), (f"Rot_{name}", c.R), (f"T_{name}", c.t.reshape(3, 1))]
    # Six digits are written.
    rvec, t, dist = np.round(c.rvec, 6), np.round(c.t, 6), np.round(c.dist, 6)
    pixels[name] = opencv_pixels(c, POINTS, dist, R=cv2.Rodrigues(rvec)[0], t=t) + SHIFT
easymocap(place / "intri.yml", intri)
easymocap(place / "extri.yml", extri)
record("easymocap", POINTS, pixels)


# Meshroom: AliceVision's jsonIO.cpp, whose property tree writes all values as text; scale unknown.
def texts(value):
    if isinstance(value, dict):
        return {k: texts(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [texts(v) for v in value] if len(value) else ""
    return {True: "true", False: "false"}[value] if isinstance(value, bool) else f"{value:.17g}" if isinstance(value, float) else str(value)


for version in [(1, 0, 0), (1, 2, 8), (1, 2, 14)]:
    name = "meshroom_" + "".join(map(str, version))
    views, intrinsics, poses, pixels = [], [], [], {}
    for k, c in enumerate(CAMERAS):
        # Version 1.0.0 has one focal length.
        K = c.K.copy()
        if version < (1, 2, 0):
            K[1, 1] = K[0, 0]
        w, h = c.size
        if k == 0:
            kind, params, dist = "brown", [c.dist[0], c.dist[1], c.dist[4], c.dist[2], c.dist[3]], c.dist
        elif k == 1:
            kind, params, dist = "fisheye4", FISHEYE.tolist(), FISHEYE
        else:
            kind, params, dist = "radial3", [-0.3, 0.1, 0.02], np.array([-0.3, 0.1, 0, 0, 0.02])
        ids = {"viewId": str(1000 + k), "poseId": str(1000 + k), "intrinsicId": str(3000000000 + k)}
        views.append({**ids, "path": f"/data/{c.name}/0001.jpg", "width": w, "height": h, "metadata": {"Make": "Canon"}})
        entry = {"intrinsicId": ids["intrinsicId"], "width": w, "height": h, "serialNumber": "1"}
        if version < (1, 2, 0):
            entry |= {"type": kind, "initializationMode": "unknown", "pxInitialFocalLength": -1.0, "pxFocalLength": float(K[0, 0]), "principalPoint": [float(K[0, 2]), float(K[1, 2])], "distortionParams": params, "locked": 0}
        else:
            fx, fy = K[0, 0], K[1, 1]
            # Since 1.2.11 the focal length is that of y.
            mm = 36.0 / w * (fx if version < (1, 2, 9) else fy)
            distortion = {"brown": "brown", "fisheye4": "fisheye4", "radial3": "radialk3"}[kind]
            entry |= {"sensorWidth": 36.0, "sensorHeight": 24.0, "type": "pinhole", "initializationMode": "unknown", "initialFocalLength": -1.0, "focalLength": float(mm), "pixelRatio": float(fy / fx), "pixelRatioLocked": True, "principalPoint": [float(K[0, 2] - w / 2), float(K[1, 2] - h / 2)], "distortionInitializationMode": "none", "distortionParams": params, "undistortionOffset": [0.0, 0.0], "undistortionParams": [], "distortionType": distortion, "undistortionType": "none", "locked": False}
        intrinsics.append(entry)
        center = -c.R.T @ c.t
        poses.append({"poseId": ids["poseId"], "pose": {"transform": {"rotation": c.R.ravel(order="F").tolist(), "center": center.tolist()}, "locked": "0"}})
        pixels[c.name] = opencv_pixels(c, POINTS, dist, kind == "fisheye4", K=K) + SHIFT
    scene = {"version": [str(v) for v in version], "featuresFolders": ["features"], "views": views, "intrinsics": intrinsics, "poses": poses}
    folder(name)
    (ROOT / name / "cameras.sfm").write_text(json.dumps(texts(scene), indent=4) + "\n")
    record(name, POINTS, pixels)

# COLMAP 3.12 and later, by its own library: text and binary, one folder of images per camera, several images each.
import pycolmap

MODELS = {"cam0": "OPENCV", "cam1": "FULL_OPENCV", "cam2": "SIMPLE_RADIAL"}


def colmap_camera(camera, k, model):
    f, c, d = (camera.K[0, 0], camera.K[1, 1]), (camera.K[0, 2], camera.K[1, 2]), camera.dist
    params = {
        "SIMPLE_PINHOLE": [f[0], *c], "PINHOLE": [*f, *c], "SIMPLE_RADIAL": [f[0], *c, d[0]], "RADIAL": [f[0], *c, d[0], d[1]],
        "OPENCV": [*f, *c, *d[:4]], "FULL_OPENCV": [*f, *c, *d[:4], d[4], 0.01, -0.02, 0.005],
        "OPENCV_FISHEYE": [*f, *c, *FISHEYE], "SIMPLE_RADIAL_FISHEYE": [f[0], *c, 0.02], "RADIAL_FISHEYE": [f[0], *c, 0.02, -0.01],
        "FOV": [*f, *c, 0.5],
    }[model]
    return pycolmap.Camera(model=model, width=camera.size[0], height=camera.size[1], params=params, camera_id=k)


def colmap_pixels(model_camera, camera):
    inside = POINTS @ camera.R.T + camera.t
    return np.array([model_camera.img_from_cam(p) for p in inside]).reshape(-1, 2)


def reconstruction(models, images, pose_of=None):
    scene, pixels, image_id = pycolmap.Reconstruction(), {}, 1
    for k, camera in enumerate(CAMERAS, 1):
        if camera.name not in models:
            continue
        lens = colmap_camera(camera, k, models[camera.name])
        scene.add_camera_with_trivial_rig(lens)
        pixels[camera.name] = colmap_pixels(lens, camera)
        for number in range(images):
            R, t = (camera.R, camera.t) if pose_of is None else pose_of(camera, number)
            name = f"{camera.name}/{number:04}.jpg" if images > 1 else f"{camera.name}.jpg"
            image = pycolmap.Image(name=name, camera_id=k, image_id=image_id, points2D=[pycolmap.Point2D([1.5, 2.5])] if number else [])
            scene.add_image_with_trivial_frame(image, pycolmap.Rigid3d(np.hstack([R, t.reshape(3, 1)])))
            image_id += 1
    return scene, pixels


scene, pixels = reconstruction(MODELS, 3)
for name, write in [("colmap_text", scene.write_text), ("colmap_binary", scene.write_binary)]:
    write(str(folder(name)))
    record(name, POINTS, pixels)
for model in ["SIMPLE_PINHOLE", "PINHOLE", "RADIAL", "OPENCV_FISHEYE", "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE", "FOV"]:
    scene, pixels = reconstruction({"cam0": model}, 1)
    name = f"colmap_models/{model.lower()}"
    scene.write_text(str(folder(name)))
    if model != "FOV":
        record(name, POINTS, pixels)


def moving(camera, number):
    return camera.R, camera.t + np.array([0.1 * number, 0, 0])


scene, _ = reconstruction(MODELS, 3, moving)
scene.write_text(str(folder("colmap_moving")))

# A rig that moves as a whole: its cameras' places are in rigs.txt.
scene = pycolmap.Reconstruction()
rig = pycolmap.Rig(rig_id=1)
pixels = {}
for k, camera in enumerate(CAMERAS, 1):
    lens = colmap_camera(camera, k, MODELS[camera.name])
    scene.add_camera(lens)
    sensor = pycolmap.sensor_t(pycolmap.SensorType.CAMERA, k)
    if k == 1:
        rig.add_ref_sensor(sensor)
    else:
        R = camera.R @ first.R.T
        rig.add_sensor(sensor, pycolmap.Rigid3d(np.hstack([R, (camera.t - R @ first.t).reshape(3, 1)])))
    pixels[camera.name] = colmap_pixels(lens, camera)
scene.add_rig(rig)
image_id = 1
for number in range(2):
    frame = pycolmap.Frame(frame_id=number + 1, rig_id=1)
    R, t = moving(first, number)
    frame.rig_from_world = pycolmap.Rigid3d(np.hstack([R, t.reshape(3, 1)]))
    images = []
    for k, camera in enumerate(CAMERAS, 1):
        image = pycolmap.Image(name=f"{camera.name}/{number:04}.jpg", camera_id=k, image_id=image_id)
        image.frame_id = number + 1
        frame.add_data_id(image.data_id)
        images.append(image)
        image_id += 1
    scene.add_frame(frame)
    for image in images:
        scene.add_image(image)
for name, write in [("colmap_rig_text", scene.write_text), ("colmap_rig_binary", scene.write_binary)]:
    write(str(folder(name)))
    record(name, in_first, pixels)
for points in ROOT.glob("colmap*/**/points3D.*"):
    points.unlink()

# Blender 5: its glTF exporter; the picture's size is not in the file.
import bpy
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Matrix, Vector

bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
pixels = {}
for camera, lens in zip(CAMERAS[:2], [35.0, 50.0]):
    data = bpy.data.cameras.new(camera.name)
    data.lens = lens
    item = bpy.data.objects.new(camera.name, data)
    # Blender's cameras look along -z, y up.
    world = np.eye(4)
    world[:3, :3] = camera.R.T @ np.diag([1, -1, -1])
    world[:3, 3] = -camera.R.T @ camera.t
    item.matrix_world = Matrix(world.tolist())
    scene.collection.objects.link(item)
scene.render.resolution_x, scene.render.resolution_y = 1280, 720
bpy.context.view_layer.update()
for camera in CAMERAS[:2]:
    at = [world_to_camera_view(scene, bpy.data.objects[camera.name], Vector(p)) for p in POINTS]
    pixels[camera.name] = [[v.x * 1280, (1 - v.y) * 720] for v in at]
for ending, kind in [("glb", "GLB"), ("gltf", "GLTF_SEPARATE")]:
    folder(f"blender_{ending}")
    bpy.ops.export_scene.gltf(filepath=str(ROOT / f"blender_{ending}/scene.{ending}"), export_format=kind, export_cameras=True)
    # glTF's y points up, Blender's z.
    record(f"blender_{ending}", POINTS[:, [0, 2, 1]] * [1, 1, -1], pixels)

(ROOT / "truth.json").write_text(json.dumps(truth) + "\n")
