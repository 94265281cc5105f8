"""Series in the viewer: each client looks at a step of its own, and memory holds two."""

from __future__ import annotations

import gc
import io
import json
import threading
import weakref
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser_pages import (  # noqa: F401
    browser,
    changes,
    drag,
    eye,
    fake_scene,
    keep,
    open_page,
    rests,
    screenshot,
    state,
)
from conftest import sphere_voxels
from PIL import Image
from viewer_fakes import Drawn, FakeVolume
from viewer_scenes import Clock, Eye, make_scene, run, wish_of

import isowave
from isowave import Series
from isowave.viewer import command, view
from isowave.viewer.protocol import Ack, ProtocolError
from isowave.viewer.scene import CERTAIN_SECONDS, REST_SECONDS, Scene
from isowave.viewer.server import Server
from isowave.viewer.steps import STEP_SECONDS


class Balls:
    """A series of fake volumes.

    opened  the steps that were read, in their order
    alive   volumes that exist, by their steps
    broken  steps that cannot be read
    before_read  called with a step before it is read, by the thread that reads
    """

    def __init__(self, count: int, **options: Any) -> None:
        self.opened = list[int]()
        self.drawn = list[int]()  # a step for each frame
        self.made = list[dict[str, Any]]()  # options of the renderers
        self.broken = set[int]()
        self.before_read: Callable[[int], None] = lambda step: None
        self.most_alive = 0
        self._options = options
        self._alive: weakref.WeakSet[Any] = weakref.WeakSet()
        names = [f"/data/step_{i}.nrrd" for i in range(count)]
        self.series = Series(names, self._open)  # type: ignore[arg-type]

    def _open(self, step: int) -> FakeVolume:
        self.before_read(step)
        self.opened.append(step)
        if step in self.broken:
            raise isowave.Error(f"step_{step}.nrrd: truncated")

        class Ball(FakeVolume):
            __hash__ = object.__hash__  # of a WeakSet

            def renderer(self, **options: Any) -> Any:
                balls.made.append(options)
                return super().renderer(**options)

        balls = self
        volume = Ball(before_pass=lambda drawn: self._note(step, drawn), **self._options)
        volume.value_range = (0.0, 255.0 + step)
        self._alive.add(volume)
        gc.collect()
        self.most_alive = max(self.most_alive, len(self._alive))
        return volume

    def _note(self, step: int, drawn: Drawn) -> None:
        if drawn.passes == 0:
            self.drawn.append(step)


class StepEye(Eye):
    """A client that looks at a step."""

    def look(self, step: int, **more: Any) -> int:
        self.wishes += 1
        wish = wish_of(self.wishes, size=(64, 48), **more)
        self.scene.receive(self.client, type(wish)(wish.id, wish.request, step))
        return self.wishes

    @property
    def steps(self) -> list[tuple[int, int, str]]:
        """Wish, step and stage of its pictures."""
        return [(h["wish"], h["step"], h["stage"]) for h in self.heads if h["type"] == "picture"]


def series_scene(balls: Balls, clock: Clock, **options: Any) -> Scene:
    return make_scene(balls.series, clock, **options)  # type: ignore[arg-type]


def test_clients_look_at_steps_of_their_own() -> None:
    clock, balls = Clock(), Balls(5)
    scene = series_scene(balls, clock)
    one, two = StepEye(scene), StepEye(scene)
    names = [f"step_{i}.nrrd" for i in range(5)]
    assert one.of_type("welcome")[0]["steps"] == names
    one.look(0)
    two.look(3)
    run(scene)
    clock.now += STEP_SECONDS
    run(scene)
    assert one.steps == [(1, 0, "first"), (1, 0, "whole")]
    assert two.steps == [(1, 3, "first"), (1, 3, "whole")]
    assert balls.opened == [0, 3] and len(balls.made) == 2, "no renderer is made twice"


def test_a_volume_is_a_series_of_one_step() -> None:
    scene = make_scene(FakeVolume(), Clock())
    eye = StepEye(scene)
    assert eye.of_type("welcome")[0]["steps"] is None
    with pytest.raises(ProtocolError, match="step must be an integer from 0 to 0"):
        eye.look(1)


