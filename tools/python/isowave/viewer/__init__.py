"""Shows a volume in a browser (`isowave[view]`) or in a notebook (`isowave[notebook]`)."""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING, Any, cast

from isowave._annotate import Annotations
from isowave._checked import Isovalue
from isowave._scene import Scene, scene_fields

if TYPE_CHECKING:
    from .interfaces import SeriesLike, VolumeLike
    from .server import Server
    from .widget import Widget

__all__ = ["view"]


def view(
    volume: VolumeLike | SeriesLike | Scene,
    *,
    notebook: bool | None = None,
    block: bool | None = None,
    isovalue: Isovalue | None = None,
    field: VolumeLike | SeriesLike | None = None,
    device: str | int | None = None,
    memory_budget: int | None = None,
    size: tuple[int, int] = (1920, 1080),
    samples: int = 1,
    annotations: Annotations | None = None,
    title: str = "",
    max_clients: int = 16,
    max_rays: int = 150_000_000,
    height: int = 540,
    host: str = "127.0.0.1",
    port: int = 0,
    open_browser: bool = True,
) -> Widget | Server | None:
    """Shows a volume: in a notebook as a widget, elsewhere in a browser tab.

    volume        the volume, or a scene of one, which pages show at first; or a series, whose steps
                  pages go through and play. At most two steps are in memory. The range of values,
                  the histogram and the suggested isovalues are those of the first step
    notebook      whether to make a widget; None: if a Jupyter kernel runs and anywidget is
                  installed
    block         in a browser: whether to wait until Ctrl-C, and then return None; None: unless
                  Python is interactive
    isovalue      first isovalue; None, "auto": the first of Volume.suggested_isovalues()
    field         a second volume, whose values or labels may colour the surface; the volume itself,
                  for its caps; None: that of the scene. With a series: itself
    device, memory_budget [bytes], size (width, height) [pixels], samples: as for Renderer
    annotations   drawn over pictures at first; None: those of the scene
    title         text above the picture
    max_clients   most clients at the same time
    max_rays      most rays of a client's picture, pixels x samples^2 x (1 + rays of light per hit);
                  larger pictures are drawn smaller, and say so
    height        height of the widget [CSS pixels]
    host, port, open_browser: for the server; port 0: a free one

    Ctrl-C returns within a second. A long pass then ends in a thread of its own.

    Raises ImportError with the command that installs what is missing; RuntimeError if it blocks
    and the volume cannot be drawn.
    """
    options: dict[str, Any] = {
        "isovalue": isovalue,
        "device": device,
        "memory_budget": memory_budget,
        "size": size,
        "samples": samples,
        "annotations": annotations,
        "title": title,
        "max_clients": max_clients,
        "max_rays": max_rays,
    }
    scene = None
    if isinstance(volume, Scene):
        scene, fields = volume, scene_fields(volume)
        options["scene"] = json.dumps(fields)
        if field is None:
            field = cast("VolumeLike", scene.volume if fields["field"] == "volume" else scene.field)
        volume = cast("VolumeLike", scene.volume)
    options["field"] = field
    if notebook is None:
        notebook = _in_notebook()
    if notebook:
        try:
            from . import widget
        except ImportError as error:
            raise ImportError(missing(error, "notebook")) from None
        return widget.show(volume, height=height, first=scene, **options)
    try:
        from . import server
    except ImportError as error:
        raise ImportError(missing(error, "view")) from None
    served = server.serve(volume, host=host, port=port, open_browser=open_browser, **options)
    print(served.url, flush=True)
    if block is False or (block is None and _is_interactive()):
        return served
    failure = server.wait_and_close(served)
    if failure is not None:
        raise RuntimeError(failure)
    return None


def missing(error: ImportError, extra: str) -> str:
    """What to install when an optional package cannot be imported."""
    return f"{error.name or error} is missing: pip install 'isowave[{extra}]'"


def _is_interactive() -> bool:
    return bool(hasattr(sys, "ps1") or sys.flags.interactive or "IPython" in sys.modules)


def _in_notebook() -> bool:
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    if getattr(shell, "kernel", None) is None:
        return False
    from importlib.util import find_spec

    return find_spec("anywidget") is not None
