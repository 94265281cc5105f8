"""Movies, which the program ffmpeg encodes."""

from __future__ import annotations

import contextlib
import os
import pathlib
import shutil
import subprocess
import tempfile
from collections.abc import Iterable
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from isowave import _core
from isowave._checked import number
from isowave._image import Image

# As `isowave render --movie` has ffmpeg write movies (core/io/movie.cpp).
ENCODING = [
    *("-an", "-c:v", "libx264", "-crf", "18"),
    *("-vf", "scale=out_color_matrix=bt709:out_range=tv,format=yuv420p"),
    *("-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "iec61966-2-1"),
    *("-color_range", "tv", "-movflags", "+faststart", "-f", "mp4"),
]


def pixels_of(image: Any) -> npt.NDArray[np.uint8]:
    """The picture as (height, width, 3)."""
    pixels = image.rgb if isinstance(image, Image) else image
    if pixels is None:
        raise ValueError("images: one has no picture: draw it with the output 'picture'")
    array = np.asarray(pixels)
    if array.dtype != np.uint8 or array.ndim != 3 or array.shape[2] != 3:
        raise TypeError(
            f"images: one is {array.dtype}{array.shape}: give isowave.Image, or uint8 arrays of "
            "(height, width, 3)"
        )
    return np.ascontiguousarray(array)


def save_movie(
    images: Iterable[Image | npt.NDArray[np.uint8]],
    path: str | os.PathLike[str],
    *,
    fps: float = 25,
) -> int:
    """Writes pictures as an MP4 movie (H.264), by the program ffmpeg, which must be in PATH.

    The file appears whole or not at all. Pictures are taken one by one, as they are drawn:
    ``save_movie((volume.render(80, camera=c) for c in volume.turntable(90, 80)), "turn.mp4")``.

    Parameters
    ----------
    images
        isowave.Image, or uint8 arrays (height, width, 3), all of one size, even along both axes.
    path
        A name that ends in .mp4.
    fps
        Pictures a second, 0.1 to 1000.

    Returns
    -------
    int
        Number of pictures.

    Raises
    ------
    Error
        There is no ffmpeg, it failed, or the file cannot be written.
    """
    target = pathlib.Path(os.path.realpath(os.fsdecode(path)))  # links stay links
    if target.suffix.lower() != ".mp4":
        raise ValueError(f"path={str(path)!r:.60}: movies are written as MP4: end the name in .mp4")
    rate = number("fps", fps)
    if not 0.1 <= rate <= 1000:
        raise ValueError(f"fps={rate:g}: give 0.1 to 1000")
    program = shutil.which("ffmpeg")
    if program is None:
        raise _core.Error(
            "movies need the program ffmpeg, which is not in PATH: install it, or save pictures "
            "with numbers in their names"
        )
    if not target.parent.is_dir() or (target.exists() and not target.is_file()):
        raise _core.Error(f"{path}: cannot write: it is no file in a folder")
    try:
        folder = tempfile.TemporaryDirectory(prefix=".isowave.", dir=target.parent)
    except OSError as error:
        raise _core.Error(f"{path}: cannot write: {error.strerror}") from None
    with folder as name:
        whole = pathlib.Path(name, "movie.mp4")
        count = encode(program, images, whole, rate)
        if target.exists():
            shutil.copymode(target, whole)
        whole.replace(target)
    return count


def encode(program: str, images: Iterable[Any], path: pathlib.Path, fps: float) -> int:
    """Has ffmpeg write all images to a new file. Returns how many they are."""
    ffmpeg: subprocess.Popen[bytes] | None = None
    shape: tuple[int, ...] = ()
    count = 0
    with tempfile.TemporaryFile() as errors:
        try:
            for image in images:
                pixels = pixels_of(image)
                if ffmpeg is None:
                    shape = pixels.shape
                    ffmpeg = start(program, shape, path, fps, errors)
                if pixels.shape != shape:
                    raise ValueError(
                        f"images: one is {pixels.shape[1]}x{pixels.shape[0]} pixels, the first "
                        f"{shape[1]}x{shape[0]}: a movie has one size"
                    )
                assert ffmpeg.stdin is not None
                try:
                    ffmpeg.stdin.write(pixels.data)
                except BrokenPipeError:
                    raise failure_of(ffmpeg, errors) from None
                count += 1
            if ffmpeg is None:
                raise ValueError("images: there is none")
            assert ffmpeg.stdin is not None
            with contextlib.suppress(BrokenPipeError):
                ffmpeg.stdin.close()
            # A full disk is an error that ffmpeg 5.1 tells, and yet it ends with status 0.
            if ffmpeg.wait() != 0 or errors.seek(0, os.SEEK_END) > 0:
                raise failure_of(ffmpeg, errors)
        finally:
            if ffmpeg is not None:
                end(ffmpeg)
    return count


def failure_of(ffmpeg: subprocess.Popen[bytes], errors: IO[bytes]) -> _core.Error:
    """The last line that ffmpeg wrote, or its exit status."""
    status = ffmpeg.wait()
    errors.seek(0)
    lines = errors.read().decode(errors="replace").split("\n")
    said = [line.strip() for line in lines if line.strip()]
    return _core.Error(f"ffmpeg failed: {said[-1] if said else f'its exit status is {status}'}")


def start(
    program: str, shape: tuple[int, ...], path: pathlib.Path, fps: float, errors: IO[bytes]
) -> subprocess.Popen[bytes]:
    height, width = shape[:2]
    if height % 2 or width % 2:
        raise ValueError(f"a movie of {width}x{height} pixels: give an even width and height")
    source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-video_size", f"{width}x{height}"]
    source += ["-framerate", f"{fps:.10g}", "-i", "pipe:0"]
    quiet = ["-nostdin", "-hide_banner", "-loglevel", "error", "-xerror", "-y"]
    return subprocess.Popen(
        [program, *quiet, *source, *ENCODING, f"file:{path}"],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=errors,
    )


def end(ffmpeg: subprocess.Popen[bytes]) -> None:
    """Ends the program if it still runs, as after an error."""
    if ffmpeg.poll() is None:
        ffmpeg.kill()
    assert ffmpeg.stdin is not None
    with contextlib.suppress(BrokenPipeError):
        ffmpeg.stdin.close()
    ffmpeg.wait()
