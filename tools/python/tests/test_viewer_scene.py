"""The scene's logic, step by step, without threads, with a clock that only tests move."""

from __future__ import annotations

import io
import threading
import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from PIL import Image
from viewer_fakes import Drawn, FakeVolume

from isowave import Camera
from isowave._request import Request
from isowave.viewer.pictures import Extent, Stopped, count_rays, dividing_value, encode_png
from isowave.viewer.pictures import fit_size, share_within
from isowave.viewer.protocol import Ack, Budget, ProtocolError, TokenBucket, Wish
from isowave.viewer.renderers import GIVE_BACK_SECONDS, MAX_CAMERA_RAYS
from isowave.viewer.scene import Scene
from isowave.viewer.session import Session
from isowave.viewer.turns import TURN_SECONDS, Client, Stage


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
        return self.client.stage not in (Stage.FIRST, Stage.WHOLE)

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
            due = [c.due for c in scene._turns.clients if c.stage is Stage.WHOLE]
            if not due:
                return
            clock = scene._clock
            assert isinstance(clock, Clock)
            clock.now = max(clock.now, min(due))
    raise AssertionError("the scene never rests")


def test_a_wish_is_drawn_small_then_whole_then_lossless() -> None:
    clock, volume = Clock(), FakeVolume()
    scene = make_scene(volume, clock)
    eye = Eye(scene)
    eye.wish()
    run(scene)
    eye.ack()
    assert eye.pictures == [(1, "first"), (1, "whole")]
    assert [f.size for f in volume.frames] == [(16, 12), (64, 48)]
    clock.now += 0.11  # not at rest yet
    run(scene)
    assert len(eye.pictures) == 2
    clock.now += 0.02
    run(scene)
    assert eye.pictures[2:] == [(1, "lossless")]
    assert not eye.of_type("bounds")
    clock.now += 0.5
    run(scene)
    assert len(eye.pictures) == 3
    assert volume.frames[-1].size == (16, 12)
    assert volume.frames[-1].request.outputs == ("depth", "bounds")
    # A pixel of the whole picture is a quarter of one of the first picture.
    assert [h["within_pixel"] for h in eye.of_type("bounds")] == [pytest.approx(2 / 3)]
    assert not eye.of_type("bounds")[0]["errors_are_stated"]
    frames = len(volume.frames)
    clock.now += 100
    run(scene)
    assert len(volume.frames) == frames


def test_whole_pictures_wait_for_wishes_that_are_on_their_way() -> None:
    clock, volume = Clock(), FakeVolume()

    def before_pass(drawn: Drawn) -> None:
        clock.now += 0.01 if drawn.size == (16, 12) else 0.3

    volume.before_pass = before_pass
    scene = make_scene(volume, clock)
    eye = Eye(scene)
    for i in range(5):
        eye.wish(80.0 + i)
        while scene.step():
            pass
        eye.ack()
        clock.now += 0.05
    assert {f.size for f in volume.frames} == {(16, 12)} and len(volume.frames) == 5
    clock.now += 0.05
    assert scene.step()
    assert volume.frames[-1].size == (64, 48)


def test_the_last_picture_is_lossless_to_the_bit() -> None:
    clock, volume = Clock(), FakeVolume()
    scene = make_scene(volume, clock)
    eye = Eye(scene)
    eye.wish()
    run(scene)
    eye.ack()
    clock.now += 1
    run(scene)
    drawn = volume.frames[-1]
    renderer = volume.renderer(device=None, size=(64, 48), samples=1)
    wish = wish_of(1, size=(64, 48)).request
    expected = renderer.draw(replace(wish, camera=drawn.request.camera))
    png = Image.open(io.BytesIO(eye.data[max(eye.data)]))
    assert png.format == "PNG"
    np.testing.assert_array_equal(np.asarray(png), expected.rgb)
    jpeg = Image.open(io.BytesIO(eye.data[1]))
    assert (jpeg.format, jpeg.size) == ("JPEG", (16, 12))


@pytest.mark.parametrize("stage_size", [(16, 12), (64, 48)])
def test_the_newest_wish_cancels_the_frame_at_hand(stage_size: tuple[int, int]) -> None:
    clock, volume = Clock(), FakeVolume(passes=5)
    scene = make_scene(volume, clock)
    eye = Eye(scene)

    def before_pass(drawn: Drawn) -> None:
        if drawn.size == stage_size and drawn.request.isovalue == 80 and drawn.passes == 2:
            eye.wish(90.0)

    volume.before_pass = before_pass
    eye.wish(80.0)
    run(scene)
    cancelled = [f for f in volume.frames if f.stopped]
    assert [(f.request.isovalue, f.size, f.passes) for f in cancelled] == [(80.0, stage_size, 3)]
    assert [f.request.isovalue for f in volume.frames][-2:] == [90.0, 90.0]
    # Nothing of the old wish after the new one's first picture.
    wishes = [wish for wish, _ in eye.pictures]
    assert wishes == sorted(wishes)


