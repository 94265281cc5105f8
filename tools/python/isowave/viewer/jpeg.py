"""JPEG files, encoded in strips by several threads.

A strip is a file of its own, with the same tables as all others. A restart marker ends what an
encoder remembers, so the data of all strips with restart markers between them are the data of one
file (ITU-T T.81, annexes B and E).
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Final

import numpy as np
import simplejpeg
from numpy.typing import NDArray

QUALITY: Final = 70

# Pixels of a unit that is encoded at a time (MCU), with half of the rows and columns of color.
UNIT: Final = 16
# Rows of units in a strip at least: a thread costs some ten microseconds.
LEAST_UNITS: Final = 4
# A restart interval has 16 bits [MCU].
MOST_INTERVAL: Final = 0xFFFF

SOF0, DRI, SOS, RST0 = 0xC0, 0xDD, 0xDA, 0xD0


def encode_jpeg(rgb: NDArray[np.uint8]) -> bytes:
    """rgb: uint8 [h, w, 3]."""
    rows = rows_of_strip(rgb.shape[0], rgb.shape[1], os.cpu_count() or 1)
    strips = [rgb[first : first + rows] for first in range(0, rgb.shape[0], rows)]
    if len(strips) == 1:
        return encode_strip(rgb)
    files = list(threads().map(encode_strip, strips))
    interval = -(-rgb.shape[1] // UNIT) * (rows // UNIT)
    return join_strips(files, rgb.shape[0], interval)


def rows_of_strip(height: int, width: int, num_threads: int) -> int:
    """Rows of every strip but the last, a multiple of UNIT."""
    units = -(-height // UNIT)
    of_strip = max(-(-units // num_threads), LEAST_UNITS)
    return min(of_strip, MOST_INTERVAL // -(-width // UNIT)) * UNIT


def encode_strip(rgb: NDArray[np.uint8]) -> bytes:
    """A file. Other threads of Python go on meanwhile."""
    pixels = np.ascontiguousarray(rgb)
    return bytes(
        simplejpeg.encode_jpeg(
            pixels, quality=QUALITY, colorspace="RGB", colorsubsampling="420", fastdct=False
        )
    )


def join_strips(files: list[bytes], height: int, interval: int) -> bytes:
    """The file of all strips.

    height    of the picture [pixels]
    interval  MCU of each strip but the last
    """
    parts = [head_with(files[0], height, interval)]
    for number, file in enumerate(files):
        if number > 0:
            parts.append(bytes([0xFF, RST0 + (number - 1) % 8]))
        parts.append(file[end_of_head(file) : -2])
    return b"".join([*parts, files[0][-2:]])


def head_with(file: bytes, height: int, interval: int) -> bytes:
    """What comes before a file's data, for another height and with restarts."""
    head = bytearray(file[: end_of_head(file)])
    for marker, begin in segments(file):
        if marker == SOF0:
            struct.pack_into(">H", head, begin + 5, height)
        elif marker == SOS:
            head[begin:begin] = struct.pack(">BBHH", 0xFF, DRI, 4, interval)
    return bytes(head)


def segments(file: bytes) -> Iterator[tuple[int, int]]:
    """Yields the marker and the first byte of each segment before the data; SOS is the last."""
    begin, marker = 2, 0
    while marker != SOS:
        marker = file[begin + 1]
        yield marker, begin
        begin += 2 + int.from_bytes(file[begin + 2 : begin + 4], "big")


def end_of_head(file: bytes) -> int:
    """The first byte of the data."""
    *_, (_, begin) = segments(file)
    return begin + 2 + int.from_bytes(file[begin + 2 : begin + 4], "big")


@cache
def threads() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(thread_name_prefix="isowave-jpeg")
