"""The command `isowave view`."""

from __future__ import annotations

import argparse
import json
import os
import re
import socket
import sys
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn

from isowave._annotate import NAMES, Annotations
from isowave._color_map import ColorMap
from isowave._compress import open as open_volume
from isowave._core import read_scene
from isowave._scene_file import annotations_of_scene, open_field, part_of_scene
from isowave._series import Series, open_series

from . import missing
from .color_by import parse_color_by, parse_color_map
from .protocol import MAX_RAYS, first_line


def parse_bytes(text: str) -> int:
    """A number of bytes: 1048576, 600MB, 1GiB. Raises ValueError."""
    match = re.fullmatch(r"([0-9]+) *(?:([kmgtpe])(i?))?b?", text.strip().lower())
    if not match:
        raise ValueError(f"'{text}' is no number of bytes, such as 600MB or 1GiB")
    number, prefix, binary = match.groups()
    power = "kmgtpe".index(prefix) + 1 if prefix else 0
    factor: int = (1024 if binary else 1000) ** power
    return int(number) * factor


def parse_size(text: str) -> tuple[int, int]:
    """WxH. Raises ValueError."""
    match = re.fullmatch(r"([1-9][0-9]{0,4})x([1-9][0-9]{0,4})", text)
    if not match:
        raise ValueError(f"'{text}' is no size, such as 1920x1080")
    return int(match[1]), int(match[2])


def parse_levels(text: str) -> int:
    """A number from 1 on, or 0 for "all". Raises ValueError."""
    if text != "all" and not re.fullmatch("[1-9][0-9]{0,3}", text):
        raise ValueError(f"'{text}' is no number of levels, such as 3, nor all")
    return 0 if text == "all" else int(text)


def parse_annotations(text: str) -> tuple[str, ...]:
    """Names of annotations, separated by commas; "none": (). Raises ValueError."""
    asked = () if text == "none" else tuple(text.split(","))
    for name in asked:
        if name not in (*NAMES, "all"):
            raise ValueError(f"'{name}' is none of {', '.join(NAMES)}, nor all, nor none")
    return asked


def reversed_axes(option: str, values: list[Any] | None) -> tuple[Any, ...] | None:
    """X Y Z, or one for all, as (z, y, x). Raises ValueError."""
    if values is None:
        return None
    if len(values) not in (1, 3):
        raise ValueError(f"{option}: need X Y Z, or one for all, got {len(values)} numbers")
    return tuple(reversed(values if len(values) == 3 else 3 * values))


class _Parser(argparse.ArgumentParser):
    """Says in one line what is wrong, and exits with status 1, as the other commands do."""

    def error(self, message: str) -> NoReturn:
        self.exit(1, f"{self.prog}: {message}\n")


