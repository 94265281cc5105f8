"""Functions that hand on arguments name all of them, and refuse others in Python's words."""

from __future__ import annotations

import inspect
import re

import numpy as np
import pytest
from conftest import FUEL, TOP

import isowave
from isowave._compress import OpenArguments
from isowave._renderer import RendererArguments
from isowave._request import FrameArguments, Look
from isowave._scene import LOOK, SceneFrame

FRAME = inspect.signature(isowave.Renderer.render).parameters
OF_VOLUME = {"device", "memory_budget", "field"}


def named(function):
    """Names and defaults of keywords."""
    parameters = inspect.signature(function).parameters.values()
    assert not any(each.kind is each.VAR_KEYWORD for each in parameters), function
    return {each.name: each.default for each in parameters if each.name != "self"}


@pytest.mark.parametrize(
    "function, own, without",
    [
        (isowave.Volume.render, OF_VOLUME, set()),
        (isowave.Series.render, OF_VOLUME, set()),
        (isowave.Scene.render, OF_VOLUME, {"isovalue"}),
        (isowave.Renderer.passes, set(), {"on_pass", "progress"}),
        (isowave.BrickRenderer.render, set(), {"time_budget_ms"}),
    ],
)
def test_all_that_draw_name_the_arguments_of_a_frame(function, own, without):
    found = named(function)
    assert found.keys() == own | (FRAME.keys() - {"self"} - without)
    changed = {"size", "outputs"}  # sizes of volumes, outputs of bricks
    for name in found.keys() - own - changed:
        assert found[name] == FRAME[name].default, name


def test_other_functions_name_theirs():
    made = inspect.signature(isowave.Renderer).parameters.keys() - {"volume"}
    assert named(isowave.Volume.renderer).keys() == made == RendererArguments.__annotations__.keys()
    opened = named(isowave.open).keys() - {"path"}
    assert opened == OpenArguments.__annotations__.keys()
    assert named(isowave.open_scene).keys() == opened | {"path", "volume", "field"}
    assert {"origin", "direction", "fill_value"} < named(isowave.open_series).keys()
    assert named(isowave.Volume.view).keys() == named(isowave.view).keys()
    assert named(isowave.Scene.look).keys() == {*LOOK} == {"field", *Look.__annotations__}


def test_types_are_those_of_the_arguments():
    frame = FRAME.keys() - {"self", "isovalue"}
    assert FrameArguments.__annotations__.keys() == frame
    assert SceneFrame.__annotations__.keys() == frame | OF_VOLUME


def test_an_argument_that_there_is_not_is_named(volume):
    renderer = volume.renderer(size=(16, 12), device="host")
    for draw in (volume.render, renderer.passes, volume.scene().surface(6).render):
        with pytest.raises(TypeError, match="no argument colour: do you mean color?"):
            result = draw(**({} if "Scene" in str(draw) else {"isovalue": 6}), colour="red")
            next(iter(result))
    with pytest.raises(TypeError, match="there is no argument xyz$"):
        volume.render(6, xyz=1)
    with pytest.raises(TypeError, match="neither on_pass nor progress"):
        next(renderer.passes(6, progress=True))


def test_a_look_keeps_what_is_not_given(volume):
    scene = volume.scene().look(background="black", light_angle=5.0).look(light_angle=7.0)
    assert (scene.background, scene.light_angle) == ("black", 7.0)
    assert scene.look(background=None).background is None


def test_messages_of_the_library_name_no_options_of_the_program():
    """Python and C++ show them, too (B3)."""
    text = re.compile(r'"(?:[^"\\\n]|\\.)*"')
    for file in (TOP / "core").rglob("*.cpp"):
        source = re.sub(r"^\s*//.*$", "", file.read_text(), flags=re.MULTILINE)
        found = [each for each in text.findall(source) if re.search(r"(?<![-\w])--[a-z]", each)]
        assert not found, (file, found)


def test_voxels_without_data_need_no_option():
    """B3: NaN was refused by the name of an option."""
    voxels = np.arange(125, dtype=np.float32).reshape(5, 5, 5)
    voxels[1, 2, 3] = np.nan
    volume = isowave.compress(voxels)
    assert np.isnan(volume[1, 2, 3]) and volume.render(60, size=(16, 12), device="host").complete


@pytest.mark.parametrize("slope, is_exact", [(0.5, True), (0.1, False)])
def test_scaled_nifti_is_exact_if_float32_holds_it(tmp_path, slope, is_exact):
    """B15: slopes made float64 of int16, which --exact refused."""
    nibabel = pytest.importorskip("nibabel")
    image = nibabel.Nifti1Image(np.arange(64, dtype=np.int16).reshape(4, 4, 4), np.eye(4))
    image.header.set_slope_inter(slope, 0)
    image.to_filename(tmp_path / "a.nii")
    assert isowave.open(tmp_path / "a.nii").max_error < 1e-6
    if is_exact:
        assert isowave.open(tmp_path / "a.nii", exact=True).max_error == 0
    else:
        with pytest.raises(isowave.Error, match="float32") as raised:
            isowave.open(tmp_path / "a.nii", exact=True)
        assert "\n" not in str(raised.value)


def test_float32_is_exact():
    assert isowave.compress(np.random.default_rng(0).random((4, 5, 6)), rate=None).max_error < 1e-7
    voxels = np.random.default_rng(0).random((4, 5, 6), np.float32)
    assert isowave.compress(voxels, exact=True).max_error == 0
    assert isowave.open(FUEL, exact=True).max_error == 0
