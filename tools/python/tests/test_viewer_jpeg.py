"""JPEG files of strips: the same pixels as a file that was encoded as a whole."""

from __future__ import annotations

import io

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image as pillow

from isowave.viewer import jpeg


def picture(height: int, width: int) -> NDArray[np.uint8]:
    y, x = np.mgrid[0:height, 0:width]
    red = 128 + 100 * np.sin(x / 7 + 3 * np.sin(y / 9))
    return np.stack([red, red / 2, 255 - red], -1).astype(np.uint8)


def decoded(file: bytes) -> NDArray[np.uint8]:
    return np.asarray(pillow.open(io.BytesIO(file)))


@pytest.mark.parametrize("size", [(1, 1), (64, 5), (65, 33), (130, 16), (723, 1277), (2000, 40)])
@pytest.mark.parametrize("num_threads", [1, 2, 3, 13, 200])
def test_strips_are_one_picture(
    size: tuple[int, int], num_threads: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(jpeg.os, "cpu_count", lambda: num_threads)
    rgb = picture(*size)
    file = jpeg.encode_jpeg(rgb)
    whole = decoded(jpeg.encode_strip(rgb))
    assert np.array_equal(decoded(file), whole)
    assert np.abs(whole.astype(int) - rgb).mean() < 12
    rows = jpeg.rows_of_strip(*size, num_threads)
    markers = sum(file.count(bytes([0xFF, jpeg.RST0 + i])) for i in range(8))
    assert markers == -(-size[0] // rows) - 1
    if num_threads > 1 and size[0] > 64:
        assert markers > 0


def test_a_strip_has_no_more_units_than_a_restart_interval() -> None:
    for width, height in [(16, 65535), (65500, 1000), (4096, 65535)]:
        rows = jpeg.rows_of_strip(height, width, 1)
        assert rows > 0 and rows % jpeg.UNIT == 0
        assert rows // jpeg.UNIT * -(-width // jpeg.UNIT) <= jpeg.MOST_INTERVAL


def test_a_view_of_other_memory_is_encoded() -> None:
    rgb = picture(90, 70)[:, ::-1]
    assert np.array_equal(
        decoded(jpeg.encode_jpeg(rgb)), decoded(jpeg.encode_jpeg(np.ascontiguousarray(rgb)))
    )