def make_parser() -> argparse.ArgumentParser:
    """The command line of `isowave view`."""
    parser = _Parser(
        prog="isowave view",
        description="Shows isosurfaces of a volume, or of a series of volumes, in a browser, until "
        "Ctrl-C ends it.",
    )
    add = parser.add_argument
    add(
        "volume",
        nargs="*",
        help="file or folder of any format that isowave reads, or generate:... [that of --scene]. "
        "Several files, a quoted pattern (step_*.nrrd), or a file with an axis t are the steps of "
        "a series",
    )
    add(
        "-i",
        "--isovalue",
        type=float,
        help="first isovalue [the first that `isowave info` suggests]",
    )
    add("--scene", metavar="FILE", help="scene file (JSON) that the page shows at first")
    add(
        "--color-by",
        type=_argument(parse_color_by),
        metavar="BY",
        help="what colours surfaces at first, as in `isowave render`: x, y, z, NX,NY,NZ, depth, "
        "FILE, or volume, the same one, for its caps; then ,LOW,HIGH if wanted; or labels, or "
        "FILE,labels",
    )
    add(
        "--color-map",
        type=_argument(parse_color_map),
        metavar="NAME",
        help="colours of --color-by [viridis; by labels, labels]",
    )
    add(
        "--annotate",
        type=_argument(parse_annotations),
        metavar="LIST",
        help="drawn over pictures at first, separated by commas: scale-bar, axes, color-bar, "
        "caption; or all, or none [those of --scene]",
    )
    add(
        "--units",
        metavar="TEXT",
        help="units of the world for the scale bar and colours along an axis, such as mm [those of "
        "--scene]",
    )
    add("--device", help="host, or a device: index, gpu, cpu, a part of its name [gpu, else host]")
    add("--memory-budget", type=_argument(parse_bytes), help="most memory to draw: 600MB, 1GiB")
    add("--size", type=_argument(parse_size), default=(1920, 1080), help="largest picture")
    add("--rate", type=int, help="bits per voxel [all that float32 holds]")
    add("--tolerance", type=float, help="largest error of a voxel")
    add("--tolerance-relative", type=float, help="as a part of the range of values")
    add("--exact", action="store_true", help="refuse voxels that float32 does not hold")
    add("--levels", type=_argument(parse_levels), metavar="N|all", help="how many levels of detail")
    add("--dims", type=int, nargs="+", help="voxels of a raw file: X Y Z, or N for a cube")
    add("--type", help="voxel type of a raw file: uint8, int8, ... float32, float64")
    add("--spacing", type=float, nargs="+", help="world units between voxels: X Y Z, or one")
    add("--no-data", type=float, help="value of voxels without data, beside NaN")
    add("--dataset", metavar="NAME", help="which array of a file that has several, or which level")
    add("--index", metavar="AXIS=N,...", help="entries of further axes, counted from 0: t=3,c=0")
    add("--field-dataset", metavar="NAME", help="--dataset of the field's file")
    add("--field-index", metavar="AXIS=N,...", help="--index of the field's file")
    add("--host", default="127.0.0.1", help="address to listen at; traffic is not encrypted")
    add("--port", type=int, default=0, help="port to listen at; 0: a free one")
    add("--max-clients", type=int, default=16, help="most clients at the same time")
    add(
        "--max-rays",
        type=int,
        default=MAX_RAYS,
        help="most rays of a client's picture: pixels x samples x (1 + rays of light per hit); "
        "larger pictures are drawn smaller, which the page says [%(default)s]",
    )
    add("--no-browser", action="store_true", help="only print the URL")
    return parser


def scene_of(arguments: argparse.Namespace) -> dict[str, Any]:
    """The fields of --scene; none without. Raises ValueError, isowave.Error."""
    if arguments.scene is None:
        if not arguments.volume:
            raise ValueError("give a volume, or a scene that names one")
        return {}
    for name in ("isovalue", "color_by", "color_map"):
        if getattr(arguments, name) is not None:
            option = name.replace("_", "-")
            raise ValueError(f"--{option}: --scene says what is drawn: leave out either")
    fields = read_scene(arguments.scene)
    if not arguments.volume and not fields["volume"]:
        raise ValueError(f"{arguments.scene} names no volume: give one")
    if fields["color_by_field"] and not fields["field"]:
        raise ValueError(
            f'{arguments.scene}: its colours are by a field, and it names none: add "field", a file'
        )
    return fields


def annotations_of(arguments: argparse.Namespace, fields: dict[str, Any]) -> Annotations | None:
    """What is drawn over pictures at first; None: what the scene has. Raises ValueError."""
    asked, units = arguments.annotate, arguments.units
    found = annotations_of_scene(fields.get("annotations"), "")
    if units is not None and (asked == () or (asked is None and found is None)):
        raise ValueError(f"--units {units}: nothing is annotated: give --annotate")
    changes = {name: each for name, each in (("what", asked), ("units", units)) if each is not None}
    return replace(found or Annotations(), **changes) if changes else None


def field_of(arguments: argparse.Namespace, fields: dict[str, Any]) -> str:
    """The field's file: that of --color-by, or of the scene if its colours need it; "": none."""
    if arguments.color_by is not None:
        return str(arguments.color_by.field)
    return str(fields["field"]) if fields.get("color_by_field") else ""


def color_map_of(arguments: argparse.Namespace) -> ColorMap | None:
    """The colours that pages have at first; None: those of the scene. Raises ValueError."""
    if arguments.color_by is None:
        if arguments.color_map is not None:
            raise ValueError("--color-map: give --color-by, or leave it out")
        return None
    color_map: ColorMap = arguments.color_by.color_map
    return replace(color_map, colors=arguments.color_map)


