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
from viewer_fakes import PLAIN_WISH, Drawn, FakeVolume
from viewer_scenes import Clock, Eye, make_scene, run, wish_of

from isowave import Camera
from isowave.viewer.protocol import VERSION, Ack, ProtocolError, TokenBucket
from isowave.viewer.scene import Scene
from isowave.viewer.session import Session
from isowave.viewer.turns import TURN_SECONDS


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


@pytest.mark.parametrize("pass_seconds, period", [(0.0, 0.05), (0.3, 0.05), (0.025, 0.02)])
def test_whole_pictures_wait_for_wishes_on_their_way(pass_seconds: float, period: float) -> None:
    clock, volume = Clock(), FakeVolume()

    def before_pass(drawn: Drawn) -> None:
        clock.now += 0.01 if drawn.size == (16, 12) else pass_seconds

    volume.before_pass = before_pass
    scene = make_scene(volume, clock)
    eye = Eye(scene)
    if pass_seconds != 0:  # else there is no whole picture before
        eye.wish()
        run(scene)
        eye.ack()
    assert 0.02 < eye.client.whole_seconds and (eye.client.whole_seconds < 0.1) == (period < 0.05)
    drawn = len(volume.frames)
    for i in range(5):
        eye.wish(80.0 + i)
        while scene.step():
            pass
        eye.ack()
        clock.now += period
    assert [f.size for f in volume.frames[drawn:]] == [(16, 12)] * 5
    clock.now += period
    assert scene.step() and volume.frames[-1].size == (64, 48)


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
            eye.wish(81.0, time_budget_ms=50)

    volume.before_pass = before_pass
    eye.wish(80.0, time_budget_ms=50)
    run(scene)
    stopped = [
        (f.request.isovalue, f.stopped)
        for f in volume.frames
        if f.request.time_budget_ms is not None
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
    eye.wish(80.0, time_budget_ms=50)
    run(scene)
    assert [
        (f.size, f.request.time_budget_ms, f.request.max_surface_error) for f in volume.frames
    ] == [((64, 48), 50, None)]
    eye.ack()
    eye.wish(80.0, max_surface_error=0.5)
    run(scene)
    assert (
        volume.frames[-1].request.time_budget_ms,
        volume.frames[-1].request.max_surface_error,
    ) == (
        None,
        0.5,
    )


def test_the_volume_fills_the_picture_where_no_camera_is_given() -> None:
    clock, volume = Clock(), FakeVolume()
    scene = make_scene(volume, clock)
    eye = Eye(scene)
    eye.wish(80.0, size=(64, 48))
    run(scene)
    home = volume.renderer(device=None, size=(64, 48), samples=1).camera(size=(64, 48))
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


@pytest.mark.parametrize("what", ["before_pass", "refuse"])
def test_closing_does_not_wait_for_a_long_pass_or_compilation(what: str) -> None:
    began, may_end = threading.Event(), threading.Event()

    def hold(_: Any) -> None:
        began.set()
        assert may_end.wait(60)

    volume = FakeVolume(**{what: hold})  # type: ignore[arg-type]
    scene = Scene(volume, isovalue=80, make_host=lambda v, f, d: None)
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
    scene = Scene(volume, isovalue=80, make_host=lambda v, f, d: host)
    large, other = scene.join(lambda head, data: None), scene.join(post)
    assert large is not None and other is not None
    scene.receive(large, wish_of(1, ambient_rays=8))
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
    scene = Scene(volume, isovalue=80, make_host=lambda v, f, d: host)
    client = scene.join(post)
    assert client is not None
    scene.receive(client, wish_of(1, time_budget_ms=1000))  # within a time: without a first picture
    assert done.wait(60)
    assert [f.stopped for f in by_host.frames] == [True]
    assert [f.stopped for f in volume.frames if "rgb" in f.request.outputs] == [False]
    scene.close()


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
    hello = {"type": "hello", "version": VERSION}
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
    session.receive({"type": "hello", "version": VERSION})
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
        session.receive({"type": "hello", "version": VERSION})
        session.receive(PLAIN_WISH)
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
