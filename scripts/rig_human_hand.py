#!/usr/bin/env python3
"""Rigs the built-in hand: joints, skinning weights, and how joints move with the shape.

    python3 -m venv venv && venv/bin/pip install numpy
    venv/bin/python scripts/rig_human_hand.py assets/human-hand rigged
    cargo run --bin ghand -- export rigged/right.glb --out assets/human-hand/right.glb --fit-pose-correctives
    cargo run --bin ghand -- export rigged/left.glb --out assets/human-hand/left.glb --fit-pose-correctives

It keeps vertices, texture coordinates, shape directions, the wrist and the joints at the fingertips, and needs nothing
else of the files: running it on its own result changes nothing. The left hand becomes the mirror image of the right.

Where the joints are. A bone reaches from one centre of rotation to the next. These are the centres of the bones'
heads, not the gaps between bones that X-rays show: 7 mm (little finger 6) from the gap at a knuckle, 3.5 at a middle
hinge, 2.5 at a last one, on the near side. LENGTHS are the means of Buryanov and Kotiuk ("Proportions of hand
segments", Int. J. Morphol. 28, 2010) between gaps, moved to the centres, and from there by at most 0.7 of their standard
deviations: hinges to where the mesh has its creases and bumps, knuckles to 20 mm behind the webs. The little finger is
short in this mesh; its outer bones have 0.9 of the mean.
"""

import argparse
import json
import os
import struct

import numpy as np

# Millimetres from each joint to the next, metacarpal to tip.
LENGTHS = {
    "thumb": [44.0, 33.0, 28.5],
    "index-finger": [59.5, 46.0, 24.0, 22.0],
    "middle-finger": [57.0, 50.5, 27.8, 23.2],
    "ring-finger": [50.5, 47.0, 27.3, 23.2],
    "pinky-finger": [47.0, 33.5, 18.0, 19.0],
}
FINGERS = list(LENGTHS)
FIRST_JOINTS = [1, 5, 10, 15, 20]
# Millimetres towards the little finger: bases of the metacarpals, side by side on the carpus, and knuckles, on the middle
# lines of their fingers.
BASES = {"index-finger": 0.5, "middle-finger": 11.0, "ring-finger": 21.5, "pinky-finger": 32.0}
KNUCKLES = {"index-finger": -13.6, "middle-finger": 5.8, "ring-finger": 22.7, "pinky-finger": 40.5}
# The direction to the base of the thumb's metacarpal, from its knuckle: a point in the trapezium.
TRAPEZIUM = np.array([29.0, 33.0, -12.0])
# Depth below the skin of the back: of a hinge as a part of the thickness, of others millimetres (half the bone, tendon
# and skin).
HINGE_DEPTH = 0.42
KNUCKLE_DEPTHS = {"thumb": 9.0, "index-finger": 10.0, "middle-finger": 10.5, "ring-finger": 10.0, "pinky-finger": 9.0}
BASE_DEPTH = 12.0
# Where the back faces; the thumb's nail.
BACK = np.array([1.0, 0.0, 0.0])
NAIL = np.array([0.75, 0.0, -0.65])
# Weights change along a bone over a length (1 - 1/e of the way): on fingers half the distance to the bone, at most 3.5
# mm, so that a joint blends over about the finger's thickness and the palm keeps its volume; on the palm 0.8 of it.
FINGER_BLEND, WIDEST_BLEND, PALM_BLEND = 0.5, 3.5, 0.8
# The palm begins between these distances from the bones of the fingers.
PALM_FROM, PALM_TO = 12.0, 32.0
# A joint follows the skin up to this multiple of the distance to the nearest.
REACH = 2.2
ITERATIONS = 60