def parts_of(
    arguments: argparse.Namespace, fields: dict[str, Any], of_field: str
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Dataset and index of the volume and of the field. Raises ValueError."""
    of_scene = {} if arguments.volume or not fields else part_of_scene(fields)
    own = {"dataset": arguments.field_dataset, "index": arguments.field_index}
    own = {name: each for name, each in own.items() if each is not None}
    if own and of_field in ("", "volume"):
        raise ValueError(f"--field-{next(iter(own))}: no file's values colour the surface")
    return of_scene, {**(part_of_scene(fields, "field_") if fields else {}), **own}


def series_of(names: Sequence[str], given: dict[str, Any]) -> Series | None:
    """The series of several files, of a pattern, or of a file with a fourth axis.

    None: a volume. Raises isowave.Error. Steps are not opened.
    """
    name, is_there = names[0], Path(names[0]).exists()
    is_pattern = not (is_there or name.startswith("generate:")) and re.search(r"[*?[]", name)
    if len(names) == 1 and not is_pattern and (not is_there or name.endswith(".zfp")):
        return None
    with warnings.catch_warnings(record=True) as noted:
        series = open_series(names if len(names) > 1 else name, **given)
    if len(series) == 1 and len(names) == 1 and not is_pattern:
        return None  # opening the volume warns of the same
    for warning in noted:
        warnings.warn(warning.message)
    return series


def title_of(names: Sequence[str]) -> str:
    """The file's name, or the first and the last one."""
    first, last = Path(names[0]).name, Path(names[-1]).name
    return first if len(names) == 1 else f"{first} to {last}"


def _argument(parse: Any) -> Any:
    """Makes argparse show only the text of a ValueError."""

    def parsed(text: str) -> Any:
        try:
            return parse(text)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return parsed


def main(argv: Sequence[str] | None = None) -> int:
    """The command `isowave view`. Returns its exit status."""
    try:
        from .server import has_display, serve, wait_and_close
    except ImportError as error:
        print(f"isowave view: {missing(error, 'view')}", file=sys.stderr)
        return 1
    arguments = make_parser().parse_args(argv)
    # As the program's other warnings: a line each.
    warnings.formatwarning = lambda message, *_, **__: f"isowave: warning: {message}\n"
    try:
        given = {
            "rate": arguments.rate,
            "tolerance": arguments.tolerance,
            "tolerance_relative": arguments.tolerance_relative,
            "exact": arguments.exact or None,
            "levels": arguments.levels,
            "no_data": arguments.no_data,
            "shape": reversed_axes("--dims", arguments.dims),
            "dtype": arguments.type,
            "spacing": reversed_axes("--spacing", arguments.spacing),
            "dataset": arguments.dataset,
            "index": arguments.index,
        }
        fields = scene_of(arguments)
        annotations, color_map = annotations_of(arguments, fields), color_map_of(arguments)
        names, of_field = arguments.volume or [fields["volume"]], field_of(arguments, fields)
        of_scene, own = parts_of(arguments, fields, of_field)
        given = of_scene | {key: value for key, value in given.items() if value is not None}
        series = series_of(names, given)
        if series is not None and of_field not in ("", "volume"):
            raise ValueError("a series has no second volume to colour by: name one of its steps")
        # The field comes first: if it cannot be opened, the volume need not be compressed.
        field = None if of_field in ("", "volume") else open_field(of_field, given, **own)
        volume = open_volume(names[0], **given) if series is None else series
        server = serve(
            volume,
            field=volume if of_field == "volume" else field,
            field_name=Path(of_field).name,
            title=title_of(names),
            scene=json.dumps(fields) if arguments.scene else "",
            annotations=annotations,
            color_map=color_map,
            isovalue=arguments.isovalue,
            device=arguments.device,
            memory_budget=arguments.memory_budget,
            size=arguments.size,
            max_clients=arguments.max_clients,
            max_rays=arguments.max_rays,
            host=arguments.host,
            port=arguments.port,
            open_browser=not arguments.no_browser,
        )
    except KeyboardInterrupt:
        return 130
    except Exception as error:  # of the library, of the socket
        print(f"isowave view: {first_line(error)}", file=sys.stderr)
        return 1
    print(f"{server.url}\nCtrl-C ends it.", flush=True)
    if "SSH_CONNECTION" in os.environ or not has_display():
        way = f"{server.port}:127.0.0.1:{server.port}"
        user, here = os.environ.get("USER", ""), socket.gethostname()
        there = f"{user}@{here}" if user else here
        print(f"From your machine: ssh -N -L {way} {there}", flush=True)
    failure = wait_and_close(server)
    if failure is not None:
        print(f"isowave view: {failure}", file=sys.stderr)
    status = 0 if failure is None else 1
    if server.scene.is_busy:
        # A long pass, or a driver that compiles kernels, cannot be stopped, and Python would wait
        # for its end.
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
    return status
