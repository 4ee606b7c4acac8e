"""The typed stubs describe the module as it is."""

import subprocess
import sys

import pytest


def test_stubs_and_module_agree():
    pytest.importorskip("mypy")
    done = subprocess.run([sys.executable, "-m", "mypy.stubtest", "ghand"], check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
