"""Annotations for the program: one without Cairo, as in wheels, has Pillow draw them here."""

from __future__ import annotations

import json
import os
import subprocess
import threading
from collections.abc import Sequence
from typing import Any, BinaryIO

import numpy as np

from isowave._annotate import draw
from isowave._core import Error

OPTIONS = {"render": {"--annotate", "--scene"}, "export": {"--scene"}}
"""Those of commands without which nothing is annotated, unless a scene is exported."""
VARIABLE = "ISOWAVE_ANNOTATOR"


def may_annotate(arguments: Sequence[str]) -> bool:
    command = arguments[0] if arguments else ""
    names = {text.partition("=")[0] for text in arguments}
    is_scene = command == "export" and any(text.endswith(".json") for text in arguments)
    return is_scene or not names.isdisjoint(OPTIONS.get(command, ()))


def start(command: Sequence[Any], reads_output: bool = False) -> subprocess.Popen[bytes]:
    """Starts the program, and a thread that draws for it: tools/isowave/annotator.hpp.

    reads_output  its `stdout` can be read; otherwise it goes where that of this process goes
    """
    questions, answers = os.pipe(), os.pipe()
    theirs = (questions[1], answers[0])
    variables = {**os.environ, VARIABLE: ":".join(f"/dev/fd/{end}" for end in theirs)}
    try:
        output = subprocess.PIPE if reads_output else None
        process = subprocess.Popen(command, stdout=output, pass_fds=theirs, env=variables)
    finally:
        for end in theirs:
            os.close(end)
    ours = (os.fdopen(questions[0], "rb"), os.fdopen(answers[1], "wb"))
    threading.Thread(target=answer, args=ours, name="isowave annotations", daemon=True).start()
    return process


def answer(questions: BinaryIO, answers: BinaryIO) -> None:
    """Draws over pictures until there are no more."""
    with questions, answers:
        while line := questions.readline():
            question = json.loads(line)
            width, height, channels = question["size"]
            pixels = questions.read(width * height * channels)
            if len(pixels) < width * height * channels:
                return
            picture = np.frombuffer(pixels, np.uint8).reshape(height, width, channels)
            try:
                reply = b"\n" + draw(picture, question["groups"]).tobytes()
            except (Error, OSError, ValueError, MemoryError) as error:
                reply = " ".join(f"{error}".split()).encode() + b"\n"
            try:
                answers.write(reply)
                answers.flush()
            except BrokenPipeError:  # the program has ended
                return
