"""Pages with a volume beside them, as `isowave export --site` and save_site() write them, on a
server of files that answers range requests."""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np
import pytest
from browser_pages import browser, keep, open_page
from test_pages import PROGRAM, ROOT, drawn_by_program, rests, shown, state, until

import isowave

VOLUME = "generate:mixing_layer_224x224x224_float32"
BESIDE = "The volume of this page cannot be opened: "


class Files(SimpleHTTPRequestHandler):
    """Files with ranges, as most servers have them; counts what it sends."""

    protocol_version = "HTTP/1.1"

    def __init__(self, *args: Any, server_of: FileServer, **more: Any) -> None:
        self.of = server_of
        super().__init__(*args, **more)

    def do_GET(self) -> None:
        part = re.fullmatch(r"bytes=(\d+)-(\d+)", self.headers.get("Range", ""))
        path = Path(self.translate_path(self.path))
        if not part or not self.of.has_ranges or not path.is_file():
            return super().do_GET()
        begin, end, size = int(part[1]), int(part[2]) + 1, path.stat().st_size
        self.of.sent.append(end - begin)
        if begin >= size or len(self.of.sent) > self.of.most_requests:
            self.close_connection = True  # without an answer, or with none
            return None if begin < size else self.send_error(416)
        with path.open("rb") as file:
            file.seek(begin)
            data = file.read(end - begin)
        self.send_response(206)
        self.send_header("Content-Range", f"bytes {begin}-{begin + len(data) - 1}/{size}")
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        self.wfile.write(data)
        return None

    def log_message(self, *_: Any) -> None:
        pass


class FileServer:
    """Serves a folder. most_requests: of ranges; it cuts later ones."""

    def __init__(self, has_ranges: bool = True, most_requests: int = 10**9) -> None:
        self.has_ranges, self.most_requests = has_ranges, most_requests
        self.sent: list[int] = []

    @contextmanager
    def serve(self, folder: Path) -> Iterator[str]:
        handler = partial(Files, server_of=self, directory=str(folder))
        with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
            Thread(target=server.serve_forever, daemon=True).start()
            yield f"http://127.0.0.1:{server.server_address[1]}/"
            server.shutdown()


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A site of a scene seen from near."""
    folder = tmp_path_factory.mktemp("sites")
    scene = {
        "isowave_scene": 1,
        "volume": VOLUME,
        "surfaces": [{"isovalue": 0.5}],
        "camera": {"eye": [150, 140, 280], "at": [150, 130, 210], "fovy_degrees": 30},
    }
    (folder / "scene.json").write_text(json.dumps(scene))
    command = [PROGRAM, "export", "scene.json", "--rate", "12", "--site", "site"]
    subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)
    command = [PROGRAM, "convert", VOLUME, "--rate", "12", "-o", "volume.zfp"]
    subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)
    return folder / "site"


def test_a_page_reads_what_rays_come_to(
    open_page: Callable[..., Any], site: Path, tmp_path: Path
) -> None:
    server = FileServer()
    with server.serve(site) as url:
        page = open_page()
        page.goto(url)
        rests(page)
        stages = [p["stage"] for p in page.evaluate("window.shownPictures")]
        assert stages[0] == "first" and stages[-2:] == ["sharp", "lossless"]
        volume = site.parent / "volume.zfp"
        assert np.array_equal(shown(page), drawn_by_program(page, volume, tmp_path))
        total = (site / "volume.chunks").stat().st_size
        # What lies between parts is read with them if the server answers slowly.
        assert sum(server.sent) < total / 2
        keep(page, "page_of_a_site")
        # What was read is not read again.
        before = len(server.sent)
        number = page.locator("[name=isovalue]")
        page.locator("[name=ambient]").select_option("8")
        rests(page)
        page.locator("[name=ambient]").select_option("0")
        rests(page)
        after = len(server.sent)
        number.fill("0.6")
        number.press("Enter")
        rests(page)
        assert state(page)["iso"] == "0.6"
        assert np.array_equal(shown(page), drawn_by_program(page, volume, tmp_path))
        assert sum(server.sent) < total and after >= before
        assert page.problems == []
        assert {each.split("?")[0] for each in page.requested if each.startswith("http")} <= {
            url,
            f"{url}volume.chunks",
        }


def says(page: Any, url: str) -> str:
    """The page's line, when it is not about to open the volume any more."""
    page.goto(url)
    until(page, "!/Opening|JavaScript/.test(document.querySelector('#line')?.innerText)")
    assert page.locator("#poster img").is_visible()
    line = str(page.locator("#line").inner_text()).strip()
    assert "\n" not in line
    return line


def test_servers_without_ranges_and_files_are_one_line(
    open_page: Callable[..., Any], site: Path, tmp_path: Path
) -> None:
    with FileServer(has_ranges=False).serve(site) as url:
        assert "does not answer range requests" in says(open_page(), url)
    assert says(open_page(), (site / "index.html").as_uri()).startswith(
        f"{BESIDE}it is read from a server."
    )
    (tmp_path / "index.html").write_bytes((site / "index.html").read_bytes())
    with FileServer().serve(tmp_path) as url:
        assert "the server says 404" in says(open_page(), url)
    data = (site / "volume.chunks").read_bytes()
    for wrong, text in ((data[:-9], "is not the one of this page"), (b"x" * len(data), "damaged")):
        (tmp_path / "volume.chunks").write_bytes(wrong)
        with FileServer().serve(tmp_path) as url:
            assert text in says(open_page(), url)


def test_a_connection_that_is_cut_is_one_line(open_page: Callable[..., Any], site: Path) -> None:
    server = FileServer(most_requests=3)
    with server.serve(site) as url:
        page = open_page()
        page.goto(url)
        note = f"{ROOT}.querySelector('.note').textContent"
        until(page, f"document.querySelector('main') && /was cut/.test({note})")
        # The poster stays, and when the server is there again, so are pictures.
        assert len(np.unique(shown(page))) > 10
        server.most_requests = 10**9
        page.evaluate(f"for (const row of {ROOT}.querySelectorAll('details')) row.open = true")
        page.locator("[name=ambient]").select_option("8")
        rests(page)


def test_python_writes_such_a_folder(tmp_path: Path) -> None:
    volume = isowave.compress(np.fromfunction(lambda z, y, x: x + y + z, (40, 33, 35)))
    volume.save_site(tmp_path / "site", 40, title="Ramp")
    assert {each.name for each in (tmp_path / "site").iterdir()} == {"index.html", "volume.chunks"}
    assert "<title>Ramp</title>" in (tmp_path / "site/index.html").read_text()
    with pytest.raises(isowave.Error, match="clipped"):
        volume.scene().surface(10, clipped=False).save_site(tmp_path / "other")
    assert not (tmp_path / "other").exists()