def test_facts_are_those_of_the_first_step() -> None:
    clock, balls = Clock(), Balls(4)
    scene = series_scene(balls, clock, isovalue=None)
    eye = StepEye(scene)
    eye.look(2)
    run(scene)
    late = StepEye(scene)
    for each in (eye, late):
        welcome = each.of_type("welcome")[0]
        assert (welcome["range"], welcome["isovalue"]) == ([0, 255], 90.5)
        assert len(each.of_type("histogram")) == 1
    # Notices are about the step that is drawn: 256 is a value of step 2 alone.
    for step, notice in ((2, ""), (0, "isovalue 256 is outside.")):
        eye.ack()
        wish = eye.look(step, isovalue=256.0)
        run(scene)
        notices = [h["notice"] for h in eye.of_type("picture") if h["wish"] == wish]
        assert notices[-1] == notice, step


def test_memory_holds_two_steps_and_the_next_one_is_read_ahead() -> None:
    clock, balls = Clock(), Balls(30)
    scene = series_scene(balls, clock)
    eye = StepEye(scene)
    for step in range(30):
        eye.look(step)
        run(scene)
        eye.ack()
        if 0 < step < 29:
            assert balls.opened == list(range(step + 2)), "one more than is drawn"
    eye.look(17)
    run(scene)
    eye.ack()
    assert balls.opened[-2:] == [0, 17] and balls.most_alive == 2
    # Not read ahead: a step that somebody jumps to is not followed by the next one.
    eye.look(16)
    run(scene)
    assert balls.opened[-1] == 16
    gc.collect()
    assert len(balls._alive) == 2


def test_a_newer_wish_cancels_the_step_of_the_one_before() -> None:
    clock, balls = Clock(), Balls(9)
    scene = series_scene(balls, clock)
    eye = StepEye(scene)
    eye.look(3)
    eye.look(4)
    eye.look(7)
    run(scene)
    assert balls.opened == [0, 7] and {step for _, step, _ in eye.steps} == {7}


def test_a_step_that_cannot_be_read_ends_its_wish_alone() -> None:
    clock, balls = Clock(), Balls(4)
    balls.broken.add(2)
    scene = series_scene(balls, clock)
    eye, other = StepEye(scene), StepEye(scene)
    other.look(0)
    wish = eye.look(2)
    run(scene)
    clock.now += STEP_SECONDS
    run(scene)
    errors = [(h["wish"], h["message"]) for h in eye.of_type("error")]
    assert errors == [(wish, "step_2.nrrd: truncated")] and not other.of_type("error")
    other.ack()
    other.look(0)
    run(scene)
    assert other.steps[-1] == (2, 0, "whole")
    # It is tried again, and may be there meanwhile.
    balls.broken.clear()
    wish = eye.look(2)
    run(scene)
    clock.now += STEP_SECONDS
    run(scene)
    assert eye.steps[-1] == (wish, 2, "whole")


def test_a_step_without_a_renderer_ends_its_wish_and_others_are_drawn() -> None:
    clock = Clock()
    balls = Balls(3, refuse=lambda options: RuntimeError("no memory") if fails else None)
    fails = False
    scene = series_scene(balls, clock)
    eye = StepEye(scene)
    fails = True
    wish = eye.look(1)
    run(scene)
    assert ("no memory", wish) in [(h["message"], h["wish"]) for h in eye.of_type("error")]
    assert scene.failure is None, "the server goes on"
    fails = False
    wish = eye.look(2)
    run(scene)
    assert eye.steps[-1] == (wish, 2, "whole")


def test_two_steps_take_turns_of_a_second() -> None:
    """Clients that move all the time do not keep others from their steps."""
    clock, balls = Clock(), Balls(2)
    scene = series_scene(balls, clock)
    eyes = [StepEye(scene), StepEye(scene)]
    for _ in range(100):
        for step, each in enumerate(eyes):
            if each.stage_done():
                each.look(step)
            each.ack()
        scene.step()
        clock.now += 0.05
    changes_of_step = sum(a != b for a, b in zip(balls.drawn, balls.drawn[1:]))
    assert 2 <= changes_of_step <= 5 / STEP_SECONDS + 1, balls.drawn
    assert 0.3 < balls.drawn.count(0) / len(balls.drawn) < 0.7