def test_wishes_that_come_faster_than_first_pictures_still_show_something() -> None:
    clock, volume = Clock(), FakeVolume(passes=4)
    scene = make_scene(volume, clock)
    eye = Eye(scene)

    def before_pass(drawn: Drawn) -> None:
        clock.now += 0.06
        if drawn.passes == 2 and eye.wishes < 20:
            eye.wish(80.0 + eye.wishes)
            eye.ack()

    volume.before_pass = before_pass
    eye.wish()
    run(scene)
    partial = [wish for wish, stage in eye.pictures if stage == "pass" and wish < 20]
    assert partial == list(range(1, 20))  # each was drawn for 0.18 s
    assert all(f.stopped for f in volume.frames if f.request.isovalue < 99)


def test_two_pictures_are_on_the_way_and_the_last_is_sent_on_the_ack() -> None:
    clock, volume = Clock(), FakeVolume(passes=10)
    scene = make_scene(volume, clock)
    eye = Eye(scene)

    def before_pass(drawn: Drawn) -> None:
        clock.now += 0.1

    volume.before_pass = before_pass
    for i in range(3):
        eye.wish(80.0 + i)
        run(scene)
    assert len(eye.data) == 2
    clock.now += 1
    run(scene)
    assert len(eye.data) == 2
    eye.scene.receive(eye.client, Ack(1))
    assert eye.pictures[-1] == (3, "lossless")
    assert len(eye.data) == 3
    eye.ack()
    run(scene)
    assert len(eye.data) == 3


def test_pictures_of_passes_are_sent_while_there_is_room() -> None:
    clock, volume = Clock(), FakeVolume(passes=6)
    scene = make_scene(volume, clock)
    eye = Eye(scene)

    def before_pass(drawn: Drawn) -> None:
        clock.now += 0.07
        eye.ack()

    volume.before_pass = before_pass
    eye.wish()
    run(scene)
    assert eye.pictures == [(1, "first"), *[(1, "pass")] * 6, (1, "whole")]
    assert not any(h["complete"] for h in eye.of_type("picture") if h["stage"] == "pass")


def test_clients_take_turns() -> None:
    clock, volume = Clock(), FakeVolume()
    scene = make_scene(volume, clock)
    eyes = [Eye(scene) for _ in range(3)]
    greedy = eyes[0]

    def before_pass(drawn: Drawn) -> None:
        # One client wishes all the time; the others get their pictures nevertheless.
        if drawn.request.isovalue == 1.0 and greedy.wishes < 30:
            greedy.wish(1.0)
            greedy.ack()

    volume.before_pass = before_pass
    for eye, isovalue in zip(eyes, (1.0, 2.0, 3.0)):
        eye.wish(isovalue)
    for _ in range(12):
        scene.step()
        clock.now += 0.04
    order = [f.request.isovalue for f in volume.frames]
    assert order[:3] == [1.0, 2.0, 3.0] and sorted(order[3:6]) == [1.0, 2.0, 3.0]
    for eye in eyes[1:]:
        assert eye.pictures[:2] == [(1, "first"), (1, "whole")]


def test_each_client_sees_its_own_state() -> None:
    clock, volume = Clock(), FakeVolume()
    scene = make_scene(volume, clock)
    eyes = [Eye(scene) for _ in range(3)]
    for i, eye in enumerate(eyes):
        eye.wish(50.0 * (i + 1), size=(40 + 8 * i, 40))
    run(scene)
    for i, eye in enumerate(eyes):
        heads = eye.of_type("picture")
        assert {h["isovalue"] for h in heads} == {50.0 * (i + 1)}
        assert heads[-1]["size"] == [40 + 8 * i, 40]


def test_a_long_whole_picture_gives_way_once_to_a_first_picture() -> None:
    clock, volume = Clock(), FakeVolume(passes=10)
    scene = make_scene(volume, clock)
    slow, quick = Eye(scene), Eye(scene)

    def before_pass(drawn: Drawn) -> None:
        clock.now += 0.1 if drawn.request.isovalue == 1.0 and drawn.size == (64, 48) else 0.0
        if drawn.request.isovalue == 1.0 and drawn.size == (64, 48) and drawn.passes == 3:
            if not quick.wishes:
                quick.wish(2.0)

    volume.before_pass = before_pass
    slow.wish(1.0)
    run(scene)
    frames = [(f.request.isovalue, f.size[0], f.stopped) for f in volume.frames]
    assert frames == [
        (1.0, 16, False),
        (1.0, 64, True),
        (2.0, 16, False),
        (1.0, 64, False),
        (2.0, 64, False),
    ]


