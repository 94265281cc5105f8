"""Bars that show how far compression or a frame is."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator
from typing import Any

from isowave._checked import flag

#: Called with a step's name ("compressing") and how much of the step is done, 0 to 1.
Progress = Callable[[str, float], object]

QUIET_SECONDS = 2  # without a bar; what ends before has none


class TqdmProgress:
    """A bar of tqdm's for each step that takes longer than QUIET_SECONDS."""

    def __init__(self, tqdm: Any) -> None:
        self.tqdm, self.bar, self.step = tqdm, None, ""

    def __call__(self, what: str, done: float) -> None:
        if what != self.step:
            self.close()
            self.step = what
            more = {"unit": "%", "leave": False, "delay": QUIET_SECONDS}
            self.bar = self.tqdm(total=100, desc=what, **more)
        if self.bar is not None:
            self.bar.update(max(0, int(100 * done) - self.bar.n))

    def close(self) -> None:
        if self.bar is not None:
            self.bar.close()


def make_progress(progress: bool | Progress | None) -> Progress | None:
    """The function to call. progress=None: a bar on a terminal or in a notebook, with tqdm."""
    if callable(progress):
        return progress
    if progress is not None:
        flag("progress", progress)
    in_notebook = "ipykernel" in sys.modules
    if progress is False or (progress is None and not (sys.stderr.isatty() or in_notebook)):
        return None
    try:
        from tqdm.auto import tqdm  # type: ignore[import-untyped,unused-ignore]
    except ImportError:
        return None
    return TqdmProgress(tqdm)


@contextlib.contextmanager
def shown(progress: bool | Progress | None) -> Iterator[Progress | None]:
    """The function to call with progress; closes its bar at the end."""
    told = make_progress(progress)
    try:
        yield told
    finally:
        if isinstance(told, TqdmProgress):
            told.close()
