"""A scene without threads, with a clock that only tests move, and clients of it."""

from __future__ import annotations

from typing import Any

from viewer_fakes import FakeVolume

from isowave._request import Request
from isowave.viewer.protocol import Ack, Wish
from isowave.viewer.scene import Scene
from isowave.viewer.turns import DRAWN, Client, Stage


class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def wish_of(
    wish_id: int, isovalue: float = 80.0, size: tuple[int, int] = (32, 32), **more: Any
) -> Wish:
    colors: dict[str, Any] = {"color": (1, 0.5, 0), "background": (1, 1, 1)}
    return Wish(wish_id, Request(isovalue, size=size, outputs=("rgb",), **colors | more))


class Eye:
    """A client and all that it was sent."""

    def __init__(self, scene: Scene) -> None:
        self.scene, self.heads = scene, list[dict[str, Any]]()
        self.data: dict[int, bytes] = {}
        client = scene.join(self._post)
        assert client is not None
        self.client: Client = client
        self.wishes = 0

    def _post(self, head: dict[str, Any], data: bytes | None) -> None:
        self.heads.append(head)
        if data is not None:
            self.data[head["frame"]] = data

    def wish(self, isovalue: float = 80.0, size: tuple[int, int] = (64, 48), **more: Any) -> int:
        self.wishes += 1
        self.scene.receive(self.client, wish_of(self.wishes, isovalue, size, **more))
        return self.wishes

    def stage_done(self) -> bool:
        """Whether nothing is to be drawn for it before it has rested."""
        return self.client.stage not in DRAWN

    def ack(self) -> None:
        """Acknowledges all that came."""
        if self.data:
            self.scene.receive(self.client, Ack(max(self.data)))

    @property
    def pictures(self) -> list[tuple[int, str]]:
        return [(h["wish"], h["stage"]) for h in self.heads if h["type"] == "picture"]

    def of_type(self, kind: str) -> list[dict[str, Any]]:
        return [h for h in self.heads if h["type"] == kind]


def make_scene(volume: FakeVolume, clock: Clock, **options: Any) -> Scene:
    options = dict(isovalue=80.0, size=(640, 480)) | options
    scene = Scene(volume, clock=clock, start=False, **options)
    scene.step()  # prepares
    scene.step()  # makes the renderer
    return scene


def run(scene: Scene) -> None:
    """Until nothing is to be done but for clients at rest."""
    for _ in range(1000):
        if not scene.step():
            due = [c.due for c in scene._turns.clients if c.stage in (Stage.SHARP, Stage.WHOLE)]
            if not due:
                return
            clock = scene._clock
            assert isinstance(clock, Clock)
            clock.now = max(clock.now, min(due))
    raise AssertionError("the scene never rests")
