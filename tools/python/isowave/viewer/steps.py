"""The steps of a series: which of their volumes are in memory."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Final

from isowave._source_file import SourceFile

from .interfaces import SeriesLike, VolumeLike
from .protocol import ProtocolError

STEP_SECONDS: Final = 1.0  # with a step, at most, while other clients wait for another one


def source_of(volume: object) -> dict[str, str] | None:
    """The file that a volume was opened from, as messages have it."""
    return plain_source(getattr(volume, "source", None))


def plain_source(source: SourceFile | None) -> dict[str, str] | None:
    return asdict(source) if isinstance(source, SourceFile) else None


class Steps:
    """The volumes of a series. Two are in memory at most: the one that is drawn, and another.

    A volume is a series of one step. All calls but those of the constructor need the scene's lock.

    source   a volume, or a series
    changed  the scene's lock; notified when a step was read
    do       works in another thread
    """

    def __init__(
        self,
        source: VolumeLike | SeriesLike,
        changed: threading.Condition,
        do: Callable[[Callable[[], None]], None],
    ) -> None:
        self._changed, self._do = changed, do
        self.names: list[str] | None = None  #: of a series, without folders
        self._series: SeriesLike | None = None
        if isinstance(source, SeriesLike):
            if len(source) == 0:
                raise ValueError("the series has no steps: give one with a step or more")
            self._series = source
            self.names = [Path(name).name for name in source.names]
        self.sources = [source_of(source)]  #: of each step
        if self._series is not None:
            find = getattr(source, "source", lambda step: None)
            self.sources = [plain_source(find(step)) for step in range(len(self._series))]
        first: VolumeLike = source[0] if isinstance(source, SeriesLike) else source
        self._volumes = {0: first}
        self._errors: dict[int, Exception] = {}  # of steps that could not be read
        self._reading: int | None = None
        self.drawn = 0  #: the step of the renderer
        #: The renderer stays for clients of its step until then; inf: it is being made.
        self.leave_at = math.inf
        self._ahead: int | None = None  # the step after, if steps are drawn in their order

    def __len__(self) -> int:
        return 1 if self._series is None else len(self._series)

    def check(self, step: int) -> None:
        """Raises ProtocolError: there is no such step."""
        if step >= len(self):
            raise ProtocolError(f"step must be an integer from 0 to {len(self) - 1}")

    @property
    def volume(self) -> VolumeLike:
        """The volume that is drawn."""
        return self._volumes[self.drawn]

    def may_draw(self, step: int) -> bool:
        """Whether the step was read, or could not be."""
        return step in self._volumes or step in self._errors

    def draw(self, step: int) -> None:
        """Goes to a step. Raises what reading it raised: the next call of read() tries again."""
        if error := self._errors.pop(step, None):
            raise error
        before, self.drawn = self.drawn, step
        after_next = (step + 1) % len(self)
        self._ahead = after_next if step == (before + 1) % len(self) else None

    def has_renderer(self, now: float) -> None:
        """The step's renderer was made, or could not be."""
        self.leave_at = now + STEP_SECONDS

    def read_ahead(self) -> None:
        """Has a thread read the next step, if steps are drawn in their order."""
        if self._ahead is not None and math.isfinite(self.leave_at):
            self.read(self._ahead)

    def read(self, step: int) -> None:
        """Has a thread read a step, unless it was read. One step is read at a time."""
        if self._series is None or self._reading is not None or self.may_draw(step):
            return
        self._volumes = {self.drawn: self.volume}  # the memory of the others goes before
        self._reading = step
        self._do(lambda: self._read(step))

    def _read(self, step: int) -> None:
        assert self._series is not None
        volume = error = None
        try:
            volume = self._series[step]
        except Exception as raised:  # of the library: the wish that waits for the step ends with it
            error = raised
        with self._changed:
            self._reading = None
            if volume is not None:
                self._volumes[step] = volume
            elif error is not None:
                self._errors[step] = error
            self._changed.notify_all()
