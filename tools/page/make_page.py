#!/usr/bin/env python3
"""make_page.py ENGINE.js ENGINE.wasm VIEWER OUT.html.gz: the page without a volume.

The page has the viewer's front end (folder VIEWER), the engine, and places for what isowave's
save_page() puts in: @ISOWAVE_CONNECT@, @ISOWAVE_TITLE@, @ISOWAVE_POSTER@, @ISOWAVE_SCENE@,
@ISOWAVE_VOLUME@, @ISOWAVE_FIELD@. If advdef is installed (apt install advancecomp), the engine
becomes 5 % smaller.
"""

import base64
import gzip
import hashlib
import runpy
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
HOMES = "homes.js"  # of servers and notebooks; these come in its place:
OWN = ("relaxed.js", "remote.js", "drawn_annotations.js", "png.js", "local.js")


def script(viewer: Path) -> str:
    parts = runpy.run_path(str(viewer / "front_end.py"))["PARTS"]
    files = [viewer / part for part in parts if part != HOMES] + [HERE / name for name in OWN]
    return "\n" + "\n".join(file.read_text(encoding="utf-8") for file in files)


def packed_by_gzip(data: bytes) -> bytes:
    packed = gzip.compress(data, 9, mtime=0)
    advdef = shutil.which("advdef")
    if not advdef:
        return packed
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "engine.gz")
        path.write_bytes(packed)
        subprocess.run([advdef, "-z", "-4", "-q", path], check=True)
        return path.read_bytes()


def main() -> None:
    glue, module, viewer, out = map(Path, sys.argv[1:])
    code = glue.read_text(encoding="utf-8") + "\n" + (HERE / "worker.js").read_text()
    view = script(viewer)
    for text in (code, view):
        if "</script" in text.lower():
            sys.exit("make_page: a script holds the end of its element")
    packed = packed_by_gzip(module.read_bytes())
    values = {
        "LICENCES": (HERE / "notices.txt").read_text().strip(),
        "HASH": base64.b64encode(hashlib.sha256(view.encode()).digest()).decode(),
        "CODE": code,
        "MODULE": base64.b64encode(packed).decode(),
        "SCRIPT": view,
    }
    page = (HERE / "page.html").read_text(encoding="utf-8")
    for name, value in values.items():
        page = page.replace(f"@{name}@", value, 1)
    out.write_bytes(gzip.compress(page.encode(), 9, mtime=0))
    print(f"engine: {len(packed)} bytes, packed; page: {len(page)} bytes")


if __name__ == "__main__":
    main()
