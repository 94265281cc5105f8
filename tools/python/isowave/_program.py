"""The command `isowave`: `view` is Python's, everything else the program in the wheel."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

from isowave import _loader
from isowave.viewer import command

PROGRAM = _loader.PACKAGE / "bin" / "isowave"
VIEW = "  view                        Show a volume in a browser: isowave view --help"


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
        print(help_text.replace("\n\nExit status:", f"\n{VIEW}\n\nExit status:"), end="")
        return 0
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # Python ignores it, which a program inherits
    os.execv(PROGRAM, ["isowave", *arguments])
