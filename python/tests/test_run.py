"""Training, evaluation, and how they are stopped."""

import json
import logging
import os
import signal
import subprocess
import sys
import time

import ghand
import pytest
from conftest import SETTINGS


def test_a_training_makes_an_avatar_and_tells_its_progress(trained):
    result, seen, _ = trained
    assert result.avatar.is_file() and (result.folder / "report.html").is_file()
    assert result.metrics == json.loads((result.folder / "metrics.json").read_text())
    assert result.metrics["iterations"] == 40 and seen[-1].iteration == seen[-1].iterations == 40
    numbers = [progress.iteration for progress in seen]
    assert numbers == sorted(numbers) and len(numbers) > 3
    with ghand.load(result.avatar) as hand:
        assert hand.pose("fist").render(hand.pose().camera(size=(32, 32)))[..., 3].max() > 0.9


def test_an_evaluation_returns_its_figures(trained, tmp_path):
    result, _, capture = trained
    figures = ghand.evaluate(result.avatar, capture, out=tmp_path / "figures", protocol="given")
    assert figures == json.loads((tmp_path / "figures" / "metrics.json").read_text())
    assert abs(figures["psnr"] - result.metrics["psnr"]) < 0.01
    assert ghand.evaluate(str(result.avatar), str(capture))["split"] == "test"


def test_lines_and_warnings_go_to_logging(trained, caplog, capfd):
    result, _, capture = trained
    with caplog.at_level(logging.INFO, logger="ghand"):
        ghand.evaluate(result.avatar, capture)
    assert any("adapter: " in record.message for record in caplog.records)
    assert capfd.readouterr() == ("", "")


def test_wrong_options_are_refused(trained, tmp_path):
    result, _, capture = trained
    cases = [
        (dict(settings={"iteratons": 3}), ghand.Error, "iteratons"),
        (dict(settings={"iterations": "many"}), ghand.Error, "iterations"),
        (dict(preset="best"), ghand.Error, "preset"),
        (dict(speed=3), ValueError, "--speed"),
        (dict(viewer=True), ghand.Error, "--viewer"),
        (dict(print_config=True), ghand.Error, "--print-config"),
        (dict(on_progress=3), TypeError, "on_progress: must be callable, not 3"),
        (dict(resume=True, force=True), ValueError, "cannot be used with"),
    ]
    for options, kind, sentence in cases:
        with pytest.raises(kind, match=sentence):
            ghand.train(capture, tmp_path / "none", **options)
    with pytest.raises(ghand.Error, match="missing"):
        ghand.train(tmp_path / "missing", tmp_path / "none")
    with pytest.raises(ghand.Error, match="missing"):
        ghand.evaluate(tmp_path / "missing.ghand", capture)
    # An earlier run is not replaced without a word.
    with pytest.raises(ghand.Error, match="force"):
        ghand.train(capture, result.folder, settings=SETTINGS)
    assert not (tmp_path / "none" / "avatar.ghand").exists()


def test_an_exception_in_the_callback_stops_the_training(trained, tmp_path):
    _, _, capture = trained

    def enough(progress):
        if progress.iteration > 5:
            raise ZeroDivisionError("enough")

    begun = time.monotonic()
    with pytest.raises(ZeroDivisionError, match="enough"):
        ghand.train(capture, tmp_path / "run", settings=SETTINGS | {"iterations": 100_000}, on_progress=enough)
    assert time.monotonic() - begun < 120
    # As after Ctrl-C, the avatar is there, and the run can be gone on with.
    assert (tmp_path / "run" / "avatar.ghand").is_file()


@pytest.mark.skipif(os.name == "nt", reason="signals")
def test_ctrl_c_stops_a_training_and_nothing_else(trained, tmp_path):
    _, _, capture = trained
    code = f"""
import ghand, signal, time
# A shell's job in the background inherits that Ctrl-C is ignored.
signal.signal(signal.SIGINT, signal.default_int_handler)
try:
    ghand.train({str(capture)!r}, {str(tmp_path / "run")!r}, settings={SETTINGS | {"iterations": 100_000}!r},
                on_progress=lambda progress: print(progress.iteration, flush=True))
except KeyboardInterrupt as stopped:
    print("stopped:", stopped, flush=True)
# The interpreter's own handling of Ctrl-C works as before.
try:
    print("waiting", flush=True)
    time.sleep(60)
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""
    program = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert int(program.stdout.readline()) > 0
    program.send_signal(signal.SIGINT)
    lines = [line for line in iter(program.stdout.readline, "waiting\n") if not line.strip().isdigit()]
    assert len(lines) == 1 and lines[0].startswith("stopped: ") and "avatar" in lines[0]
    assert (tmp_path / "run" / "avatar.ghand").is_file()
    program.send_signal(signal.SIGINT)
    assert program.communicate(timeout=60)[0] == "interrupted\n" and program.returncode == 0


def test_a_training_is_gone_on_with(trained, tmp_path):
    _, _, capture = trained
    settings = SETTINGS | {"iterations": 60}

    def soon(progress):
        if progress.iteration > 10:
            raise StopIteration

    with pytest.raises(StopIteration):
        ghand.train(capture, tmp_path / "run", settings=settings, on_progress=soon)
    numbers = []
    result = ghand.train(
        out=tmp_path / "run", resume=True, on_progress=lambda progress: numbers.append(progress.iteration)
    )
    assert numbers[0] > 10 and result.metrics["iterations"] == 60
