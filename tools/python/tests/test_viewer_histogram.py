"""The histogram: a handle for each surface, ticks, scale, zoom; add at peak."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from browser_pages import (
    ROOT,
    browser,
    button,
    changes,
    fake_scene,
    keep,
    open_page,
    page,
    rests,
    server,
    state,
)
from viewer_fakes import FakeVolume

from isowave.viewer.server import Server

#: Colours of the canvas's columns from the bottom, to tell bars apart.
COLUMNS = f"""() => {{
    const canvas = {ROOT}.querySelector(".histogram canvas");
    const {{ data, width, height }} = canvas.getContext("2d").getImageData(
        0, 0, canvas.width, canvas.height);
    return [...Array(width).keys()].map((x) => {{
        let top = 0;
        while (top < height && data[4 * (top * width + x) + 3] === 0) top += 1;
        return height - top;
    }});
}}"""


def isovalues(page: Any) -> list[float]:
    """Those of all surfaces."""
    parts = state(page)
    if "iso" in parts:
        return [float(parts["iso"])]
    return [float(each.split("_")[0]) for each in parts["surfaces"].split(",")]


def test_each_surface_has_a_handle_in_its_colour(page: Any) -> None:
    button(page, "Add surface").click()
    rests(page)
    handles = page.locator(".handles input")
    assert handles.count() == 2 and isovalues(page) == [80, 90.5]
    colours = handles.evaluate_all("all => all.map((e) => e.style.getPropertyValue('--c'))")
    assert colours == ["#dbbd87", "#56b4e9"]
    keep(page, "handles")
    # A handle is taken by its place, whichever surface is selected, and selects its own.
    canvas = page.locator(".histogram canvas").bounding_box()

    def place(value: float) -> float:
        return float(canvas["x"] + 6 + (canvas["width"] - 12) * value / 255)

    page.mouse.move(place(80), canvas["y"] + 22)
    page.mouse.down()
    page.mouse.move(place(40), canvas["y"] + 22, steps=4)
    page.mouse.up()
    rests(page)
    assert isovalues(page) == pytest.approx([40, 90.5], abs=1.5)
    assert page.locator(".surfaces li").first.get_attribute("aria-current") == "true"
    # Beside the handles, the selected surface follows.
    page.mouse.click(place(200), canvas["y"] + 30)
    rests(page)
    assert isovalues(page) == pytest.approx([200, 90.5], abs=1.5)
    handles.nth(1).focus()
    page.keyboard.press("ArrowRight")
    rests(page)
    assert isovalues(page)[1] == pytest.approx(91, abs=1)
    assert page.problems == []


def test_ticks_and_peaks_are_suggestions(page: Any) -> None:
    button(page, "Suggested: 180.5").click()
    rests(page)
    assert isovalues(page) == [180.5]
    peak = page.get_by_label("Add at peak")
    assert peak.locator("option").all_inner_texts() == ["Add at peak …", "90.5"]
    peak.select_option("90.5")
    rests(page)
    assert isovalues(page) == [180.5, 90.5] and peak.is_disabled()


def test_bars_are_linear_or_logarithms(page: Any) -> None:
    log = page.evaluate(COLUMNS)
    assert "log scale" in page.locator(".ends").inner_text()
    button(page, "log").click()
    linear = page.evaluate(COLUMNS)
    assert "linear scale" in page.locator(".ends").inner_text()
    assert button(page, "log").get_attribute("aria-pressed") == "false"
    middle = len(log) // 2
    # Shells of a ball with half the radius have a quarter of the voxels.
    assert linear[middle] < 0.4 * linear[8] and log[middle] > 0.7 * log[8]


def test_the_histogram_zooms_about_the_cursor(page: Any) -> None:
    canvas = page.locator(".histogram canvas").bounding_box()
    ends = page.locator(".ends span")
    page.mouse.move(canvas["x"] + 6 + (canvas["width"] - 12) * 0.4, canvas["y"] + 20)
    page.mouse.wheel(0, -400)
    page.wait_for_timeout(100)
    low, high = (float(ends.nth(i).inner_text()) for i in (0, 2))
    assert 0 < low < 102 < high < 255
    assert low + 0.4 * (high - low) == pytest.approx(102, abs=0.5)
    handle = page.locator(".handles input")
    assert float(handle.get_attribute("min")) == pytest.approx(low, abs=1e-3)
    keep(page, "histogram_zoomed")
    button(page, "All").click()
    assert [ends.nth(i).inner_text() for i in (0, 2)] == ["0", "255"]
    button(page, "Show fewer values").click()
    assert float(ends.nth(2).inner_text()) - float(ends.nth(0).inner_text()) < 200
    button(page, "Show more values").click()
    assert [ends.nth(i).inner_text() for i in (0, 2)] == ["0", "255"]
    assert state(page)["iso"] == "80" and page.problems == []


def test_bytes_have_no_comb(open_page: Callable[..., Any]) -> None:
    """233 values in 256 bins would leave 23 of them empty."""

    class Bytes(FakeVolume):
        def histogram(self, bins: int = 256) -> Any:
            import numpy as np

            return np.histogram(np.arange(233).repeat(50), bins=bins, range=(0, 232))

    with Server(fake_scene(Bytes(value_range=(0.0, 232.0)))) as server:
        page = open_page()
        page.goto(server.url)
        rests(page)
        heights = page.evaluate(COLUMNS)[8:-8]
        assert min(heights) == max(heights) > 20