class Glb:
    """A GLB file whose accessors can be read and overwritten in place."""

    TYPES = {5126: "<f4", 5125: "<u4", 5123: "<u2"}
    WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}

    def __init__(self, path):
        data = open(path, "rb").read()
        length = struct.unpack_from("<I", data, 12)[0]
        self.json = json.loads(data[20 : 20 + length])
        self.bin = bytearray(data[28 + length :])

    def accessor(self, index):
        accessor = self.json["accessors"][index]
        view = self.json["bufferViews"][accessor["bufferView"]]
        offset = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        shape = (accessor["count"], self.WIDTHS[accessor["type"]])
        kind = self.TYPES[accessor["componentType"]]
        return np.frombuffer(self.bin, kind, shape[0] * shape[1], offset).reshape(shape)

    def write(self, path):
        text = json.dumps(self.json, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        body = bytes(self.bin) + b"\0" * (-len(self.bin) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(body), b"BIN\0") + body
        with open(path, "wb") as out:
            out.write(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


class Mesh:
    """The surface with vertices at seams welded; millimetres."""

    def __init__(self, positions, faces):
        keys = np.round(positions * 1e4).astype(np.int64)
        _, self.first, welded = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        self.of_file = welded.ravel()
        self.points = positions[self.first]
        self.faces = self.of_file[faces]

    def ray(self, origin, direction):
        """Distance from a point inside to the skin."""
        a, b, c = (self.points[self.faces[:, k]] for k in range(3))
        edge1, edge2 = b - a, c - a
        h = np.cross(direction, edge2)
        det = (edge1 * h).sum(1)
        det = np.where(np.abs(det) > 1e-12, det, np.inf)
        s = origin - a
        q = np.cross(s, edge1)
        u, v, t = (s * h).sum(1) / det, (q @ direction) / det, (edge2 * q).sum(1) / det
        hit = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9) & (t > 1e-9)
        return t[hit].min()

    def laplacian(self):
        """Cotangent Laplacian (positive semidefinite) and vertex areas."""
        n = len(self.points)
        matrix, areas = np.zeros((n, n)), np.zeros(n)
        for k in range(3):
            i, j, o = (self.faces[:, (k + m) % 3] for m in range(3))
            u, v = self.points[i] - self.points[o], self.points[j] - self.points[o]
            double = np.maximum(np.linalg.norm(np.cross(u, v), axis=1), 1e-9)
            # Thin triangles around nails have cotangents of any size.
            cotangent = np.clip((u * v).sum(1) / double, 0.02, 20.0) / 2
            for a, b in [(i, j), (j, i)]:
                np.add.at(matrix, (a, b), -cotangent)
                np.add.at(matrix, (a, a), cotangent)
            np.add.at(areas, o, double / 6)
        return matrix, areas


def unit(vector):
    return vector / np.linalg.norm(vector)


def below_back(mesh, point, along, back, depth):
    """The point moved across a bone to a depth below the skin of the back. A hinge's is a part of the thickness, and it
    moves to the middle between the sides, too."""
    up = unit(back - along * (back @ along))
    if depth < 1:
        side = np.cross(along, up)
        point = point + side * (mesh.ray(point, side) - mesh.ray(point, -side)) / 2
        depth *= mesh.ray(point, up) + mesh.ray(point, -up)
    return point + up * (mesh.ray(point, up) - depth)


def joint_before(mesh, after, towards, length, back, depth, across=None):
    """The joint at a distance from the next one, in the direction of a point, at a depth below the back; `across` is
    its coordinate from side to side."""
    joint = towards
    for _ in range(ITERATIONS):
        joint = after + unit(joint - after) * length
        joint = below_back(mesh, joint, unit(after - joint), back, depth)
        if across is not None:
            joint[2] = across
    return after + unit(joint - after) * length


def all_joints(mesh, old):
    """Positions of the 25 joints, millimetres; of the file's only the wrist and the tips count."""
    joints = [old[0]]
    for finger, first in zip(FINGERS, FIRST_JOINTS):
        lengths, depth = LENGTHS[finger], KNUCKLE_DEPTHS[finger]
        tip = old[first + len(lengths)]
        if finger == "thumb":
            hinge = joint_before(mesh, tip, TRAPEZIUM, lengths[2], NAIL, HINGE_DEPTH)
            knuckle = joint_before(mesh, hinge, TRAPEZIUM, lengths[1], NAIL, depth)
            joints += [knuckle + unit(TRAPEZIUM - knuckle) * lengths[0], knuckle, hinge, tip]
            continue
        palm = np.array([tip[0], -30.0, KNUCKLES[finger]])
        last = joint_before(mesh, tip, palm, lengths[3], BACK, HINGE_DEPTH)
        middle = joint_before(mesh, last, palm, lengths[2], BACK, HINGE_DEPTH)
        knuckle = joint_before(mesh, middle, palm, lengths[1], BACK, depth, KNUCKLES[finger])
        carpus = np.array([knuckle[0], old[0][1], BASES[finger]])
        base = joint_before(mesh, knuckle, carpus, lengths[0], BACK, BASE_DEPTH, BASES[finger])
        joints += [base, knuckle, middle, last, tip]
    return np.array(joints)


def smooth_step(x):
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3 - 2 * x)


def bones(joints):
    """Segments with the joint that moves them. The wrist moves the forearm and the carpus."""
    wrist = joints[0]
    found = [(0, wrist + np.array([0.0, 45.0, 0.0]), wrist)]
    for finger, first in zip(FINGERS, FIRST_JOINTS):
        found.append((0, wrist, joints[first]))
        found += [(k, joints[k], joints[k + 1]) for k in range(first, first + len(LENGTHS[finger]))]
    return found


