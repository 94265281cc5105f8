"""`isowave view` and isowave.viewer.view(): the command line, how they end, what they refuse."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

import httpx
import pytest
from conftest import FUEL
from viewer_fakes import FakeVolume
from viewer_sockets import HELLO, TIMEOUT, receive_until, wish_text
from websockets.sync.client import connect

import isowave
from isowave.viewer import command, view
from isowave.viewer import server as server_module
from isowave.viewer.command import main, make_parser, parse_bytes, parse_levels, parse_size
from isowave.viewer.server import Server


@pytest.mark.parametrize(
    "text, expected",
    [("5", 5), ("600MB", 600_000_000), ("1GiB", 1 << 30), ("2 k", 2000), ("3b", 3), ("1Ki", 1024)],
)
def test_numbers_of_bytes(text: str, expected: int) -> None:
    assert parse_bytes(text) == expected


@pytest.mark.parametrize("text", ["", "MB", "-1", "1.5GB", "1ZB", "1 000", "0x10", "1GiBB"])
def test_no_numbers_of_bytes(text: str) -> None:
    with pytest.raises(ValueError, match="600MB"):
        parse_bytes(text)


def test_sizes() -> None:
    assert parse_size("1920x1080") == (1920, 1080)
    for text in ("", "x", "0x5", "5x", "5X5", "100000x1"):
        with pytest.raises(ValueError, match="1920x1080"):
            parse_size(text)


def test_numbers_of_levels() -> None:
    assert (parse_levels("all"), parse_levels("3")) == (0, 3)
    for text in ("", "0", "-1", "ALL", "2.5"):
        with pytest.raises(ValueError, match="nor all"):
            parse_levels(text)


def opened_by(arguments: list[str], monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What `isowave view` hands to isowave.open()."""
    seen = dict[str, Any]()

    def fail(path: str, **options: Any) -> None:
        seen.update(options)
        raise isowave.Error("seen")

    monkeypatch.setattr(command, "open_volume", fail)
    assert main(arguments) == 1
    return seen


