"""--color-by of the command `isowave view`, as `isowave render` has it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from browser_pages import asked, browser, fake_scene, open_page, state  # noqa: F401
from viewer_fakes import FakeVolume

import isowave
from isowave._color_map import color_map_of
from isowave.viewer import command
from isowave.viewer.color_by import parse_color_by
from isowave.viewer.server import Server


@pytest.mark.parametrize(
    "text, by, axis, limits, field",
    [
        ("x", "axis", (1, 0, 0), None, ""),
        ("z,1,5.5", "axis", (0, 0, 1), (1, 5.5), ""),
        ("0,3,4", "axis", (0, 0.6, 0.8), None, ""),
        ("0,0,2,9,-1", "axis", (0, 0, 1), (9, -1), ""),
        ("depth", "depth", (0, 0, 1), None, ""),
        ("depth,1,2", "depth", (0, 0, 1), (1, 2), ""),
        ("volume", "caps", (0, 0, 1), None, "volume"),
        ("volume,0,9", "caps", (0, 0, 1), (0, 9), "volume"),
        ("labels", "labels", (0, 0, 1), None, "volume"),
        ("a.nrrd", "field", (0, 0, 1), None, "a.nrrd"),
        ("a.nrrd,0,9", "field", (0, 0, 1), (0, 9), "a.nrrd"),
        ("a.nrrd,labels", "labels", (0, 0, 1), None, "a.nrrd"),
        ("b,1,2", "field", (0, 0, 1), None, "b,1,2"),
        ("./x", "field", (0, 0, 1), None, "./x"),
    ],
)
def test_color_by_is_that_of_the_program(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    text: str,
    by: str,
    axis: tuple[float, ...],
    limits: Any,
    field: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("a.nrrd", "b,1,2", "x", "depth"):
        Path(name).touch()
    found = parse_color_by(text)
    color_map = color_map_of(found.color_map)
    assert color_map is not None and found.field == field
    assert (color_map.by, color_map.range) == (by, limits)
    assert color_map.axis == pytest.approx(axis)


@pytest.mark.parametrize(
    "text",
    ["", "w", "1,2", "x,1", "z,1,1", "0,0,0", "1,0,0,5", "absent.nrrd", "a,labels", "depth,a,b"],
)
def test_a_bad_color_by_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as raised:
        command.main(["head.nrrd", "--color-by", text])
    said = capsys.readouterr().err
    assert raised.value.code == 1 and said.count("\n") == 1
    assert said.startswith("isowave view: argument --color-by: ")


def test_the_page_begins_with_the_colours_of_the_command(
    open_page: Callable[..., Any]  # noqa: F811
) -> None:
    volume, color_map = FakeVolume(), isowave.ColorMap("magma", range=(1, 9), by="field")
    with Server(fake_scene(volume, field=FakeVolume(), color_map=color_map)) as server:
        page = open_page()
        page.goto(server.url)
        assert asked(page, volume).color_map == color_map_of(color_map)
        assert page.get_by_label("Field", exact=True).is_checked()
        assert state(page)["map"] == "magma,field,1,9"
        # An address says what its page shows.
        page.goto("about:blank")
        page.goto(f"{server.url}#iso=81")
        assert asked(page, volume).color_map is None and not page.problems