def test_small_pictures_of_others_come_in_bounded_time_and_the_large_one_in_the_end() -> None:
    clock, volume = Clock(), FakeVolume(passes=200)
    scene = make_scene(volume, clock)
    slow, quick = Eye(scene), Eye(scene)
    asked, waits = 0.0, list[float]()

    def before_pass(drawn: Drawn) -> None:
        nonlocal asked
        clock.now += 0.1 if drawn.size == (96, 72) else 0.001
        slow.ack()
        quick.ack()
        # The other client wishes again and again, until it has had 12 whole pictures.
        if drawn.size == (96, 72) and quick.stage_done() and quick.wishes < 12:
            asked = clock.now
            quick.wish(2.0, size=(64, 48))
        if drawn.request.isovalue == 2.0 and drawn.size == (64, 48) and drawn.passes == 199:
            waits.append(clock.now - asked)

    volume.before_pass = before_pass
    slow.wish(1.0, size=(96, 72))
    run(scene)
    assert len(waits) == 12 and max(waits) <= 2 * TURN_SECONDS + 1
    assert sorted(waits)[0] < 1
    drawn = [f.passes for f in volume.frames if f.size == (96, 72)]
    assert drawn == sorted(drawn) and drawn[-1] == 200, "each time longer, at last the whole"
    assert (1, "whole") in slow.pictures


def test_lossless_pictures_do_not_wait_for_a_long_picture_of_others() -> None:
    clock, volume = Clock(), FakeVolume(passes=20)
    scene = make_scene(volume, clock)
    slow, other = Eye(scene), Eye(scene)

    def before_pass(drawn: Drawn) -> None:
        if drawn.size == (96, 72):
            clock.now += 0.1
            if drawn.passes == 19:
                assert (1, "lossless") in other.pictures

    volume.before_pass = before_pass
    other.wish()
    run(scene)
    other.ack()
    slow.wish(size=(96, 72))
    run(scene)
    assert [f.stopped for f in volume.frames if f.size == (96, 72)] == [False]


def test_pictures_of_the_same_size_do_not_interrupt_each_other() -> None:
    clock, volume = Clock(), FakeVolume(passes=50)
    scene = make_scene(volume, clock)
    eyes = [Eye(scene) for _ in range(3)]

    def before_pass(drawn: Drawn) -> None:
        clock.now += 0.1 if drawn.size == (64, 48) else 0.0

    volume.before_pass = before_pass
    for eye in eyes:
        eye.wish()
    run(scene)
    whole = [f for f in volume.frames if f.size == (64, 48)]
    assert [f.stopped for f in whole] == [False] * 3


def test_a_new_wish_cancels_a_frame_with_a_time_budget() -> None:
    clock, volume = Clock(), FakeVolume()
    scene = make_scene(volume, clock)
    eye = Eye(scene)

    def before_pass(frame: Drawn) -> None:
        if frame.request.isovalue == 80.0 and frame.passes == 1:
            eye.wish(81.0, time_budget=0.05)

    volume.before_pass = before_pass
    eye.wish(80.0, time_budget=0.05)
    run(scene)
    stopped = [
        (f.request.isovalue, f.stopped) for f in volume.frames if f.request.time_budget is not None
    ]
    assert stopped == [(80.0, True), (81.0, False)]


def test_quick_pictures_need_no_first_one() -> None:
    clock, volume = Clock(), FakeVolume()
    scene = make_scene(volume, clock)
    eye = Eye(scene)
    eye.wish(80.0)  # takes no time by this clock
    run(scene)
    eye.ack()
    eye.wish(81.0)
    run(scene)
    assert [s for w, s in eye.pictures if w == 2] == ["whole"]


def test_a_time_budget_needs_no_first_picture() -> None:
    clock, volume = Clock(), FakeVolume()
    scene = make_scene(volume, clock)
    eye = Eye(scene)
    eye.wish(80.0, time_budget=0.05)
    run(scene)
    assert [(f.size, f.request.time_budget, f.request.max_error) for f in volume.frames] == [
        ((64, 48), 0.05, None)
    ]
    eye.ack()
    eye.wish(80.0, max_error=0.5)
    run(scene)
    assert (volume.frames[-1].request.time_budget, volume.frames[-1].request.max_error) == (
        None,
        0.5,
    )


def test_the_surface_fills_the_picture_where_no_camera_is_given() -> None:
    clock, volume = Clock(), FakeVolume()
    scene = make_scene(volume, clock)
    eye = Eye(scene)
    eye.wish(80.0, size=(64, 48))
    run(scene)
    home = volume.renderer(device=None, size=(64, 48), samples=1).camera(80.0, (64, 48))
    assert volume.frames[0].request.camera == home == volume.frames[1].request.camera
    assert eye.of_type("picture")[0]["camera"]["eye"] == list(home.eye)
    eye.ack()
    eye.wish(80.0, size=(32, 64))  # narrow: further away
    run(scene)
    assert volume.frames[-1].request.camera.eye[2] > home.eye[2] + 1
    eye.ack()
    view = Camera((1, 2, 3), (0, 0, 0), (0, 1, 0), 30.0)
    eye.wish(80.0, camera=view)
    run(scene)
    assert volume.frames[-1].request.camera == Camera((1, 2, 3), (0, 0, 0), (0, 1, 0), 30.0)