def test_bounds_are_not_worth_another_renderer() -> None:
    clock, balls = Clock(), Balls(2)
    scene = series_scene(balls, clock)
    one, two = StepEye(scene), StepEye(scene)
    for step, each in enumerate((one, two)):
        each.look(step)
        run(scene)
        clock.now += STEP_SECONDS
        run(scene)
        each.ack()
    clock.now += REST_SECONDS
    run(scene)
    clock.now += CERTAIN_SECONDS
    made = len(balls.made)
    run(scene)
    assert len(two.of_type("bounds")) == 1 and not one.of_type("bounds")
    assert len(balls.made) == made


def test_reading_a_step_does_not_keep_others_waiting() -> None:
    may_end, balls = threading.Event(), Balls(3)
    balls.before_read = lambda step: step == 2 and may_end.wait(60)  # type: ignore[assignment]
    changed, heads = threading.Condition(), list[dict[str, Any]]()

    def post(head: dict[str, Any], data: bytes | None) -> None:
        with changed:
            heads.append(head)
            changed.notify_all()
        if data is not None and one is not None:
            scene.receive(one, Ack(head["frame"]))

    def came(**wanted: Any) -> bool:
        def there() -> bool:
            return any(all(h.get(k) == v for k, v in wanted.items()) for h in heads)

        with changed:
            return changed.wait_for(there, 60)

    scene = Scene(balls.series, isovalue=80, size=(64, 48))
    one, two = scene.join(post), scene.join(lambda head, data: None)
    assert one is not None and two is not None
    wish = wish_of(1)
    scene.receive(two, type(wish)(1, wish.request, 2))
    for number in range(1, 4):
        scene.receive(one, wish_of(number))
        assert came(type="picture", stage="whole", wish=number), "while another step is read"
    may_end.set()
    scene.receive(one, type(wish)(9, wish.request, 1))
    assert came(type="picture", stage="whole", step=1)
    scene.close()


def test_what_a_series_cannot_have_is_refused() -> None:
    balls = Balls(2)
    with pytest.raises(ValueError, match="a series has no second volume: leave out field"):
        Scene(balls.series, field=FakeVolume(), start=False)
    with pytest.raises(ValueError, match="the field is a series"):
        Scene(FakeVolume(), field=balls.series, start=False)
    with pytest.raises(ValueError, match="the series has no steps"):
        Scene(balls.series[2:], start=False)
    scene = series_scene(balls, Clock())
    with pytest.raises(ProtocolError, match="step must be an integer from 0 to 1"):
        StepEye(scene).look(2)
    balls.broken.add(0)
    with pytest.raises(isowave.Error, match="step_0.nrrd: truncated"):
        Scene(balls.series, start=False)


def test_caps_show_each_steps_own_values() -> None:
    clock, balls = Clock(), Balls(2)
    scene = series_scene(balls, clock, field=balls.series)
    eye = StepEye(scene)
    told = {"name": "volume", "range": [0, 255], "labels": True, "source": None}
    assert eye.of_type("welcome")[0]["field"] == told
    eye.look(1, color_map=isowave.ColorMap("gray", by="caps"))
    run(scene)
    assert eye.steps[-1] == (1, 1, "whole")
    assert [options["field"].value_range for options in balls.made] == [(0, 255), (0, 256)]


