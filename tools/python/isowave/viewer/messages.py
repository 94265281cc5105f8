"""Messages to front ends: view.js describes them."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isowave._annotate import NAMES, Annotations
from isowave._checked import refuse
from isowave._color_map import ColorMap, color_map_of
from isowave._core import Error, parse_scene

from .interfaces import ImageLike, VolumeLike
from .pictures import Extent
from .protocol import MAX_TITLE, MAX_UNITS, VERSION, checked_text, first_line
from .renderers import Renderers, may_have_labels
from .steps import Steps, source_of
from .turns import Frame, Stage

#: What a probe says of a place where nothing is seen.
NOTHING: dict[str, Any] = {"position": None, "value": None, "field": None}


def welcome(
    volume: VolumeLike,
    title: str,
    value_range: tuple[float, float],
    field: dict[str, Any] | None,
    steps: Steps,
) -> dict[str, Any]:
    """Facts about the volume, which is the first step."""
    return {
        "type": "welcome",
        "version": VERSION,
        "title": title,
        "shape": [int(n) for n in volume.shape],
        "spacing": [float(s) for s in volume.spacing],
        "box": [list(corner) for corner in volume.box],
        "anatomical": bool(volume.anatomical),
        "dtype": str(volume.source_dtype),
        "range": list(value_range),
        "bits_per_voxel": float(volume.bits_per_voxel),
        "max_error": finite(volume.max_error),
        "levels": int(volume.num_levels),
        "field": field,
        "steps": steps.names,
        "sources": steps.sources,
    }


def first_shown(
    scene: str, annotations: Annotations | None, color_map: ColorMap | None
) -> dict[str, Any]:
    """What pages show at first, beside the isovalue. Raises TypeError, ValueError."""
    return {
        "scene": json.loads(scene) if scene else None,
        "annotations": first_annotations(annotations),
        "color_map": first_color_map(color_map),
    }


def first_annotations(wanted: Annotations | None) -> dict[str, Any] | None:
    """As wishes have them. Raises TypeError; ValueError: texts that no wish may have."""
    if wanted is None:
        return None
    if not isinstance(wanted, Annotations):
        raise refuse("annotations", wanted, "isowave.Annotations")
    return {
        "what": [name for name in NAMES if name in wanted.what or "all" in wanted.what],
        "units": checked_text(wanted.units, MAX_UNITS, "units"),
        "title": checked_text(wanted.title, MAX_TITLE, "title"),
    }


def first_color_map(wanted: ColorMap | None) -> dict[str, Any] | None:
    """As wishes have them. Raises TypeError, ValueError."""
    color_map = color_map_of(wanted)
    if color_map is None:
        return None
    if color_map.table:
        raise ValueError("color_map: pages show no tables of colours: give a name")
    limits = None if color_map.range is None else [*color_map.range]
    axis = [*color_map.axis]
    return {"colors": color_map.name, "by": color_map.by, "axis": axis, "range": limits}


def field(volume: VolumeLike, name: str) -> dict[str, Any]:
    """Facts about the second volume. name: of its file; "volume": it is the drawn one."""
    values = [finite(value) for value in volume.value_range]
    labels, source = may_have_labels(volume), source_of(volume)
    return {"name": name, "range": values, "labels": labels, "source": source}


def scene(text: str) -> dict[str, Any]:
    """The fields of a scene file, or what is wrong with it."""
    try:
        fields = parse_scene(text)
    except Error as raised:
        return error(raised, None)
    return {"type": "scene", "fields": fields}


def status(volume: VolumeLike, renderers: Renderers) -> dict[str, Any]:
    renderer, on_host = renderers.renderer, renderers.on_host
    state = "ready" if renderer else "failed" if renderers.failed else "starting"
    return {
        "type": "status",
        "state": state,
        "device": str(renderer.device["name"] or "host") if renderer else None,
        "notice": str(renderer.device["notice"]) if renderer else None,
        "memory_bytes": int(renderer.memory_bytes) if renderer else None,
        "device_memory": int(renderer.device["memory_bytes"]) if renderer and not on_host else None,
        "memory_budget": renderers.wanted.memory_budget,
        "nbytes": int(volume.nbytes),
    }


def bins_of(dtype: np.dtype[Any], value_range: tuple[float, float]) -> int:
    """About 256 bins of a histogram; each has as many values if these are integers."""
    low, high = value_range
    if dtype.kind not in "iu" or not high > low:
        return 256
    values = int(high - low) + 1
    return math.ceil(values / math.ceil(values / 256))


def histogram(counts: NDArray[Any], edges: NDArray[Any], suggested: list[float]) -> dict[str, Any]:
    return {
        "type": "histogram",
        "counts": [int(n) for n in counts],
        "range": [float(edges[0]), float(edges[-1])],
        "suggested": suggested,
    }


def error(raised: Exception, wish: int | None) -> dict[str, Any]:
    """An error. wish: the wish that it concerns; None: it concerns all clients."""
    return {"type": "error", "wish": wish, "message": first_line(raised)}


def progress(frame: Frame) -> dict[str, Any]:
    """How far a picture is."""
    return {"type": "progress", "wish": frame.wish.id, "percent": frame.percent}


def picture(frame: Frame, stage: str, seconds: float) -> dict[str, Any]:
    """The head of a picture, which goes before its bytes."""
    camera, high = frame.camera, frame.camera.parallel_height
    return {
        "type": "picture",
        "wish": frame.wish.id,
        "step": frame.wish.step,
        "stage": stage,
        "format": "jpeg",
        "size": list(frame.extent.size),
        "samples": frame.extent.samples,
        "ambient": frame.extent.ambient,
        "shadow": frame.extent.shadow,
        "bounce": frame.extent.bounce,
        "field_range": None,
        "reduced": None,
        "notice": "",
        "isovalue": frame.wish.request.isovalue,
        "camera": {
            "eye": list(camera.eye),
            "at": list(camera.at),
            "up": list(camera.up),
            "fovy_deg": camera.fovy,
            **({"parallel_height": high} if high is not None else {}),
        },
        "complete": False,
        "ms": round(seconds * 1e3, 2),
        "passes": frame.passes,
        "percent": frame.percent,
        "decoded_blocks": None,
        "detail": None,
    }


def finished_picture(
    frame: Frame, seconds: float, image: ImageLike, volume: VolumeLike, renderers: Renderers
) -> dict[str, Any]:
    statistics = image.statistics
    notices = map(volume.isovalue_notice, frame.wish.request.isovalues)
    detail = plain(statistics.get("detail"))
    keeps_error = detail is None or bool(detail["reachable"])
    chosen = detail and detail.get("samples")
    return {
        **picture(frame, frame.stage.value, seconds),
        "samples": int(chosen or frame.extent.samples),
        "reduced": reduced(frame, renderers, keeps_error),
        "notice": " ".join(filter(None, notices)),
        "complete": bool(image.complete),
        "passes": int(statistics["passes"]),
        "rays_cut": int(statistics.get("rays_cut", 0)),
        "percent": 100.0,
        "decoded_blocks": int(statistics["decoded_blocks"]),
        "detail": detail,
        "field_range": pair(statistics.get("field_range")),
    }


def reduced(frame: Frame, renderers: Renderers, keeps_error: bool) -> str | None:
    """Why a whole picture has fewer rays than its wish, in one line; None: it has all.

    A picture whose error is kept needs no more rays of its pixels.
    """
    asked, extent = Extent.of(frame.wish.request), frame.extent
    if asked.chooses and keeps_error:
        asked = replace(asked, samples=extent.samples, chooses=extent.chooses)
    if frame.stage is not Stage.WHOLE or extent == asked:
        return None
    why = "The device has no memory for more"
    most, first = renderers.max_rays, renderers.first_ray_limit
    if asked != asked.within(first, most):
        why = f"The server draws at most {most:,} rays, {min(first, most):,} from the camera"
    width, height = extent.size
    rays, ambient = count(extent.samples**2, "ray"), count(extent.ambient, "ambient ray")
    shadow = f", {count(extent.shadow, 'shadow ray')}" if asked.shadow else ""
    bounce = f", {count(extent.bounce, 'bounce ray')}" if asked.bounce else ""
    return (
        f"{why}: this picture has {width} x {height} pixels, {rays} a pixel, "
        f"{ambient}{shadow}{bounce}."
    )


def count(number: int, thing: str) -> str:
    return f"{number} {thing}{'s' * (number != 1)}"


def finite(value: object) -> float | None:
    if isinstance(value, (int, float, np.number)) and math.isfinite(float(value)):
        return float(value)
    return None


def pair(value: object) -> list[float | None] | None:
    return [finite(v) for v in value] if isinstance(value, (tuple, list)) else None


def plain(value: object) -> dict[str, Any] | None:
    """A dict of numbers and texts, without what JSON does not have."""
    if not isinstance(value, Mapping):
        return None
    return {str(key): v if isinstance(v, (bool, str)) else finite(v) for key, v in value.items()}