def test_an_error_of_the_renderer_concerns_one_client() -> None:
    clock, volume = Clock(), FakeVolume()
    scene = make_scene(volume, clock)
    bad, good = Eye(scene), Eye(scene)

    def before_pass(drawn: Drawn) -> None:
        if drawn.request.isovalue == 13.0:
            raise RuntimeError("unlucky\nand long")

    volume.before_pass = before_pass
    bad.wish(13.0)
    good.wish(80.0)
    run(scene)
    assert [(h["wish"], h["message"]) for h in bad.of_type("error")] == [(1, "unlucky")]
    assert good.pictures == [(1, "first"), (1, "whole")] and not good.of_type("error")
    bad.wish(14.0)
    run(scene)
    assert bad.pictures == [(2, "first"), (2, "whole")]


def test_a_new_budget_makes_a_new_renderer_for_all() -> None:
    clock, volume = Clock(), FakeVolume()
    scene = make_scene(volume, clock)
    eyes = [Eye(scene), Eye(scene)]
    scene.receive(eyes[0].client, Budget(1 << 29))
    run(scene)
    assert [r["memory_budget"] for r in volume.renderers] == [None, 1 << 29]
    for eye in eyes:
        states = [(h["state"], h["memory_budget"]) for h in eye.of_type("status")]
        assert states == [("ready", None), ("starting", 1 << 29), ("ready", 1 << 29)]


def test_budgets_that_change_too_often_do_not_keep_others_from_their_pictures() -> None:
    clock, volume = Clock(), FakeVolume()
    scene = make_scene(volume, clock)
    eye, other = Eye(scene), Eye(scene)
    for i in range(100):
        scene.receive(eye.client, Budget((1 << 29) + i))
        scene.step()
    other.wish()
    run(scene)
    assert other.pictures == [(1, "first"), (1, "whole")] and not other.of_type("error")
    assert len(volume.renderers) == 1 + 5
    assert "changed too often" in eye.of_type("error")[-1]["message"]
    clock.now += GIVE_BACK_SECONDS
    scene.receive(eye.client, Budget(1 << 28))
    run(scene)
    assert volume.renderers[-1]["memory_budget"] == 1 << 28


def test_a_budget_that_is_too_small_leaves_the_old_one() -> None:
    def refuse(options: dict[str, Any]) -> Exception | None:
        too_small = options["memory_budget"] is not None and options["memory_budget"] < 1000
        return RuntimeError("needs 1000 bytes") if too_small else None

    clock, volume = Clock(), FakeVolume(refuse=refuse)
    scene = make_scene(volume, clock)
    eye = Eye(scene)
    scene.receive(eye.client, Budget(10))
    eye.wish()
    run(scene)
    assert [h["message"] for h in eye.of_type("error")] == ["needs 1000 bytes"]
    assert eye.of_type("status")[-1]["state"] == "ready"
    assert eye.of_type("status")[-1]["memory_budget"] is None
    assert eye.of_type("status")[-1]["notice"] == ""
    assert eye.pictures == [(1, "first"), (1, "whole")]


@pytest.mark.parametrize("works", [True, False])
def test_the_host_draws_while_the_device_is_prepared(works: bool) -> None:
    may_begin, changed, heads = threading.Event(), threading.Condition(), list[dict[str, Any]]()

    def refuse(options: dict[str, Any]) -> Exception | None:
        assert may_begin.wait(60)
        return None if works else RuntimeError("no device")

    def post(head: dict[str, Any], data: bytes | None) -> None:
        with changed:
            heads.append(head)
            changed.notify_all()
        if data is not None and client is not None:
            scene.receive(client, Ack(head["frame"]))

    def came(**wanted: Any) -> bool:
        def there() -> bool:
            return any(all(h.get(k) == v for k, v in wanted.items()) for h in heads)

        with changed:
            return changed.wait_for(there, 60)

    volume = FakeVolume(refuse=refuse)
    host = FakeVolume().renderer(device="host", size=(64, 48), samples=1)
    scene = Scene(volume, isovalue=80, size=(64, 48), make_host=lambda v: host)
    client = scene.join(post)
    assert client is not None
    scene.receive(client, wish_of(1))
    assert came(stage="lossless", wish=1)
    assert not [h for h in heads if h.get("state") in ("ready", "failed")] and not volume.frames
    may_begin.set()
    if works:
        # The pictures have the same bits: only what the host does not know is drawn again.
        assert came(type="bounds", wish=1)
        assert [f.request.outputs for f in volume.frames] == [("depth", "bounds")]
    else:
        assert came(type="error", message="no device")
        scene.receive(client, wish_of(2))
        assert came(type="error", message="no device", wish=2)
    scene.close()