def test_the_command_line_says_what_the_program_does_of_volumes(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    words = "a.raw --dims 4 5 6 --type uint8 --spacing 1 2 3 --tolerance-relative 0.1 --levels all"
    assert opened_by(words.split(), monkeypatch) == {
        "shape": (6, 5, 4),
        "dtype": "uint8",
        "spacing": (3, 2, 1),
        "tolerance_relative": 0.1,
        "levels": 0,
    }
    words = "a.raw --dims 4 --type uint8 --spacing 2"
    found = opened_by(words.split(), monkeypatch)
    assert (found["shape"], found["spacing"]) == ((4, 4, 4), (2, 2, 2))
    capsys.readouterr()
    assert opened_by(["a.raw", "--dims", "4", "5"], monkeypatch) == {}
    said = capsys.readouterr().err
    assert said == "isowave view: --dims: need X Y Z, or one for all, got 2 numbers\n"


def test_help_lists_view() -> None:
    code = "import sys; from isowave._program import main; sys.argv[1:] = ['-h']; sys.exit(main())"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0
    assert "\n  view   " in done.stdout and "\n  render   " in done.stdout, done.stdout


def test_a_raw_file_without_dims_is_refused(tmp_path: Path) -> None:
    (tmp_path / "ct.dat.raw").write_bytes(bytes(4 * 5 * 6))
    with pytest.raises(isowave.Error, match="give dims and type"):
        isowave.open(tmp_path / "ct.dat.raw")


def test_the_command_line(capsys: pytest.CaptureFixture[str]) -> None:
    parsed = make_parser().parse_args(
        ["a.nrrd", "-i", "5", "--memory-budget", "1GiB", "--size", "8x9"]
    )
    assert (parsed.isovalue, parsed.memory_budget, parsed.size) == (5.0, 1 << 30, (8, 9))
    with pytest.raises(SystemExit):
        make_parser().parse_args(["a.nrrd", "--memory-budget", "much"])
    assert "such as 600MB" in capsys.readouterr().err


@pytest.mark.parametrize(
    "arguments, error",
    [
        (["--port", "80000"], "port 80000: give one from 1 to 65535, or 0 for a free one"),
        (["--port", "x"], "argument --port: invalid int value: 'x'"),
        (["--max-clients", "0"], "max_clients 0: give 1 or more"),
        (["--max-rays", "-5"], "max_rays -5: give 1 or more"),
        (["-i", "nan"], "isovalue nan: give a number that is finite in float32"),
        (["--memory-budget", "much"], "'much' is no number of bytes, such as 600MB or 1GiB"),
        (["--nonsense"], "unrecognized arguments: --nonsense"),
    ],
)
def test_bad_arguments_get_one_line_and_status_1(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    error: str,
) -> None:
    monkeypatch.setattr(command, "open_volume", lambda path: FakeVolume())
    try:
        status: object = main(["ball.nrrd", "--no-browser", *arguments])
    except SystemExit as ended:
        status = ended.code
    output = capsys.readouterr()
    assert (status, output.out) == (1, "")
    assert output.err.startswith("isowave view: ") and output.err.endswith(error + "\n")
    assert output.err.count("\n") == 1


def failing(options: dict[str, Any]) -> Exception:
    return RuntimeError("no such device: nonsense")


def test_a_view_that_cannot_draw_ends_with_the_reason(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(RuntimeError, match="no such device: nonsense"):
        view(FakeVolume(refuse=failing), block=True, notebook=False, open_browser=False)
    monkeypatch.setattr(command, "open_volume", lambda path: FakeVolume(refuse=failing))
    assert main(["ball.nrrd", "--no-browser", "--device", "nonsense"]) == 1
    output = capsys.readouterr()
    assert output.out.count("http://127.0.0.1:") == 2
    assert output.err == "isowave view: no such device: nonsense\n"


def test_a_view_that_does_not_block_is_a_server() -> None:
    server = view(FakeVolume(), isovalue=80, block=False, notebook=False, open_browser=False)
    assert isinstance(server, Server)
    assert httpx.get(server.url).status_code == 200
    server.close()


@pytest.mark.parametrize(
    ("environment", "tells"),
    [({"SSH_CONNECTION": "1", "DISPLAY": ":1"}, True), ({}, True), ({"DISPLAY": ":1"}, False)],
)
def test_it_says_how_to_look_from_another_machine(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    environment: dict[str, str],
    tells: bool,
) -> None:
    for name in ("SSH_CONNECTION", "DISPLAY", "WAYLAND_DISPLAY", "BROWSER"):
        monkeypatch.delenv(name, raising=False)
    for name, value in {"USER": "ada", **environment}.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(command, "open_volume", lambda path: FakeVolume())
    monkeypatch.setattr(server_module, "wait_and_close", lambda server: server.close())
    monkeypatch.setattr(os, "_exit", lambda status: None)  # if a pass is at work
    assert main(["ball.nrrd", "--no-browser"]) == 0
    port, *rest = capsys.readouterr().out.removeprefix("http://127.0.0.1:").split("/", 1)
    line = f"From your machine: ssh -N -L {port}:127.0.0.1:{port} ada@{socket.gethostname()}\n"
    assert (line in rest[0]) == tells, rest


# B1: with the compiled part's own volumes, nanobind told of leaks.
@pytest.mark.parametrize("volume", ["FakeVolume()", f"isowave.open({str(FUEL)!r})"])
def test_the_command_ends_with_ctrl_c(tmp_path: Path, volume: str) -> None:
    assert run_until_ctrl_c(tmp_path, volume) == (0, "")


@pytest.mark.parametrize("what", ["before_pass", "refuse"])
def test_ctrl_c_ends_the_command_in_a_pass_or_a_compilation_of_any_length(
    tmp_path: Path, what: str
) -> None:
    """They take longer than the test waits for the end."""
    volume = f"FakeVolume({what}=lambda _: time.sleep({10 * TIMEOUT}))"
    assert run_until_ctrl_c(tmp_path, volume) == (0, "")


def run_until_ctrl_c(tmp_path: Path, volume: str) -> tuple[int, str]:
    """Status and errors of `isowave view`, ended when a client has wished for a picture."""
    script = tmp_path / "run.py"
    script.write_text(
        "import sys, signal, time, isowave\n"
        "from isowave.viewer import command\n"
        "from viewer_fakes import FakeVolume\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        f"command.open_volume = lambda path: {volume}\n"
        "sys.exit(command.main(['ball.nrrd', '--no-browser']))\n"
    )
    here = str(Path(__file__).parent)
    path = os.pathsep.join([here, *sys.path])
    with subprocess.Popen(
        [sys.executable, str(script)],
        env={**os.environ, "PYTHONPATH": path},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            assert process.stdout is not None
            url = process.stdout.readline().strip()
            assert httpx.get(url).status_code == 200
            with connect(url.replace("http", "ws", 1) + "ws", compression=None) as socket:
                socket.send(HELLO)
                receive_until(socket, type="histogram")
                socket.send(wish_text(1, 0.0))
                process.send_signal(signal.SIGINT)
                _, error = process.communicate(timeout=TIMEOUT)
        finally:
            process.kill()  # nothing, if it has ended
    return process.returncode, error


def test_the_command_says_in_one_line_what_is_wrong(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*arguments: Any, **options: Any) -> None:
        raise OSError("port 80 of 127.0.0.1: Permission denied")

    monkeypatch.setattr(server_module, "serve", fails)
    assert main(["no_such_file.nrrd", "--no-browser"]) == 1
    error = capsys.readouterr().err
    assert error.startswith("isowave view: ") and error.count("\n") == 1
