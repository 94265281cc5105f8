"""A volume in trame: a slider for the isovalue, a view to drag; isowave draws the pictures.

python trame_view.py VOLUME [--server] [--port PORT]

Each page keeps its own isovalue and camera (`wish`) and asks for a picture of them; while one is
on its way, only the newest wish waits. Drag to turn; the wheel comes closer.
"""

import asyncio
import base64
import io
import math
from concurrent.futures import ThreadPoolExecutor

from PIL import Image
from trame.app import get_server
from trame.ui.html import DivLayout
from trame.widgets import client, html

import isowave

SIZE = (640, 480)
server = get_server(client_type="vue3")
server.cli.add_argument("volume", help="a file that isowave opens")
volume = isowave.open(server.cli.parse_known_args()[0].volume, rate=8)
low, high = volume.value_range
first = volume.camera((low + high) / 2, size=SIZE)
pool = ThreadPoolExecutor(max_workers=1)  # pages take turns


def camera_for(turn, tilt, distance):
    """turn, tilt: degrees around first.at, and above it; distance: in those of the first view."""
    turn, tilt = math.radians(turn), math.radians(tilt)
    distance *= math.dist(first.eye, first.at)
    towards = (math.sin(turn) * math.cos(tilt), math.sin(tilt), math.cos(turn) * math.cos(tilt))
    eye = tuple(at + distance * part for at, part in zip(first.at, towards, strict=True))
    return isowave.Camera(eye, first.at, (0, 1, 0), first.fovy)


def draw(isovalue, turn, tilt, distance):
    """The picture as a URL."""
    camera = camera_for(turn, tilt, distance)
    image = volume.render(float(isovalue), camera=camera, size=SIZE, outputs=("rgb",))
    jpeg = io.BytesIO()
    Image.fromarray(image.rgb).save(jpeg, "jpeg", quality=85)
    return "data:image/jpeg;base64," + base64.b64encode(jpeg.getvalue()).decode()


@server.trigger("draw")
async def draw_elsewhere(*wish):
    return await asyncio.get_running_loop().run_in_executor(pool, draw, *wish)


server.state.wish = [(low + high) / 2, 30, 20, 1.0]  # isovalue, turn, tilt, distance
server.state.update({"shown": "", "busy": False, "picture": ""})
server.state.client_only("wish", "shown", "busy", "picture")  # not shared between pages
ask = """if (!busy && shown !== String(wish)) {
  busy = true; shown = String(wish);
  trigger('draw', wish).then((url) => { picture = url; }).finally(() => { busy = false; });
}"""
drag = """if ($event.buttons & 1) wish = [wish[0], wish[1] - $event.movementX / 2,
  Math.max(-89, Math.min(89, wish[2] + $event.movementY / 2)), wish[3]];"""
zoom = "wish = [...wish.slice(0, 3), wish[3] * Math.exp($event.deltaY / 1000)]"

with DivLayout(server):
    client.ClientStateChange(value="wish", change=ask, trigger_on_create=True)
    client.ClientStateChange(value="busy", change=ask)
    with html.Label("Isovalue {{ wish[0].toPrecision(4) }}", style="font-family: sans-serif"):
        value = ("wish[0]",)
        choose = "wish = [Number($event.target.value), ...wish.slice(1)]"
        html.Input(type="range", min=low, max=high, step="any", value=value, input=choose)
    style = "display: block; touch-action: none; cursor: grab"
    on = {"pointermove": drag, "wheel": zoom, "mousedown": "$event.preventDefault()"}
    on["__events"] = ["pointermove", "wheel"]
    html.Img(src=("picture",), alt="the isosurface", style=style, **on)

if __name__ == "__main__":
    server.start()