def test_without_any_device_each_wish_says_why_until_a_budget_works() -> None:
    working = False

    def refuse(options: dict[str, Any]) -> Exception | None:
        return None if working else RuntimeError("no OpenCL device: pip install isowave[cpu]")

    clock, volume = Clock(), FakeVolume(refuse=refuse)
    scene = make_scene(volume, clock)
    eye = Eye(scene)
    eye.wish()
    run(scene)
    assert eye.of_type("status")[-1]["state"] == "failed"
    assert eye.of_type("error")[-1] == {
        "type": "error",
        "wish": 1,
        "message": "no OpenCL device: pip install isowave[cpu]",
    }
    working = True
    scene.receive(eye.client, Budget(None))
    eye.wish()
    run(scene)
    assert eye.pictures[-1] == (2, "whole")


def test_a_renderer_grows_with_the_pictures() -> None:
    clock, volume = Clock(), FakeVolume()
    scene = make_scene(volume, clock, size=(64, 48))
    eye = Eye(scene)
    eye.wish(size=(64, 48), samples=2)
    run(scene)
    assert [(r["size"], r["samples"]) for r in volume.renderers] == [((64, 48), 1), ((64, 48), 2)]
    assert (volume.frames[-1].size, volume.frames[-1].request.samples) == ((64, 48), 2)


def test_a_renderer_that_cannot_grow_draws_smaller_pictures() -> None:
    def refuse(options: dict[str, Any]) -> Exception | None:
        return RuntimeError("too large") if options["samples"] > 1 else None

    clock, volume = Clock(), FakeVolume(refuse=refuse)
    scene = make_scene(volume, clock, size=(64, 48))
    eye = Eye(scene)
    eye.wish(size=(64, 48), samples=2)
    run(scene)
    eye.ack()
    eye.wish(size=(64, 48), samples=2)
    run(scene)
    assert len(volume.renderers) == 3  # the first, the one too large, the first again
    assert (volume.frames[-1].size, volume.frames[-1].request.samples) == ((32, 24), 2)
    assert eye.of_type("picture")[-1]["reduced"] == (
        "The device has no memory for more: this picture has 32 x 24 pixels, 4 rays a pixel, "
        "0 ambient rays."
    )


def test_finished_pictures_say_if_the_isovalue_is_outside_the_values() -> None:
    scene = make_scene(FakeVolume(), Clock(), size=(64, 48))
    eye = Eye(scene)
    for isovalue, notice in ((300.0, "isovalue 300 is outside."), (100.0, "")):
        eye.wish(size=(64, 48), isovalue=isovalue)
        run(scene)
        eye.ack()
        assert eye.of_type("picture")[-1]["stage"] in ("whole", "lossless")
        assert eye.of_type("picture")[-1]["notice"] == notice


def test_whole_pictures_have_ambient_rays_and_a_renderer_for_them() -> None:
    clock, volume = Clock(), FakeVolume()
    scene = make_scene(volume, clock, size=(64, 48))
    eye = Eye(scene)
    eye.wish(size=(64, 48), ambient=16)
    run(scene)
    assert [r["rays"] for r in volume.renderers] == [False, True]
    drawn = [(frame.size, frame.request.ambient) for frame in volume.frames]
    assert drawn == [((16, 12), 0), ((64, 48), 16)], "none in the first picture"
    eye.ack()
    eye.wish(81.0, size=(64, 48))
    run(scene)
    assert volume.frames[-1].request.ambient == 0 and len(volume.renderers) == 2


def test_without_memory_for_ambient_rays_pictures_have_none() -> None:
    def refuse(options: dict[str, Any]) -> Exception | None:
        return RuntimeError("too large") if options["rays"] else None

    clock, volume = Clock(), FakeVolume(refuse=refuse)
    scene = make_scene(volume, clock, size=(64, 48))
    eye = Eye(scene)
    for isovalue in (80.0, 81.0):
        eye.wish(isovalue, size=(64, 48), ambient=16)
        run(scene)
        eye.ack()
        assert volume.frames[-1].request.ambient == 0
    assert [r["rays"] for r in volume.renderers] == [False, True, False], "not tried again"
    scene.receive(eye.client, Budget(1 << 30))
    eye.wish(82.0, size=(64, 48), ambient=16)
    run(scene)
    assert volume.renderers[-2]["rays"], "tried again with another budget"


