"""Names agree: of the program's options, of Python's arguments, and of C++'s fields."""

import dataclasses
import inspect
import re

import pytest
from conftest import TOP
from test_files_program import command

import isowave
from isowave._request import LIGHTS, Request
from isowave.viewer.command import make_parser

PYTHON = {field.name for field in dataclasses.fields(Request)}
#: Options that have another name than the argument of Renderer.render(), and why.
OTHER_OPTIONS = {
    # one value each, and no unit
    **{"surface": "surfaces", "slice": "slices", "time_budget": "time_budget_ms"},
    **{name: f"{name}_rays" for name in ("ambient", "shadow", "bounce")},
    # several options for one argument
    **{"labels": "surfaces", "color_by": "color_map", "clip_box": "clip", "no_caps": "caps"},
    **{"slice_opacity": "slices", "slice_range": "slice_map", "cameras": "camera"},
    **{"depth": "outputs", "error_map": "outputs"},
}
#: Options that have another name than the argument of open() and Renderer().
OTHER_FILES = {"dims": "shape", "type": "dtype", "cache_slots": "cache_blocks"}
#: Options of the program alone: files that it writes, views, how researchers draw.
OWN_OPTIONS = set(
    "help output scene save_scene save_camera steps movie fps refined stats no_stage_times verbose"
    " progress_dir annotate units title view up zoom fit orbit turntable parallel bricks stream"
    " field_index pipeline speculation max_speculation solver grouping closest group_size"
    " reference".split()
)
#: Python's arguments without an option: functions, what the program chooses itself, and the second
#: colour of --background.
OWN_ARGUMENTS = {"lights", "on_pass", "progress", "series", "background_top"}
#: C++'s fields that one argument of Python holds.
FIELDS = {
    "camera": {"eye", "at", "up", "fovy_degrees", "parallel_height"},
    "size": {"width", "height"},
    "color": {"surface"},
    "lights": {*LIGHTS},
    "light": {"light_direction"},
    "color_map": {"color_map", "color_table", "color_axis", "color_low", "color_high"}
    | {"color_by_depth", "color_by_field", "color_by_label", "color_caps_alone"},
    "slice_map": {"slice_map", "slice_table", "slice_low", "slice_high"},
    "outputs": {f"want_{name}" for name in "picture depth normals positions hits field".split()}
    | {"want_bounds"},
}


def options_of(name):
    """The long options that --help of a command lists, as names of Python."""
    text = command(name, "--help").stdout
    return {o.replace("-", "_") for o in re.findall(r"^  (?:-\w,)?--([a-z-]+)", text, re.M)}


def fields_of(header, pattern):
    return set(re.findall(pattern, (TOP / "core/api/isowave" / header).read_text()))


def test_options_of_render_are_arguments():
    options = options_of("render")
    opened = {*inspect.signature(isowave.open).parameters}
    made = {*inspect.signature(isowave.Renderer).parameters}
    assert len(options) > 60 and not OWN_OPTIONS & (PYTHON | opened | made)
    assert options >= OWN_OPTIONS | OTHER_OPTIONS.keys() | OTHER_FILES.keys()
    shared = options - OWN_OPTIONS
    names = {OTHER_FILES.get(o, OTHER_OPTIONS.get(o, o)) for o in shared}
    assert names <= PYTHON | opened | made, names - PYTHON - opened - made
    assert PYTHON - names == OWN_ARGUMENTS


def test_arguments_are_fields_of_cpp():
    fields = fields_of("frame.hpp", r'visit\("(\w+)"')
    expected = set().union(*(FIELDS.get(name, {name}) for name in PYTHON))
    assert expected - fields == {"on_pass", "progress"}  # functions: on_pass, on_progress
    parts = {f.name for part in (isowave.Surface, isowave.Slice) for f in dataclasses.fields(part)}
    assert parts <= fields
    assert fields - expected - parts == {"bound"}  # which Python chooses


def test_abilities_of_renderers_are_those_of_cpp():
    text = (TOP / "core/api/isowave/renderer.hpp").read_text()
    text = text[text.index("struct RendererOptions") : text.index("class Renderer {")]
    found = set(re.findall(r"^  [\w:<> ]+? (\w+)(?: = \w+|\{\});", text, re.M))
    assert {"with_levels", "memory_budget", "field"} < found
    made = {*inspect.signature(isowave.Renderer).parameters}
    made -= {"volume", "device", "profiling", "quick"}  # how it is made
    assert {name.removeprefix("with_") for name in found - {"largest"}} == made - {
        "size",
        "samples",
    }


@pytest.mark.parametrize("name", ["convert", "generate"])
def test_threads_have_one_name(name):
    assert "num_threads" in options_of(name)
    assert "num_threads" in inspect.signature(isowave.compress).parameters
    assert "num_threads" in fields_of("volume.hpp", r"(\w+) = 0;")


def test_options_of_view_are_those_of_render():
    of_render = options_of("render") | {"dataset", "field_dataset"}
    of_page = {"host", "port", "max_clients", "max_rays", "no_browser"}
    given = {option for each in make_parser()._actions for option in each.option_strings}
    options = {o.removeprefix("--").replace("-", "_") for o in given if o.startswith("--")}
    assert options - of_page <= of_render
    opened = {*inspect.signature(isowave.open).parameters}
    names = {OTHER_FILES.get(name, name) for name in of_render | options_of("convert")}
    assert opened - {"path", "progress"} <= names
