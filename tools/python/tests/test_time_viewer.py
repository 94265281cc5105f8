"""tools/time-viewer: what it prints, and what it refuses. Times decide nothing."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

TOOL = Path(__file__).resolve().parents[2] / "time-viewer"


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(TOOL), *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=300)


def test_a_row_for_all_that_one_waits_for() -> None:
    volume = "generate:mixing_layer_24x20x22_uint8"
    of_host = ("--device", "host", "--drags", "2", "--size", "48x32")
    ended = run(volume, "-i", "128", *of_host)
    assert ended.returncode == 0, ended.stderr
    rows = [line.rsplit(maxsplit=2) for line in ended.stdout.splitlines()]
    assert [line[:28].strip() for line in ended.stdout.splitlines()] == [
        "ms",
        "start: first picture",
        "start: whole picture",
        "drag: picture",
        "rest: whole picture",
        "rest: lossless picture",
    ]
    for _, p50, p95 in rows[3:]:
        assert 0 < float(p50) <= float(p95)


def test_what_the_viewer_refuses_is_one_line() -> None:
    ended = run("nothing_8x8x8_uint8.raw", "-i", "1", "--drags", "1")
    assert ended.returncode == 1
    assert ended.stdout == ""
    assert len(ended.stderr.splitlines()) == 1 and "nothing_8x8x8" in ended.stderr
