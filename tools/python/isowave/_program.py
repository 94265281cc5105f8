"""The command `isowave`: `view` is Python's, everything else the program in the wheel.

Files that the program cannot read, and packages of Python can, it gets as NRRD. Pillow draws its
annotations.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Sequence
from typing import Any

from isowave import _annotator, _loader
from isowave._core import Error
from isowave._given_files import Given, given_files, take_option, with_nrrd
from isowave._given_scene import GivenScene, given_scene, name_real_files, refuse_to_replace
from isowave._source_file import SourceFile
from isowave.viewer import command

PROGRAM = _loader.PACKAGE / "bin" / "isowave"
VIEW = "  view                        Show a volume in a browser: isowave view --help"
FILES = """
With pip install 'isowave[files]', info, convert, render, extract, export, compare and view read
TIFF, layers in TIFF files (slices_*.tif), folders of DICOM, HDF5, NetCDF, zarr, NPY, NPZ, MRC, VTI,
VTK and NIfTI-2, too:
  --dataset NAME              which array of a file that has several, or which level
  --index AXIS=N,...          entries of further axes, counted from 0: t=3,c=0
  --field-dataset NAME        the same of the file that --color-by names
  --field-index AXIS=N,...
"""


def main() -> int:
    """Does not return if the program takes over the process."""
    arguments = sys.argv[1:]
    if arguments[:1] == ["view"]:
        return command.main(arguments[1:])
    if _loader.found["loader"] == str(_loader.BUNDLED_LOADER):
        folders = [str(_loader.BUNDLED_LOADER.parent), os.environ.get("LD_LIBRARY_PATH", "")]
        os.environ["LD_LIBRARY_PATH"] = ":".join(filter(None, folders))
    if arguments in (["-h"], ["--help"]):
        help_text = subprocess.run([PROGRAM, "--help"], stdout=subprocess.PIPE, text=True).stdout
        own = f"\n{VIEW}\n{FILES}\nExit status:"
        print(help_text.replace("\n\nExit status:", own), end="")
        return 0
    files = given_files(arguments)
    try:
        scene = given_scene(arguments, files)
    except Error as error:
        print(f"isowave: {error}", file=sys.stderr)
        return 1
    if files or scene or _annotator.may_annotate(arguments):
        return run_as_child(arguments, files, scene)
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # Python ignores it, which a program inherits
    os.execv(PROGRAM, ["isowave", *arguments])


def run_as_child(arguments: Sequence[str], files: Sequence[Given], scene: GivenScene | None) -> int:
    """Runs the program with NRRD files in place of these, and draws its annotations.

    Returns its exit status.
    """

    def stop(*_: Any) -> None:
        sys.exit(128 + signal.SIGTERM)  # by way of the folder's end

    signal.signal(signal.SIGTERM, stop)
    try:
        with tempfile.TemporaryDirectory(prefix="isowave-") as folder:
            names_of: dict[str, SourceFile | None] = {}
            if scene is not None:
                refuse_to_replace(scene, arguments)
            changed = with_nrrd(arguments, files, folder, names_of, scene)
            saved = take_option([*changed], "--save-scene")
            says_file = arguments[0] == "info"
            with _annotator.start([PROGRAM, *changed], says_file) as process:
                signal.signal(signal.SIGINT, lambda *_: None)  # Ctrl-C ends the program, too
                signal.signal(signal.SIGTERM, lambda *_: process.terminate())
                if process.stdout is not None:
                    print_with_names(process.stdout, arguments, files, names_of)
                status = process.wait()
            if saved is not None and status == 0:
                name_real_files(saved, names_of)
    except (Error, OSError) as error:
        print(f"isowave: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130
    return status if status >= 0 else 128 - status


def print_with_names(
    lines: Iterable[bytes], arguments: Sequence[str], files: Sequence[Given], nrrd: Iterable[str]
) -> None:
    """Prints what `info` says, with the names of files in place of those of NRRD files."""
    names = {}
    for path, each in zip(nrrd, files):
        last = arguments[each.at + each.count - 1]
        name = each.path if each.count == 1 else f"{each.path} ... {last}"
        name = json.dumps(name)[1:-1] if "--json" in arguments else name
        names[os.fsencode(path)] = os.fsencode(name)
    for line in lines:
        for path_bytes, name_bytes in names.items():
            line = line.replace(path_bytes, name_bytes)
        sys.stdout.buffer.write(line)
        sys.stdout.flush()
