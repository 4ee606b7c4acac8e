#!/usr/bin/env python3
"""Puts the poses of a file of `ghand pose` into the frames of a capture, by their ids.

    python3 examples/poses_to_capture.py poses.json capture.json

Frames without a pose are removed from the capture and from its splits.
"""

import json
import sys

poses_path, capture_path = sys.argv[1:]
with open(poses_path) as file:
    poses = {frame["id"]: frame for frame in json.load(file)["frames"]}
with open(capture_path) as file:
    capture = json.load(file)
capture["frames"] = [frame | poses[frame["id"]] for frame in capture["frames"] if frame["id"] in poses]
for split in capture["splits"].values():
    split["frames"] = [frame for frame in split["frames"] if frame in poses]
with open(capture_path, "w") as file:
    json.dump(capture, file)