def test_a_slider_shows_the_steps(open_page: Callable[..., Any]) -> None:  # noqa: F811
    balls = Balls(12)
    with Server(fake_scene(balls.series, title="step_*.nrrd")) as server:  # type: ignore[arg-type]
        page, other = open_page(), open_page()
        for each in (page, other):
            each.goto(server.url)
            rests(each)
        slider, said = page.get_by_label("Step", exact=True), page.locator(".steps output")
        assert said.inner_text() == "step 0: step_0.nrrd" and "step" not in state(page)
        assert page.locator(".volume").inner_text().endswith(", 12 steps")
        assert "voxels of step 0, log scale" in page.locator(".ends").inner_text()
        assert changes(page, lambda: drag(page, 120, 40))
        camera = eye(page)
        slider.fill("7")
        rests(page)
        assert said.inner_text() == "step 7: step_7.nrrd" and state(page)["step"] == "7"
        assert balls.drawn[-1] == 7 and np.array_equal(eye(page), camera)
        page.get_by_label("Isovalue", exact=True).last.fill("100")
        rests(page)
        assert state(page)["step"] == "7" and balls.drawn[-1] == 7
        assert screenshot(page)[0] == "step_100_step7.png"
        keep(page, "series")
        assert other.locator(".steps output").inner_text() == "step 0: step_0.nrrd"
        # The address keeps the step; one that there is not is the last.
        page.reload()
        rests(page)
        assert said.inner_text() == "step 7: step_7.nrrd" and slider.input_value() == "7"
        page.evaluate("location.hash = 'step=99'")
        rests(page)
        assert said.inner_text() == "step 11: step_11.nrrd" and state(page)["step"] == "11"
        for bad in ("-1", "1.5", "x", ""):
            page.evaluate("text => location.hash = text", f"step={bad}&iso=80")
            rests(page)
            assert said.inner_text() == "step 11: step_11.nrrd", bad
        slider.focus()
        page.keyboard.press("ArrowLeft")
        rests(page)
        assert state(page)["step"] == "10" and not page.problems and not other.problems


def test_a_button_plays_the_steps(open_page: Callable[..., Any]) -> None:  # noqa: F811
    balls = Balls(4)
    with Server(fake_scene(balls.series)) as server:  # type: ignore[arg-type]
        page = open_page(viewport={"width": 360, "height": 700}, has_touch=True)
        page.goto(server.url)
        rests(page)
        play = page.get_by_role("button", name="Play")
        play.click()
        assert play.get_attribute("aria-pressed") == "true"
        for _ in range(600):
            if len(balls.drawn) > 14:
                break
            page.wait_for_timeout(50)
        keep(page, "series_narrow")
        play.click()
        rests(page)
        assert play.get_attribute("aria-pressed") == "false"
        shown = [a for a, b in zip(balls.drawn, [None, *balls.drawn]) if a != b]
        assert shown == [i % 4 for i in range(len(shown))] and len(shown) > 5, "in turn"
        frame = "document.querySelector('main').shadowRoot.querySelector('.frame')"
        assert page.evaluate(f"{frame}.scrollWidth <= 360")
        before = len(balls.drawn)
        page.wait_for_timeout(500)
        assert len(balls.drawn) <= before + 1, "it has stopped; bounds may be drawn"
        # A step that cannot be read says so, and ends it.
        balls.broken.update({0, 1, 2, 3})
        play.click()
        page.locator(".note").get_by_text("truncated").wait_for()
        assert play.get_attribute("aria-pressed") == "false" and not page.problems


def test_the_page_says_which_step_it_reads(open_page: Callable[..., Any]) -> None:  # noqa: F811
    may_end, balls = threading.Event(), Balls(3)
    balls.before_read = lambda step: step == 2 and may_end.wait(60)  # type: ignore[assignment]
    with Server(fake_scene(balls.series)) as server:  # type: ignore[arg-type]
        page = open_page()
        page.goto(server.url)
        rests(page)
        page.get_by_label("Step", exact=True).fill("2")
        page.get_by_text("Reading step 2 …").wait_for()
        may_end.set()
        rests(page)
        assert not page.locator(".note").is_visible() and balls.drawn[-1] == 2


def test_a_volume_has_no_slider(open_page: Callable[..., Any]) -> None:  # noqa: F811
    for source in (FakeVolume(), Balls(1).series):
        with Server(fake_scene(source)) as server:  # type: ignore[arg-type]
            page = open_page()
            page.goto(server.url + "#iso=80&step=5")
            rests(page)
            assert not page.locator(".time").is_visible() and "step" not in state(page)
            assert "steps" not in page.locator(".volume").inner_text() and not page.problems


def steps_of(count: int) -> Any:
    """(t, z, y, x): a ball that shrinks."""
    ball = sphere_voxels((12, 14, 16))
    return np.stack([np.clip(100 - 8 * ball - 3 * t, 0, 255) for t in range(count)]).astype("u1")


