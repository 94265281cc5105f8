"""Renderers of a scene: budgets, memory, and limits, step by step; and its thread."""

from __future__ import annotations

import math
import threading
from typing import Any

import numpy as np
import pytest
from conftest import FUEL
from viewer_fakes import FakeVolume
from viewer_scenes import Clock, Eye, make_scene, run, wish_of

import isowave
from isowave import ClipPlane, ColorMap
from isowave._request import Request
from isowave.viewer.protocol import Ack, Budget
from isowave.viewer.renderers import GIVE_BACK_SECONDS, MAX_CAMERA_RAYS, make_host
from isowave.viewer.scene import CERTAIN_SECONDS, REST_SECONDS, Scene
from isowave.viewer.turns import Client


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
    scene = Scene(volume, isovalue=80, size=(64, 48), make_host=lambda v, f, d: host)
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


def test_on_a_machine_without_a_gpu_the_host_draws_all_of_a_wish() -> None:
    clock, volume = Clock(), FakeVolume(on_host=True)
    scene = make_scene(volume, clock)
    eye = Eye(scene)
    assert [h["state"] for h in eye.of_type("status")] == ["ready"]
    status = eye.of_type("status")[-1]
    assert (status["device"], status["device_memory"], status["notice"]) == ("host", None, "")
    eye.wish(80.0, size=(1600, 1200), ambient_rays=2, max_surface_error=0.5, time_budget_ms=5000)
    run(scene)
    clock.now += REST_SECONDS
    run(scene)
    clock.now += CERTAIN_SECONDS
    eye.ack()
    run(scene)
    whole = volume.frames[0]
    assert (whole.size, whole.request.ambient_rays) == ((1600, 1200), 2)
    assert (whole.request.max_surface_error, whole.request.time_budget_ms) == (0.5, 5000)
    assert eye.pictures == [(1, "whole"), (1, "lossless")]
    assert eye.of_type("picture")[0]["reduced"] is None
    assert eye.of_type("bounds")[-1]["within_pixel"] > 0
    clock.now += 2 * GIVE_BACK_SECONDS
    run(scene)
    assert len(volume.renderers) == 1, "no picture is too large for the host"
    scene.receive(eye.client, Budget(1 << 29))
    run(scene)
    assert [r["memory_budget"] for r in volume.renderers] == [None, 1 << 29]


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