def heat_weights(mesh, joints):
    """Skinning weights, `[vertices, 25]`, as heat that flows over the skin from the nearest bone (Baran and Popovic,
    "Automatic rigging and animation of 3D characters", 2007). Skin far from its bone blends more widely, and nothing
    flows across the gap between two fingers."""
    distances = []
    for _, start, end in bones(joints):
        along = end - start
        t = np.clip((mesh.points - start) @ along / (along @ along), 0, 1)
        distances.append(np.linalg.norm(mesh.points - start - t[:, None] * along, axis=1))
    distances = np.array(distances)
    owners = np.array([joint for joint, _, _ in bones(joints)])[distances.argmin(0)]
    nearest = distances.min(0)
    to_fingers = distances[[joint not in [0, *FIRST_JOINTS] for joint, _, _ in bones(joints)]].min(0)
    on_palm = smooth_step((to_fingers - PALM_FROM) / (PALM_TO - PALM_FROM))
    on_finger = np.minimum(FINGER_BLEND * nearest, WIDEST_BLEND)
    length = on_finger + on_palm * (PALM_BLEND * nearest - on_finger)
    laplacian, areas = mesh.laplacian()
    heat = areas / length**2
    source = np.zeros((len(mesh.points), len(joints)))
    source[np.arange(len(owners)), owners] = heat
    return np.linalg.solve(laplacian + np.diag(heat), source)


def four_largest(weights):
    """Indices and values of at most four weights, `[vertices, 4]`, largest first; sums are 1."""
    order = np.argsort(-weights, axis=1, kind="stable")[:, :5]
    values = np.take_along_axis(weights, order, axis=1)
    # The fifth is taken off all, so that weights fade to 0 before they are dropped.
    values = np.maximum(values[:, :4] - values[:, 4:], 0.0)
    values[values < 0.002] = 0.0
    values /= values.sum(1, keepdims=True)
    return np.where(values > 0, order[:, :4], 0), values


def followers(mesh, joint):
    """Vertices and weights whose weighted mean is the joint: the smallest weights of the skin around it, `[n]` each."""
    offset = mesh.points - joint
    distance = np.linalg.norm(offset, axis=1)
    reach = REACH * distance.min()
    near = np.flatnonzero(distance < reach)
    ready = (1 - (distance[near] / reach) ** 2) ** 2
    conditions = np.column_stack([np.ones(len(near)), offset[near] / reach])
    gram = conditions.T @ (ready[:, None] * conditions)
    return near, ready * (conditions @ np.linalg.solve(gram, [1.0, 0.0, 0.0, 0.0]))


def joint_shifts(mesh, joints, displacements, old):
    """How joints move with one shape, `[25, 3]`, in the unit of `displacements` `[vertices, 3]`. The wrist stays, and the
    tips keep the file's `old`."""
    shifts = np.array(old, dtype=float)
    for finger, first in zip(FINGERS, FIRST_JOINTS):
        for joint in range(first, first + len(LENGTHS[finger])):
            near, weights = followers(mesh, joints[joint])
            shifts[joint] = weights @ displacements[near]
    return shifts


def rig(source, target, joints, weights, mesh, shifts, mirror):
    """Writes the file `source` with another rig; `mirror` is what x is multiplied by."""
    glb = Glb(source)
    flip = np.array([mirror, 1.0, 1.0])
    skin, primitive = glb.json["skins"][0], glb.json["meshes"][0]["primitives"][0]
    nodes = glb.json["nodes"]
    parent = {child: k for k, node in enumerate(nodes) for child in node.get("children", [])}
    place = {node: joints[k] * flip / 1000 for k, node in enumerate(skin["joints"])}
    inverse = glb.accessor(skin["inverseBindMatrices"])
    for k, node in enumerate(skin["joints"]):
        nodes[node]["translation"] = (place[node] - place.get(parent.get(node), np.zeros(3))).tolist()
        inverse[k] = np.eye(4).ravel()
        inverse[k, 12:15] = -place[node]
    indices, values = weights
    glb.accessor(primitive["attributes"]["JOINTS_0"])[:] = indices[mesh.of_file]
    glb.accessor(primitive["attributes"]["WEIGHTS_0"])[:] = values[mesh.of_file]
    skin["extras"].pop("pose_correctives", None)
    for shape, shift in zip(skin["extras"]["shape"], shifts):
        shape["joint_shift"] = np.round(shift * flip, 7).tolist()
    glb.write(target)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("assets", help="folder of right.glb and left.glb")
    parser.add_argument("out", help="folder for the same, without pose correctives")
    args = parser.parse_args()
    os.makedirs(args.out, exist_ok=True)

    right = Glb(os.path.join(args.assets, "right.glb"))
    primitive, skin = right.json["meshes"][0]["primitives"][0], right.json["skins"][0]
    attributes = primitive["attributes"]
    mesh = Mesh(right.accessor(attributes["POSITION"]) * 1000.0, right.accessor(primitive["indices"]).reshape(-1, 3))
    old = -right.accessor(skin["inverseBindMatrices"])[:, 12:15] * 1000.0
    joints = all_joints(mesh, old)
    weights = four_largest(heat_weights(mesh, joints))
    shapes = zip(skin["extras"]["shape"], primitive["targets"])
    shifts = [
        joint_shifts(mesh, joints, right.accessor(target["POSITION"])[mesh.first].astype(float), shape["joint_shift"])
        for shape, target in shapes
    ]
    for side, mirror in [("right", 1.0), ("left", -1.0)]:
        file = side + ".glb"
        rig(os.path.join(args.assets, file), os.path.join(args.out, file), joints, weights, mesh, shifts, mirror)


if __name__ == "__main__":
    main()