@pytest.mark.parametrize("device", ["host", "cpu"])
def test_the_pictures_are_those_of_the_library(
    open_page: Callable[..., Any], device: str  # noqa: F811
) -> None:
    series = isowave.open_series(steps_of(3))
    options: dict[str, Any] = {"isovalue": 50, "device": device, "block": False}
    with view(series, open_browser=False, notebook=False, **options) as server:
        page = open_page(viewport={"width": 800, "height": 600})
        page.goto(server.url + "#background=ffffff")
        rests(page)
        page.get_by_label("Step", exact=True).fill("2")
        rests(page)
        shown = np.asarray(Image.open(io.BytesIO(screenshot(page)[1])))
        size = (shown.shape[1], shown.shape[0])
        *_, expected = series.render(50, size=size, device="host", color="#dbbd87")
        assert np.array_equal(shown, expected.rgb) and not page.problems


def nrrd(path: Path, array: Any) -> str:
    """A file of uint8 voxels, whose axes are those of the array in reverse."""
    sizes = " ".join(str(n) for n in reversed(array.shape))
    header = f"NRRD0004\ntype: uint8\nencoding: raw\ndimension: {array.ndim}\nsizes: {sizes}\n\n"
    path.write_bytes(header.encode() + array.tobytes())
    return str(path)


def test_the_command_takes_series(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from isowave.viewer import server as server_module

    arrays = steps_of(12)
    files = [nrrd(tmp_path / f"s_{t}.nrrd", array) for t, array in enumerate(arrays)]
    whole, pattern = nrrd(tmp_path / "all.nrrd", arrays), str(tmp_path / "s_*.nrrd")

    def served(*arguments: str) -> dict[str, Any]:
        """What the server is started with."""
        seen = dict[str, Any]()

        def fail(volume: Any, **options: Any) -> None:
            seen.update(options, volume=volume)
            raise OSError("enough")

        monkeypatch.setattr(server_module, "serve", fail)
        assert command.main([*arguments, "--no-browser"]) == 1
        return seen

    for names, count, title in (
        (files[:3], 3, "s_0.nrrd to s_2.nrrd"),
        ([pattern], 12, "s_*.nrrd"),
        ([whole], 12, "all.nrrd"),
    ):
        given = served(*names, "--rate", "8")
        assert isinstance(given["volume"], Series), names
        assert (len(given["volume"]), given["title"]) == (count, title)
        assert given["volume"][1].bits_per_voxel == 8
    one = served(str(tmp_path / "s_11.nrrd"))
    assert isinstance(one["volume"], isowave.Volume) and one["title"] == "s_11.nrrd"
    assert served(pattern, "--color-by", "volume")["field"] is not None
    # Scenes say how a series looks; one with a field says too much.
    scene = {"isowave_scene": 1, "surfaces": [{"isovalue": 50}], "volume": "s_*.nrrd"}
    heat = {"color_map": "gray", "color_by_field": True, "field": "all.nrrd"}
    file, by_field = tmp_path / "scene.json", tmp_path / "by_field.json"
    file.write_text(json.dumps(scene))
    by_field.write_text(json.dumps({**scene, **heat}))
    for arguments in ([files[0], files[1], "--scene", str(file)], ["--scene", str(file)]):
        given = served(*arguments)
        assert isinstance(given["volume"], Series) and "50" in given["scene"]
    capsys.readouterr()
    smaller = nrrd(tmp_path / "small.nrrd", arrays[0][:-1])
    for arguments, why in (
        ([pattern, "--color-by", files[0]], "a series has no second volume to colour by"),
        (["--scene", str(by_field)], "a series has no second volume to colour by"),
        ([str(tmp_path / "t_*.nrrd")], "no file has such a name"),
        ([files[0], smaller], "has 16x14x11 voxels"),
        ([files[0], str(tmp_path / "absent.nrrd")], "absent.nrrd"),
    ):
        assert served(*arguments) == {}, arguments
        said = capsys.readouterr().err
        assert why in said and said.count("\n") == 1 and said.startswith("isowave view: "), said