def test_a_renderer_that_cannot_grow_draws_fewer_rays() -> None:
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
    assert (volume.frames[-1].size, volume.frames[-1].request.samples) == ((64, 48), 1)
    eye.ack()
    assert eye.of_type("picture")[-1]["reduced"] == (
        "The device has no memory for more: this picture has 64 x 48 pixels, 1 ray a pixel, "
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
    eye.wish(size=(64, 48), ambient_rays=16)
    run(scene)
    assert [r["rays"] for r in volume.renderers] == [False, True]
    drawn = [(frame.size, frame.request.ambient_rays) for frame in volume.frames]
    assert drawn == [((16, 12), 0), ((64, 48), 0), ((64, 48), 16)], "none before it is sharp"
    eye.ack()
    eye.wish(81.0, size=(64, 48))
    run(scene)
    assert volume.frames[-1].request.ambient_rays == 0 and len(volume.renderers) == 2


def test_shadows_are_drawn_as_ambient_rays_are() -> None:
    clock, volume = Clock(), FakeVolume()
    scene = make_scene(volume, clock, size=(64, 48), max_rays=64 * 48 * 10)
    eye = Eye(scene)
    lit: dict[str, Any] = {"light": (0, 1, 0), "light_angle": 6.0}
    eye.wish(size=(64, 48), shadow_rays=7, **lit)
    run(scene)
    assert [r["rays"] for r in volume.renderers] == [False, True]
    first, sharp, whole = volume.frames
    assert (sharp.size, sharp.request.shadow_rays) == ((64, 48), 0)
    eye.ack()
    assert (first.size, first.request.shadow_rays, first.request.light) == ((16, 12), 0, (0, 1, 0))
    assert (whole.size, whole.request.shadow_rays) == ((64, 48), 7)
    assert whole.request.light == (0, 1, 0) and whole.request.light_angle == 6
    told = [(h["shadow"], h["reduced"]) for h in eye.of_type("picture")]
    assert told == [(0, None), (0, None), (7, None)]
    clock.now += REST_SECONDS
    run(scene)
    clock.now += CERTAIN_SECONDS
    eye.ack()
    run(scene)
    assert "bounds" in volume.frames[-1].request.outputs
    assert volume.frames[-1].request.shadow_rays == 0
    # Ambient rays give way to shadow rays; both count.
    eye.wish(81.0, size=(64, 48), shadow_rays=7, ambient_rays=4, **lit)
    run(scene)
    request = volume.frames[-1].request
    assert (volume.frames[-1].size, request.shadow_rays, request.ambient_rays) == ((64, 48), 7, 2)
    eye.ack()
    eye.wish(82.0, size=(64, 48), shadow_rays=16, ambient_rays=4, **lit)
    run(scene)
    request = volume.frames[-1].request
    assert (volume.frames[-1].size, request.shadow_rays, request.ambient_rays) == ((64, 48), 9, 0)
    assert eye.of_type("picture")[-1]["reduced"].endswith("0 ambient rays, 9 shadow rays.")
    eye.ack()
    eye.wish(83.0, size=(64, 48))
    clock.now += GIVE_BACK_SECONDS
    run(scene)
    clock.now += GIVE_BACK_SECONDS
    run(scene)
    assert not volume.renderers[-1]["rays"], "they are given back"


def test_light_that_bounces_needs_a_renderer_of_its_own() -> None:
    clock, volume = Clock(), FakeVolume()
    scene = make_scene(volume, clock, size=(64, 48), max_rays=64 * 48 * 21)
    eye = Eye(scene)
    eye.wish(size=(64, 48), ambient_rays=4)
    run(scene)
    eye.ack()
    eye.wish(81.0, size=(64, 48), bounce_rays=16, light=(0, 1, 0))
    run(scene)
    made = [(r["rays"], r["bounce"]) for r in volume.renderers]
    assert made == [(False, False), (True, False), (True, True)]
    request = volume.frames[-1].request
    assert (volume.frames[-1].size, request.bounce_rays, request.light) == ((64, 48), 10, (0, 1, 0))
    eye.ack()
    last = eye.of_type("picture")[-1]
    assert last["bounce"] == 10 and last["reduced"].endswith("0 ambient rays, 10 bounce rays.")
    eye.ack()
    eye.wish(82.0, size=(64, 48), ambient_rays=4)
    clock.now += GIVE_BACK_SECONDS
    run(scene)
    clock.now += GIVE_BACK_SECONDS
    run(scene)
    assert [r["bounce"] for r in volume.renderers] == [False, False, True, False]


def test_renderers_are_made_with_the_field() -> None:
    clock, volume, field = Clock(), FakeVolume(), FakeVolume(value_range=(-5.0, math.inf))
    scene = make_scene(volume, clock, size=(64, 48), field=field, field_name="heat.zfp")
    eye = Eye(scene)
    told = {"name": "heat.zfp", "range": [-5, None], "labels": False, "source": None}
    assert eye.of_type("welcome")[-1]["field"] == told
    by_field: dict[str, Any] = {"color_map": ColorMap("magma", by="field")}
    eye.wish(size=(64, 48), **by_field)
    run(scene)
    assert [r["field"] for r in volume.renderers] == [field]
    assert volume.frames[-1].request.needs_field and not eye.of_type("error")
    assert [h["field_range"] for h in eye.of_type("picture")] == 2 * [[3, 250.5]]
    clock.now += REST_SECONDS
    run(scene)
    clock.now += CERTAIN_SECONDS
    eye.ack()
    run(scene)
    assert "bounds" in volume.frames[-1].request.outputs
    assert not volume.frames[-1].request.needs_field
    eye.wish(81.0, size=(64, 48))
    run(scene)
    assert eye.of_type("picture")[-1]["field_range"] is None
    # The volume itself, and none.
    own = Eye(make_scene(volume, clock, field=volume))
    assert own.of_type("welcome")[-1]["field"]["name"] == "volume"
    without = make_scene(volume, clock)
    eye = Eye(without)
    assert eye.of_type("welcome")[-1]["field"] is None
    eye.wish(size=(64, 48), **by_field)
    run(without)
    assert eye.of_type("error")[-1]["message"] == "the renderer was made without a field"


def test_the_host_draws_with_the_field_meanwhile() -> None:
    volume = isowave.open(FUEL, exact=True)
    host = make_host(volume, volume, "cpu")
    assert host is not None
    color_map = ColorMap("magma", by="field")
    camera = host.camera(40.0, (16, 12))
    request = Request(40.0, camera, (16, 12), color_map=color_map, outputs=("rgb",))
    expected = volume.renderer(size=(16, 12), field=volume, device="host").draw(request).rgb
    assert np.array_equal(host.draw(request).rgb, expected)  # type: ignore[arg-type]
    assert make_host(volume, volume, "host") is None


def test_without_memory_for_ambient_rays_pictures_have_none() -> None:
    def refuse(options: dict[str, Any]) -> Exception | None:
        return RuntimeError("too large") if options["rays"] else None

    clock, volume = Clock(), FakeVolume(refuse=refuse)
    scene = make_scene(volume, clock, size=(64, 48))
    eye = Eye(scene)
    for isovalue in (80.0, 81.0):
        eye.wish(isovalue, size=(64, 48), ambient_rays=16)
        run(scene)
        eye.ack()
        assert volume.frames[-1].request.ambient_rays == 0
    assert [r["rays"] for r in volume.renderers] == [False, True, False], "not tried again"
    scene.receive(eye.client, Budget(1 << 30))
    eye.wish(82.0, size=(64, 48), ambient_rays=16)
    run(scene)
    assert volume.renderers[-2]["rays"], "tried again with another budget"


@pytest.mark.parametrize(
    "wish",
    [
        dict(size=(8192, 8192)),
        dict(size=(8192, 8192), ambient_rays=255),
        dict(size=(8192, 8192), samples=8, ambient_rays=255),
        dict(size=(8192, 1), samples=8, ambient_rays=255),
        dict(size=(40, 40), ambient_rays=255),
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
    eye.ack()
    assert eye.of_type("picture")[-1]["stage"] == "lossless" and not eye.of_type("error")
    for frame in volume.frames:
        rays = frame.size[0] * frame.size[1] * frame.request.samples**2
        assert 0 < rays * (1 + frame.request.ambient_rays) <= limit
    for made in volume.renderers:
        assert made["size"][0] * made["size"][1] * made["samples"] ** 2 <= limit
    for head in eye.of_type("picture")[-2:]:
        drawn = next(f for f in reversed(volume.frames) if "rgb" in f.request.outputs)
        assert (head["size"], head["ambient"]) == (list(drawn.size), drawn.request.ambient_rays)
        assert head["reduced"].startswith("The server draws at most 20,000 rays, 20,000 from")
        assert f"{drawn.size[0]} x {drawn.size[1]} pixels" in head["reduced"]
        assert f", {drawn.request.ambient_rays} ambient ray" in head["reduced"]


def test_pictures_within_the_limits_are_drawn_as_they_are() -> None:
    clock, volume = Clock(), FakeVolume()
    scene = make_scene(volume, clock, size=(64, 48), max_rays=64 * 48 * 4 * 17)
    eye = Eye(scene)
    eye.wish(samples=2, ambient_rays=16)
    run(scene)
    assert (volume.frames[-1].request.samples, volume.frames[-1].request.ambient_rays) == (2, 16)
    assert all(head["reduced"] is None for head in eye.of_type("picture"))


def test_camera_rays_have_a_limit_of_their_own() -> None:
    """Each takes memory of the device. The pictures are not drawn: they would take too long."""
    scene = make_scene(FakeVolume(), Clock())
    eye = Eye(scene)
    eye.wish(size=(8192, 8192), ambient_rays=255)
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
@pytest.mark.parametrize("wish", [dict(size=(128, 96)), dict(samples=2), dict(ambient_rays=8)])
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


def test_clipped_surfaces_have_no_bounds() -> None:
    clock, volume = Clock(), FakeVolume()
    scene = make_scene(volume, clock)
    eye = Eye(scene)
    planes = (ClipPlane((1, 0, 0), 20.0),)
    for clip in (planes, ()):
        eye.wish(size=(64, 48), clip=clip, caps=False)
        for _ in range(3):
            run(scene)
            eye.ack()
            clock.now += 10
        assert eye.pictures[-1] == (eye.wishes, "lossless")
        assert len(eye.of_type("bounds")) == (0 if clip else 1) and not eye.of_type("error")
    drawn = [frame.request for frame in volume.frames]
    assert [(tuple(r.clip), r.caps) for r in drawn[:2]] == 2 * [(planes, False)]  # first and whole
    assert all(r.clip == () for r in drawn[2:]) and "bounds" in drawn[-1].outputs


def test_a_wish_that_comes_as_the_scene_goes_to_rest_is_drawn() -> None:
    shown = threading.Event()

    class Resting(Scene):
        """Gets a wish once nothing is left to do, before it waits."""

        client: Client | None = None

        def step(self) -> bool:
            did = super().step()
            if not did and self.client is not None:
                client, self.client = self.client, None
                self.receive(client, wish_of(1))
            return did

    def post(head: dict[str, Any], data: bytes | None) -> None:
        if head.get("stage") == "whole":
            shown.set()

    scene = Resting(FakeVolume(), isovalue=80, make_host=lambda v, f, d: None)
    client = scene.join(post)
    with scene._changed:
        scene.client = client
        scene._changed.notify_all()
    assert shown.wait(60)
    scene.close()