@pytest.mark.parametrize(
    "wish",
    [
        dict(size=(8192, 8192)),
        dict(size=(8192, 8192), ambient=255),
        dict(size=(8192, 8192), samples=8, ambient=255),
        dict(size=(8192, 1), samples=8, ambient=255),
        dict(size=(40, 40), ambient=255),
    ],
)
def test_no_picture_has_more_rays_than_the_server_allows(wish: dict[str, Any]) -> None:
    clock, volume = Clock(), FakeVolume()
    limit = 20_000
    scene = make_scene(volume, clock, size=(64, 48), max_rays=limit)
    eye = Eye(scene)
    eye.wish(**wish)
    run(scene)
    eye.ack()
    clock.now += 0.2
    run(scene)
    clock.now += 1
    run(scene)
    assert eye.of_type("picture")[-1]["stage"] == "lossless" and not eye.of_type("error")
    for frame in volume.frames:
        rays = frame.size[0] * frame.size[1] * frame.request.samples**2
        assert 0 < rays * (1 + frame.request.ambient) <= limit
    for made in volume.renderers:
        assert made["size"][0] * made["size"][1] * made["samples"] ** 2 <= limit
    for head in eye.of_type("picture")[-2:]:
        drawn = next(f for f in reversed(volume.frames) if f.request.outputs == ("rgb",))
        assert (head["size"], head["ambient"]) == (list(drawn.size), drawn.request.ambient)
        assert head["reduced"].startswith("The server draws at most 20,000 rays, 20,000 from")
        assert f"{drawn.size[0]} x {drawn.size[1]} pixels" in head["reduced"]
        assert f", {drawn.request.ambient} ambient ray" in head["reduced"]


def test_pictures_within_the_limits_are_drawn_as_they_are() -> None:
    clock, volume = Clock(), FakeVolume()
    scene = make_scene(volume, clock, size=(64, 48), max_rays=64 * 48 * 4 * 17)
    eye = Eye(scene)
    eye.wish(samples=2, ambient=16)
    run(scene)
    assert (volume.frames[-1].request.samples, volume.frames[-1].request.ambient) == (2, 16)
    assert all(head["reduced"] is None for head in eye.of_type("picture"))


def test_camera_rays_have_a_limit_of_their_own() -> None:
    """Each takes memory of the device. The pictures are not drawn: they would take too long."""
    scene = make_scene(FakeVolume(), Clock())
    eye = Eye(scene)
    eye.wish(size=(8192, 8192), ambient=255)
    assert eye.client.wish is not None
    plan = scene._renderers.plan(eye.client.wish)
    assert 0.99 * MAX_CAMERA_RAYS < plan.rays <= MAX_CAMERA_RAYS and plan.ambient == 7
    owner = make_scene(FakeVolume(), Clock(), size=(8000, 8000))
    assert owner._renderers.plan(eye.client.wish).rays == 64_000_000, "the server's own size counts"


@pytest.mark.parametrize("option", ["max_rays", "max_clients"])
def test_limits_below_1_are_refused(option: str) -> None:
    with pytest.raises(ValueError, match=f"{option} 0: give 1 or more"):
        Scene(FakeVolume(), start=False, **{option: 0})  # type: ignore[arg-type]


@pytest.mark.parametrize("goes", ["leaves", "wants less"])
@pytest.mark.parametrize("wish", [dict(size=(128, 96)), dict(samples=2), dict(ambient=8)])
def test_memory_goes_back_when_it_is_not_needed_any_more(goes: str, wish: dict[str, Any]) -> None:
    clock, volume = Clock(), FakeVolume()
    scene = make_scene(volume, clock, size=(64, 48))
    eye, other = Eye(scene), Eye(scene)
    eye.wish(**wish)
    other.wish()
    run(scene)
    clock.now += 100
    run(scene)
    assert len(volume.renderers) == 2, "a client that rests still needs it"
    if goes == "leaves":
        scene.leave(eye.client)
    else:
        eye.wish()
    run(scene)
    clock.now += GIVE_BACK_SECONDS - 1
    run(scene)
    assert len(volume.renderers) == 2, "it may be needed again"
    clock.now += 2
    run(scene)
    assert len(volume.renderers) == 3 and volume.renderers[2] == volume.renderers[0]
    clock.now += 100
    run(scene)
    assert len(volume.renderers) == 3
    other.ack()
    other.wish(90.0)
    run(scene)
    assert other.pictures[-1] == (2, "whole")


def test_a_large_renderer_stays_for_those_who_still_need_it() -> None:
    clock, volume = Clock(), FakeVolume()
    scene = make_scene(volume, clock, size=(64, 48))
    eyes = [Eye(scene), Eye(scene)]
    for eye in eyes:
        eye.wish(samples=2)
        run(scene)
    scene.leave(eyes[0].client)
    clock.now += 100
    run(scene)
    assert len(volume.renderers) == 2
    eyes[1].wish()
    clock.now += 1
    run(scene)
    eyes[1].wish(samples=2)
    clock.now += 100
    run(scene)
    assert len(volume.renderers) == 2, "it was needed again in time"


def test_an_encoding_stops_when_its_picture_is_not_wanted_any_more() -> None:
    rgb = np.random.default_rng(3).integers(0, 256, (400, 400, 3), np.uint8)
    assert encode_png(rgb, lambda: True).startswith(b"\x89PNG")
    asked = iter([True, True, False])
    with pytest.raises(Stopped):
        encode_png(rgb, lambda: next(asked))


