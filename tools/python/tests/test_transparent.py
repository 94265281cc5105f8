"""Pictures that are drawn with an alpha, without a background."""

import numpy as np
import pytest
from conftest import FUEL

import isowave

SIZE = (64, 48)


@pytest.fixture(scope="module")
def renderer(volume):
    return volume.renderer(size=SIZE, samples=3)


def test_alpha_is_the_share_of_rays_that_hit(volume, renderer):
    for samples in (1, 2, 3):
        image = renderer.render(6, samples=samples, transparent=True)
        rgba = image.rgba
        assert rgba.shape == (48, 64, 4) and rgba.dtype == np.uint8
        rays = np.isfinite(image.depth).reshape(48, samples, 64, samples)
        share = rays.mean(axis=(1, 3))
        assert np.array_equal(rgba[..., 3], np.floor(255 * share + 0.5))
        assert (rgba[share == 0] == 0).all() and (share == 0).any()
        assert ((share > 0) & (share < 1)).any() == (samples > 1)
        opaque = renderer.render(6, samples=samples, background="#3070b0")
        assert np.array_equal(rgba[share == 1][:, :3], opaque.rgb[share == 1])
        laid_over = share[..., None] * rgba[..., :3] + (1 - share[..., None]) * (0x30, 0x70, 0xB0)
        # rounded: the picture, and the colour that the share makes less
        assert np.abs(laid_over - opaque.rgb).max() <= 1
        on_host = volume.render(6, size=SIZE, samples=samples, transparent=True, device="host")
        assert np.array_equal(on_host.rgba, rgba)


def test_alpha_of_a_picture_over_a_gradient(renderer):
    colors = {"background": (0.9, 0.5, 0), "background_top": "#1040f0"}
    over = renderer.render(6, samples=3, **colors)
    rows = 1 - (np.arange(48) + 0.5) / 48
    bottom, top = np.array([0.9, 0.5, 0]) * 255, np.array([0x10, 0x40, 0xF0])
    expected = bottom + rows[:, None] * (top - bottom)
    alone = over.rgba[..., 3] == 0
    assert np.abs(over.rgb - expected[:, None])[alone].max() <= 0.5001
    # Rounded once more, of a part of a pixel: up to half a level, and one for each ray of nine.
    transparent = renderer.render(6, samples=3, transparent=True).rgba
    edge = (over.rgba[..., 3] > 128) & (over.rgba[..., 3] < 255)
    assert edge.any()
    assert np.abs(over.rgba[edge].astype(int) - transparent[edge]).max() <= 2


def test_alpha_needs_no_depth_and_leaves_no_rgb(renderer):
    image = renderer.render(6, samples=2, transparent=True, outputs=("rgb",))
    whole = renderer.render(6, samples=2, transparent=True)
    assert np.array_equal(image.rgba, whole.rgba) and image.depth is None
    assert np.array_equal(np.asarray(image), image.rgba)
    assert "64 x 48" in repr(image)
    with pytest.raises(ValueError, match="a transparent picture has no rgb: take rgba"):
        image.rgb
    none = renderer.render(6, transparent=True, outputs=("depth",))
    assert none.rgb is None
    with pytest.raises(ValueError, match="was not asked for"):
        none.rgba


def test_files_have_the_programs_bits(program, tmp_path):
    image = isowave.open(FUEL, exact=True).render(10, size=(96, 72), samples=2, transparent=True)
    image.save(tmp_path / "a.png")
    image.save(tmp_path / "b.png", alpha=True)
    program("render", FUEL, "-i", 10, "--exact", "--size", "96x72", "--samples", 2,
            "--transparent", "-o", tmp_path / "c.png")  # fmt: skip
    expected = (tmp_path / "c.png").read_bytes()
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes() == expected
    assert image._repr_png_() == expected


def test_pictures_so_far_are_transparent_too(volume):
    renderer = volume.renderer(size=SIZE, cache_blocks=16, time_budget=True)
    whole = renderer.render(6, transparent=True).rgba
    pictures = [image.rgba for image in renderer.passes(6, transparent=True)]
    assert len(pictures) > 2 and np.array_equal(pictures[-1], whole)
    seen = [(picture[..., 3] != 0).sum() for picture in pictures]
    assert seen == sorted(seen) and seen[0] < seen[-2]
    shapes = []

    def look(progress):
        shapes.append(progress.rgba.shape)
        with pytest.raises(ValueError, match="no rgb: take rgba"):
            progress.rgb

    # The first picture of an isovalue is small.
    timed = renderer.render(6.5, transparent=True, time_budget_ms=1e6, on_pass=look)
    assert shapes[0] == (6, 8, 4) and shapes[-1] == (48, 64, 4)
    assert np.array_equal(timed.rgba, renderer.render(6.5, transparent=True).rgba)

    def look_for_alpha(progress):
        with pytest.raises(ValueError, match="no alpha: render"):
            progress.rgba

    renderer.render(6, on_pass=look_for_alpha)


def test_a_background_is_refused(renderer):
    for background in ("#ffffff", (0, 0, 0)):
        with pytest.raises(ValueError, match="background: a transparent picture has none"):
            renderer.render(6, transparent=True, background=background)
        with pytest.raises(ValueError, match="background_top: a transparent picture has none"):
            renderer.render(6, transparent=True, background_top=background)
