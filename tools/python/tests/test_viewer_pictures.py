"""Sizes of pictures, their encoding, and the first isovalue."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from isowave.viewer.pictures import Extent, Stopped, count_rays, encode_png
from isowave.viewer.pictures import fit_size, share_within


def test_an_encoding_stops_when_its_picture_is_not_wanted_any_more() -> None:
    rgb = np.random.default_rng(3).integers(0, 256, (400, 400, 3), np.uint8)
    assert encode_png(rgb, lambda: True).startswith(b"\x89PNG")
    asked = iter([True, True, False])
    with pytest.raises(Stopped):
        encode_png(rgb, lambda: next(asked))


def test_an_extent_has_fewer_rays_a_pixel_then_fewer_pixels_then_less_light() -> None:
    extent = Extent((100, 50), 2, 9)
    assert (extent.rays, extent.all_rays) == (20_000, 200_000)
    assert extent.within(20_000, 200_000) == extent
    assert extent.within(19_999, 200_000) == Extent((100, 50), 1, 9)
    assert extent.within(1_250, 200_000) == Extent((50, 25), 1, 9)
    assert extent.within(20_000, 100_000) == Extent((100, 50), 2, 4)
    assert extent.within(20_000, 5_000) == Extent((100, 50), 1, 0)


def test_rays_that_are_chosen_become_fewer_before_pixels_and_light() -> None:
    extent = Extent((100, 50), 4, ambient=9, chooses=True)
    assert extent.within(80_000, 800_000) == extent
    assert extent.within(79_999, 800_000) == replace(extent, samples=3)
    assert extent.within(80_000, 799_999) == replace(extent, samples=3)
    assert extent.within(5_000, 50_000) == replace(extent, samples=1)
    assert extent.within(4_000, 8_000) == Extent((89, 44), 1, 1, chooses=True)


def test_light_that_bounces_takes_two_rays_for_each() -> None:
    extent = Extent((100, 50), 2, ambient=2, shadow=3, bounce=8)
    assert (extent.rays_of_hits, extent.ability) == (2 * 8 + 3, 2)
    assert extent.within(20_000, 20_000 * 20) == extent
    assert extent.within(20_000, 20_000 * 13) == replace(extent, bounce=4)
    assert extent.within(20_000, 20_000 * 5) == Extent((100, 50), 2, 0, 3, 0)
    assert [Extent((1, 1), 1, *rays).ability for rays in ((0, 0), (5, 0), (0, 1))] == [0, 1, 1]


@pytest.mark.parametrize("rays", [1, 2, 7, 100, 12345])
@pytest.mark.parametrize("size", [(1, 1), (8192, 1), (1, 8192), (1280, 720), (33, 77)])
@pytest.mark.parametrize("samples", [1, 3])
def test_sizes_fit(size: tuple[int, int], samples: int, rays: int) -> None:
    fitted = fit_size(size, samples, rays)
    assert min(fitted) >= 1 and fitted[0] <= size[0] and fitted[1] <= size[1]
    assert count_rays(fitted, samples) <= max(rays, samples**2)


def test_the_share_of_rays_within_a_bound() -> None:
    inf = np.inf
    depth = np.array([inf, inf, 5, 5, 5], np.float32)
    bounds = np.array([0, inf, 0.5, 0.25, inf], np.float32)
    assert share_within(depth, bounds, 0.25) == 0.25
    assert share_within(depth, bounds, 1) == 0.5
    assert share_within(depth[:1], bounds[:1], 1) is None
