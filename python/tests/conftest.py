"""The avatar and the capture that the tests share."""

from pathlib import Path

import ghand
import pytest

ROOT = Path(__file__).resolve().parents[2]
AVATAR = ROOT / "assets" / "demo-avatar" / "right.ghand"
EXAMPLES = ROOT / "python" / "examples"
SETTINGS = {"iterations": 40, "uv_resolution": 48, "align": "off", "light": "off", "exposure": "off"}


@pytest.fixture
def hand():
    with ghand.load(AVATAR) as hand:
        yield hand


@pytest.fixture(scope="session")
def trained(tmp_path_factory):
    """A short training on a synthetic capture that it makes: (result, all progress, its capture)."""
    folder = tmp_path_factory.mktemp("run") / "train"
    seen = []
    result = ghand.train(out=folder, settings=SETTINGS, on_progress=seen.append, preset="quick")
    return result, seen, folder / "capture"
