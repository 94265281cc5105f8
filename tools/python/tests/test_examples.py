"""The examples run, and make what they say."""

import pathlib
import subprocess
import sys

import pytest
from conftest import FUEL, TOP

EXAMPLES = TOP / "tools/python/examples"


def run(name, *arguments, cwd):
    done = subprocess.run(
        [sys.executable, EXAMPLES / name, *map(str, arguments)],
        cwd=cwd,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def is_png(path: pathlib.Path):
    return path.read_bytes().startswith(b"\x89PNG\r\n")


def test_numpy_to_picture(tmp_path):
    out = run("numpy_to_picture.py", "a.png", cwd=tmp_path)
    assert is_png(tmp_path / "a.png")
    assert "96 x 128 x 160" in out


def test_zarr_larger_than_memory(tmp_path):
    pytest.importorskip("zarr")
    out = run("zarr_larger_than_memory.py", tmp_path, 96, cwd=tmp_path)
    assert is_png(tmp_path / "waves.png") and (tmp_path / "waves.zfp").exists()
    assert "96 x 96 x 96" in out


def test_two_isovalues(tmp_path):
    pytest.importorskip("PIL")
    out = run("two_isovalues.py", FUEL, 10, 60, "a.png", cwd=tmp_path)
    assert is_png(tmp_path / "a.png")
    assert out.count("are certainly within a pixel") == 2 and "apart in the median" in out


def test_time_steps(tmp_path):
    run("time_steps.py", tmp_path, 3, cwd=tmp_path)
    pictures = sorted(tmp_path.glob("*.png"))
    assert len(pictures) == 3 and len({picture.read_bytes() for picture in pictures}) == 3


def test_notebook(tmp_path):
    """Every cell runs in a kernel; the picture and the widget are among the outputs."""
    nbformat = pytest.importorskip("nbformat")
    client = pytest.importorskip("nbclient").NotebookClient
    pytest.importorskip("anywidget")
    notebook = nbformat.read(EXAMPLES / "notebook.ipynb", as_version=4)
    client(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    shown = [set(output["data"]) for cell in notebook.cells for output in cell.get("outputs", [])]
    assert any("image/png" in kinds for kinds in shown)
    assert any("text/html" in kinds for kinds in shown)
    assert any("application/vnd.jupyter.widget-view+json" in kinds for kinds in shown)
