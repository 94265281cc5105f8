"""The viewer with the package's own volumes and renderers, on a device."""

from __future__ import annotations

import io
import threading
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from conftest import sphere_voxels
from PIL import Image
from viewer_fakes import PLAIN_WISH

import isowave
from isowave._request import Request
from isowave.viewer.protocol import VERSION
from isowave.viewer.renderers import make_host
from isowave.viewer.scene import Scene
from isowave.viewer.session import Session

if not isowave.devices():
    pytest.skip("no OpenCL device", allow_module_level=True)

TIMEOUT = 300  # seconds; kernels may have to be compiled
WISH = PLAIN_WISH | {
    "isovalue": 8.5,
    "size": [90, 70],
    "color": [0.5, 0.25, 1],
    "background": [1, 1, 0],
}


@pytest.fixture(scope="module")
def volume() -> isowave.Volume:
    return isowave.compress(sphere_voxels(), tolerance=0.01, spacing=(2, 1, 1.5), levels=0)


@pytest.fixture(scope="module")
def scene(volume: isowave.Volume) -> Iterator[Scene]:
    scene = Scene(volume, size=(128, 96), memory_budget=1 << 28)
    yield scene
    scene.close()


class Front:
    """A front end that acknowledges all pictures."""

    def __init__(self, scene: Scene) -> None:
        self.changed = threading.Condition()
        self.heads = list[dict[str, Any]]()
        self.pictures = list[bytes]()
        self.session = Session(scene, self._take)
        self.session.receive({"type": "hello", "version": VERSION})

    def _take(self, head: dict[str, Any], data: bytes | None) -> None:
        with self.changed:
            self.heads.append(head)
            if data is not None:
                self.pictures.append(data)
                self.session.receive({"type": "ack", "frame": head["frame"]})
            self.changed.notify_all()

    def wait(self, **wanted: Any) -> dict[str, Any]:
        def found() -> list[dict[str, Any]]:
            return [h for h in self.heads if all(h.get(k) == v for k, v in wanted.items())]

        with self.changed:
            assert self.changed.wait_for(found, TIMEOUT), self.heads
            return found()[-1]


@pytest.fixture
def front(scene: Scene) -> Iterator[Front]:
    front = Front(scene)
    yield front
    front.session.close()


@pytest.mark.parametrize("samples", [1, 2])
def test_the_lossless_picture_has_the_renderers_bits(
    front: Front, volume: isowave.Volume, samples: int
) -> None:
    front.session.receive({**WISH, "samples": samples})
    head = front.wait(type="picture", stage="lossless")
    assert head["complete"] and head["passes"] > 0 and head["size"] == [90, 70]
    shown = np.asarray(Image.open(io.BytesIO(front.pictures[-1])))
    renderer = volume.renderer(size=(90, 70), samples=samples)
    expected = renderer.render(
        8.5, samples=samples, size=(90, 70), color=(0.5, 0.25, 1), background=(1, 1, 0)
    )
    np.testing.assert_array_equal(shown, expected.rgb)
    assert np.unique(shown.reshape(-1, 3), axis=0).shape[0] > 50  # there is a surface
    camera = renderer.camera()
    assert head["camera"]["eye"] == list(camera.eye)


def test_the_host_draws_the_devices_bits(volume: isowave.Volume) -> None:
    renderers = [volume.renderer(size=(90, 70)), make_host(volume, None, "cpu")]
    pictures = []
    for renderer in renderers:
        assert renderer is not None
        camera = renderer.camera(8.5, (90, 70))
        request = Request(
            8.5,
            camera,
            (90, 70),
            color=(0.5, 0.25, 1),
            background=(1, 1, 0),
            on_pass=lambda so_far: so_far.completed_percent <= 100,
        )
        image = renderer.draw(request)
        assert image.complete and image.statistics["passes"] > 0
        pictures.append(image.rgb)
    np.testing.assert_array_equal(*pictures)


def test_without_a_gpu_the_hosts_renderer_draws_all(
    volume: isowave.Volume, monkeypatch: pytest.MonkeyPatch
) -> None:
    if any(device["type"] in ("gpu", "accelerator") for device in isowave.devices()):
        pytest.skip("a GPU draws by default")
    monkeypatch.delenv("ISOWAVE_DEVICE", raising=False)
    assert make_host(volume, None, None) is None and make_host(volume, None, "host") is None
    scene = Scene(volume, size=(128, 96))
    front = Front(scene)
    front.session.receive({**WISH, "size": [300, 200], "max_error": 1.0, "ambient": 2})
    head = front.wait(type="picture", stage="lossless", wish=1)
    assert head["size"] == [300, 200] and head["detail"]["reachable"]
    front.wait(type="bounds", wish=1)
    states = [(h["state"], h["device"]) for h in front.heads if h["type"] == "status"]
    assert states[-1] == ("ready", "host")
    shown = np.asarray(Image.open(io.BytesIO(front.pictures[-1])))
    expected = volume.render(
        8.5,
        size=(300, 200),
        max_surface_error=1.0,
        ambient_rays=2,
        color=(0.5, 0.25, 1),
        background=(1, 1, 0),
        device="cpu",
    )
    np.testing.assert_array_equal(shown, expected.rgb)
    front.session.close()
    scene.close()


def test_all_of_a_first_picture_and_its_bounds_come(front: Front) -> None:
    front.session.receive(WISH)
    front.wait(type="picture", stage="first", wish=1)
    within = front.wait(type="bounds", wish=1)["within_pixel"]
    assert 0.5 < within <= 1  # 0.01 of a voxel, on a surface of slope 1


def test_quality_reaches_the_renderer(front: Front) -> None:
    front.session.receive({**WISH, "max_error": 2})
    assert front.wait(type="picture", stage="lossless")["detail"]["reachable"] is True
    front.session.receive({**WISH, "id": 2, "time_budget": 1000})
    front.wait(type="picture", stage="lossless", wish=2)
    assert not [h for h in front.heads if h["type"] == "error"]


def test_welcome_and_status_tell_of_volume_and_device(front: Front) -> None:
    welcome, status = front.wait(type="welcome"), front.wait(type="status", state="ready")
    assert welcome["shape"] == [20, 25, 30] and welcome["spacing"] == [2, 1, 1.5]
    assert welcome["dtype"] == "float32" and welcome["max_error"] <= 0.01
    low, high = welcome["range"]
    assert low < welcome["isovalue"] < high
    histogram = front.wait(type="histogram")
    assert sum(histogram["counts"]) > 0 and histogram["range"] == [low, high]
    # The host draws while the device's kernels are compiled.
    names = [device["name"] for device in isowave.devices()]
    with front.changed:
        assert front.changed.wait_for(
            lambda: any(head.get("device") in names for head in front.heads), TIMEOUT
        )
    assert 0 < status["memory_bytes"] <= 1 << 28


def test_a_budget_that_is_too_small_is_refused_in_one_line(front: Front) -> None:
    front.session.receive({"type": "budget", "bytes": 1000})
    message = front.wait(type="error", wish=None)["message"]
    assert "budget" in message
    front.wait(type="status", state="ready", memory_budget=1 << 28)
    front.session.receive(WISH)
    front.wait(type="picture", stage="lossless")
