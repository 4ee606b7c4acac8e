"""The examples run, and say what they should."""

import json
import subprocess
import sys

import numpy as np
import pytest
from conftest import AVATAR, EXAMPLES


def run(name, *arguments):
    command = [sys.executable, EXAMPLES / name, AVATAR, *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def test_gsplat_draws_the_same_from_the_arrays():
    line = run("gsplat_arrays.py")
    assert float(line.split()[1]) > 60, line


def test_a_data_set_has_its_labels(tmp_path):
    image = pytest.importorskip("PIL.Image")
    run("labelled_data_set.py", tmp_path, "3")
    labels = json.loads((tmp_path / "labels.json").read_text())
    assert len(labels) == 3
    for label in labels:
        mask = np.asarray(image.open(tmp_path / label["mask"])) > 0
        depth = np.load(tmp_path / label["depth"])
        assert mask.any() and np.array_equal(mask, (depth > 0) & mask)
        points = np.array(label["landmarks_2d"])[label["visible"]].astype(int)
        assert len(points) > 5 and mask[points[:, 1], points[:, 0]].mean() > 0.8
        assert image.open(tmp_path / label["image"]).size == (256, 256)