def test_an_extent_shrinks_by_its_pixels_first() -> None:
    extent = Extent((100, 50), 2, 9)
    assert (extent.rays, extent.all_rays) == (20_000, 200_000)
    assert extent.within(20_000, 200_000) == extent
    assert extent.within(5_000, 200_000) == Extent((50, 25), 2, 9)
    assert extent.within(20_000, 100_000) == Extent((100, 50), 2, 4)
    assert extent.within(20_000, 5_000) == Extent((50, 25), 2, 0)


@pytest.mark.parametrize("what", ["before_pass", "refuse"])
def test_closing_does_not_wait_for_a_long_pass_or_compilation(what: str) -> None:
    began, may_end = threading.Event(), threading.Event()

    def hold(_: Any) -> None:
        began.set()
        assert may_end.wait(60)

    volume = FakeVolume(**{what: hold})  # type: ignore[arg-type]
    scene = Scene(volume, isovalue=80, make_host=lambda v: None)
    Eye(scene).wish()
    assert began.wait(60)
    scene.close()  # returns although the pass or the compilation does not end before
    assert scene.is_busy
    may_end.set()
    latest = time.monotonic() + 60
    while scene.is_busy and time.monotonic() < latest:  # a thread may begin another one
        time.sleep(0.005)
    assert not scene.is_busy and scene._renderers.renderer is None


def test_others_get_pictures_while_a_larger_renderer_is_made() -> None:
    may_end, changed, shown = threading.Event(), threading.Condition(), list[str]()

    def refuse(options: dict[str, Any]) -> Exception | None:
        with changed:
            changed.notify_all()
        assert not options["rays"] or may_end.wait(60)
        return None

    def post(head: dict[str, Any], data: bytes | None) -> None:
        with changed:
            shown.append(head.get("stage", head["type"]))
            changed.notify_all()

    volume = FakeVolume(refuse=refuse)
    host = FakeVolume().renderer(device="host", size=(64, 48), samples=1, rays=True)
    scene = Scene(volume, isovalue=80, make_host=lambda v: host)
    large, other = scene.join(lambda head, data: None), scene.join(post)
    assert large is not None and other is not None
    scene.receive(large, wish_of(1, ambient=8))
    with changed:
        assert changed.wait_for(lambda: len(volume.renderers) == 2, 60)
    scene.receive(other, wish_of(1))
    with changed:
        assert changed.wait_for(lambda: "whole" in shown, 60)
    may_end.set()
    scene.close()


def test_the_device_overtakes_the_host() -> None:
    may_end, done = threading.Event(), threading.Event()

    def refuse(options: dict[str, Any]) -> Exception | None:
        assert may_end.wait(60)
        return None

    def before_host_pass(drawn: Drawn) -> None:
        """It would take 100 seconds."""
        may_end.set()
        threading.Event().wait(0.005)

    def post(head: dict[str, Any], data: bytes | None) -> None:
        if head.get("stage") == "whole":
            done.set()

    volume, by_host = FakeVolume(refuse=refuse), FakeVolume(20_000, before_host_pass)
    host = by_host.renderer(device="host", size=(64, 48), samples=1, rays=True)
    scene = Scene(volume, isovalue=80, make_host=lambda v: host)
    client = scene.join(post)
    assert client is not None
    scene.receive(client, wish_of(1, time_budget=1.0))  # within a time: without a first picture
    assert done.wait(60)
    assert [f.stopped for f in by_host.frames] == [True]
    assert [f.stopped for f in volume.frames if f.request.outputs == ("rgb",)] == [False]
    scene.close()


def test_the_first_isovalue_divides_the_histogram() -> None:
    clock, volume = Clock(), FakeVolume()
    scene = make_scene(volume, clock, isovalue=None)
    eye = Eye(scene)
    assert 0 < eye.of_type("welcome")[0]["isovalue"] < 255
    assert len(eye.of_type("histogram")[0]["counts"]) == 256


def test_infinite_ranges_are_those_of_the_histogram() -> None:
    clock, volume = Clock(), FakeVolume(value_range=(float("-inf"), float("inf")))
    eye = Eye(make_scene(volume, clock))
    assert eye.of_type("welcome")[0]["range"] == [0.0, 255.0]


def test_who_joins_early_is_welcomed_when_the_volume_is_known() -> None:
    volume = FakeVolume()
    scene = Scene(volume, clock=Clock(), start=False, isovalue=3)
    eye = Eye(scene)
    assert [h["type"] for h in eye.heads] == ["status"]
    run(scene)
    assert [h["type"] for h in eye.heads] == ["status", "welcome", "status", "status", "histogram"]


def test_wish_numbers_grow_and_acks_are_of_sent_pictures() -> None:
    scene = make_scene(FakeVolume(), Clock())
    eye = Eye(scene)
    eye.wish()
    eye.wishes = 0
    with pytest.raises(ProtocolError, match="must grow"):
        eye.wish()
    with pytest.raises(ProtocolError, match="not sent"):
        scene.receive(eye.client, Ack(1))


