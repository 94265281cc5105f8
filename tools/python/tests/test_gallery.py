"""tools/gallery: pictures of the committed volumes, beside PyVista's, and what it refuses."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
from PIL import Image

TOOL = Path(__file__).resolve().parents[2] / "gallery"
DATA = Path(__file__).resolve().parents[3] / "tests" / "data"


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(TOOL), *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=300)


def test_pictures_show_what_pyvista_s_do(tmp_path: Path) -> None:
    ended = run(str(DATA), "-o", str(tmp_path), "--size", "96x72", "--only", "fuel,bonsai")
    assert ended.returncode == 0, ended.stderr
    assert "bonsai: left out, since there is no" in ended.stdout
    ours, theirs = (
        np.asarray(Image.open(tmp_path / name).convert("RGB")).astype(float)
        for name in ("fuel.png", "fuel_pyvista.png")
    )
    assert ours.shape == theirs.shape == (72, 96, 3)
    jet = np.abs(ours - ours[0, 0]).max(axis=-1) > 20
    other_jet = np.abs(theirs - theirs[0, 0]).max(axis=-1) > 20
    assert 0.05 < jet.mean() < 0.6 and (jet != other_jet).mean() < 0.02


def test_bad_arguments_are_one_line(tmp_path: Path) -> None:
    for arguments, text in (
        ([str(tmp_path / "absent")], "there is no folder"),
        ([str(DATA), "--only", "moon"], "--only moon: there are skin_and_bone"),
        ([str(DATA), "--size", "big"], "--size big: give WIDTHxHEIGHT"),
    ):
        ended = run(*arguments)
        assert ended.returncode != 0 and text in ended.stderr