def test_a_client_that_leaves_stops_its_frame_and_is_forgotten() -> None:
    clock, volume = Clock(), FakeVolume(passes=9)
    scene = make_scene(volume, clock)
    eye = Eye(scene)

    def before_pass(drawn: Drawn) -> None:
        if drawn.passes == 1:
            scene.leave(eye.client)

    volume.before_pass = before_pass
    eye.wish()
    run(scene)
    assert [(f.stopped, f.passes) for f in volume.frames] == [(True, 2)]
    assert scene.num_clients == 0 and not eye.data


def test_a_client_whose_transport_fails_is_forgotten() -> None:
    scene = make_scene(FakeVolume(), Clock())
    works = True

    def post(head: dict[str, Any], data: bytes | None) -> None:
        if not works:
            raise RuntimeError("the loop is closed")

    client = scene.join(post)
    assert client is not None
    works = False
    other = Eye(scene)
    scene.receive(client, wish_of(1))
    other.wish()
    run(scene)
    assert scene.num_clients == 1
    assert other.pictures[-1] == (1, "whole")


def test_there_are_at_most_so_many_clients() -> None:
    scene = make_scene(FakeVolume(), Clock(), max_clients=2)
    sessions = [Session(scene, lambda head, data: None) for _ in range(3)]
    hello = {"type": "hello", "version": 2}
    sessions[0].receive(hello)
    sessions[1].receive(hello)
    with pytest.raises(ProtocolError, match="too many clients"):
        sessions[2].receive(hello)
    sessions[0].close()
    Session(scene, lambda head, data: None).receive(hello)


def test_sessions_begin_with_hello_and_limit_the_rate() -> None:
    scene, clock = make_scene(FakeVolume(), Clock()), Clock()
    session = Session(scene, lambda head, data: None, rate=10, burst=3, clock=clock)
    with pytest.raises(ProtocolError, match="must be hello"):
        session.receive({"type": "ack", "frame": 0})
    session.receive({"type": "hello", "version": 2})
    session.receive({"type": "ack", "frame": 0})
    with pytest.raises(ProtocolError, match="too many messages"):
        session.receive({"type": "ack", "frame": 0})
    clock.now += 0.15
    session.receive({"type": "ack", "frame": 0})
    session.close()
    assert scene.num_clients == 0


def test_a_bucket_never_holds_more_than_its_burst() -> None:
    clock = Clock()
    bucket = TokenBucket(1, 2, clock)
    clock.now += 1000
    assert [bucket.take() for _ in range(3)] == [True, True, False]


def test_100_reconnects_leave_nothing() -> None:
    threads = threading.active_count()
    volume = FakeVolume()
    scene = Scene(volume, isovalue=80, size=(64, 48))
    ready = threading.Event()

    def post(head: dict[str, Any], data: bytes | None) -> None:
        if head["type"] == "picture":
            ready.set()

    for i in range(100):
        session = Session(scene, post)
        session.receive({"type": "hello", "version": 2})
        wish = {"type": "wish", "id": 1, "isovalue": 80, "size": [32, 32], "camera": None}
        wish |= {"color": [1, 1, 1], "background": [0, 0, 0], "samples": 1}
        session.receive(wish | {"max_error": None, "time_budget": None, "ambient": 0})
        if i % 10 == 0:
            assert ready.wait(60)
        ready.clear()
        session.close()
    assert scene.num_clients == 0
    scene.close()
    for thread in scene._threads:
        thread.join(60)
    assert threading.active_count() == threads
    assert len(volume.renderers) == 1


@pytest.mark.parametrize("rays", [1, 2, 7, 100, 12345])
@pytest.mark.parametrize("size", [(1, 1), (8192, 1), (1, 8192), (1280, 720), (33, 77)])
@pytest.mark.parametrize("samples", [1, 3])
def test_sizes_fit(size: tuple[int, int], samples: int, rays: int) -> None:
    fitted = fit_size(size, samples, rays)
    assert min(fitted) >= 1 and fitted[0] <= size[0] and fitted[1] <= size[1]
    assert count_rays(fitted, samples) <= max(rays, samples**2)


def test_the_share_of_rays_within_a_bound() -> None:
    inf = np.inf
    depth = np.array([inf, inf, 5, 5, 5], np.float32)
    bounds = np.array([0, inf, 0.5, 0.25, inf], np.float32)
    assert share_within(depth, bounds, 0.25) == 0.25
    assert share_within(depth, bounds, 1) == 0.5
    assert share_within(depth[:1], bounds[:1], 1) is None


def test_the_dividing_value_is_between_two_peaks() -> None:
    counts = [0, 9, 10, 9, 0, 0, 0, 0, 4, 5, 4, 0]
    assert 4.0 <= dividing_value(counts, 0.0, 12.0) <= 8.0
    assert dividing_value([0, 0], 1.0, 3.0) == 2.0
    assert dividing_value([5], 1.0, 3.0) == 2.0
