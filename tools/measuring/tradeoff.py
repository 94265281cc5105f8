"""Charts of speed against accuracy: what `isowave bench pareto` writes, a panel for each volume.

Every point is one way to draw. The front is what no other way beats in both; it is drawn and named.
The rest is grey. Ways of other programs (peers) are blue and named, and the default is black. Texts
are as large as a page that shows the chart 600 pixels wide needs.
"""

import math

import matplotlib.patheffects
import matplotlib.pyplot as plt
import matplotlib.ticker

from measuring.fronts import front_of, volume_title

FRONT, OTHERS, PEERS, DEFAULT = "#D55E00", "#BBBBBB", "#0072B2", "#333333"
KEY = ((0.02, "left", "orange: what nothing beats", FRONT),)
KEY += ((0.5, "center", "blue squares: other programs", PEERS),)
KEY += ((0.98, "right", "grey: all other ways", "#777777"),)
NAME_POINTS, LINE_POINTS = 8.5, 9.5
# Around each name, so that lines and points behind it leave it readable.
HALO = [matplotlib.patheffects.withStroke(linewidth=2, foreground="white")]
TIMES = {
    "next_ms": "ms from camera to picture, one degree further",
    "cold_ms": "ms to the first picture of an isovalue",
}
ERRORS = {
    "flip": "error (FLIP)",
    "wrong_pixels": "wrong pixels, %",
}


def name_of(point):
    """The name beside a point: options of `isowave render`, shortened, one or two lines."""
    name = (
        point["way"]
        .replace("--device host", "host")
        .replace(" --", ",\n")
        .replace(" + ", " +\n")
        .replace("VTK, steps ", "VTK, steps\n")
        .replace("--", "")
    )
    return name.removesuffix(", ranges").removesuffix(" of 8 bits")


def spread_names(axis, front, cost, error):
    """Writes names at the lower left of the front, where no points can be, each below the last."""
    height = axis.get_window_extent().height / axis.figure.dpi * 72
    low, high = (axis.transScale.transform((1, y))[1] for y in axis.get_ylim())
    last = None
    for point in front:
        at = (axis.transScale.transform((1, point[error]))[1] - low) / (high - low) * height
        name = name_of(point)
        half = (name.count("\n") + 1) * LINE_POINTS / 2
        text_at = at - 3 if last is None else min(at - 3, last - half)
        last = text_at - half
        axis.annotate(
            name,
            (point[cost], point[error]),
            xytext=(-5, text_at - at),
            textcoords="offset points",
            fontsize=NAME_POINTS,
            linespacing=1.0,
            ha="right",
            va="center",
            color=FRONT,
            path_effects=HALO,
            zorder=5,
        )


def name_beside(axis, point, cost, error, color, above):
    """To the right, or to the left of points near the panel's right end.

    above: points; with several lines, to their nearest
    """
    at = axis.transAxes.inverted().transform(axis.transData.transform((point[cost], point[error])))
    name = name_of(point)
    is_left = at[0] + 0.018 * max(map(len, name.split("\n"))) > 1
    axis.annotate(
        name,
        (point[cost], point[error]),
        xytext=(-3 if is_left else 3, above if "\n" not in name else above / 3),
        textcoords="offset points",
        ha="right" if is_left else "left",
        fontsize=NAME_POINTS,
        linespacing=1.0,
        va="center" if "\n" not in name else "bottom" if above > 0 else "top",
        color=color,
        path_effects=HALO,
        zorder=5,
    )


def draw_panel(axis, document, cost, error, least):
    """least: the error that points without any have, so that they have a place."""
    points = [dict(point) for point in document["points"] if point[cost] is not None]
    for point in points:
        point[error] = max(point[error], least)
    front = front_of(points, cost, error)
    names = {point["way"] for point in front}
    peers = [point for point in points if point["is_peer"]]
    for point in points:
        if not point["is_peer"] and point["way"] not in names:
            axis.plot(point[cost], point[error], "o", color=OTHERS, markersize=3)
    for point in peers:
        axis.plot(point[cost], point[error], "s", color=PEERS, markersize=4, zorder=3)
    beside = [point for point in peers if point["way"] not in names]
    beside.sort(key=lambda point: point[error], reverse=True)
    for number, point in enumerate(beside):  # by turns above and below
        name_beside(axis, point, cost, error, PEERS, 9 if number % 2 == 0 else -9)
    for point in points:
        if point["way"] == "default" and "default" not in names:
            axis.plot(point[cost], point[error], "o", color=DEFAULT, markersize=4, zorder=4)
            name_beside(axis, point, cost, error, DEFAULT, 20)
    axis.plot(
        [point[cost] for point in front],
        [point[error] for point in front],
        color=FRONT,
        linewidth=1,
        zorder=2,
    )
    for point in front:
        if not point["is_peer"]:
            axis.plot(point[cost], point[error], "o", color=FRONT, markersize=4, zorder=4)
    return front


def with_margins(low, high, length, before, after):
    """Ends of a logarithmic axis of `length` points, with room for names beside its values."""
    per_point = math.log(high / low) / (length - before - after)
    return low * math.exp(-before * per_point), high * math.exp(after * per_point)


def plain(value, _=None):
    return f"{value:g}"


def percent(value, _=None):
    return f"{100 * value:g}"


def draw(documents, stem, cost, error, save, caption):
    """Writes one chart. cost, error: names of the axes' values in the points."""
    values = [(p[cost], p[error]) for d in documents for p in d["points"] if p[cost] is not None]
    positive = [y for _, y in values if y > 0]
    least = min(positive, default=1) / (2 if len(positive) < len(values) else 1)
    columns = min(2, len(documents))
    rows = -(-len(documents) // columns)
    size = (3.6 * columns + 0.4, 2.7 * rows + 0.8)
    figure, axes = plt.subplots(
        rows, columns, figsize=size, squeeze=False, sharex=True, sharey=True
    )
    for axis in axes.flat[len(documents) :]:
        axis.remove()
    axes.flat[0].set_xscale("log")
    axes.flat[0].set_yscale("log")
    costs = [x for x, _ in values]
    axes.flat[0].set_xlim(with_margins(min(costs), max(costs), 235, 75, 12))
    axes.flat[0].set_ylim(with_margins(least, max(positive, default=1), 155, 18, 28))
    figure.supxlabel(TIMES.get(cost, "MB of memory to draw"), fontsize=10, y=0.28 / size[1])
    figure.supylabel(
        f"{ERRORS[error]}, against {documents[0]['truth_rays']} rays a pixel", fontsize=10
    )
    width, height = documents[0]["size"]
    views = " or ".join(str(number) for number in sorted({d["views"] for d in documents}))
    text = f"{caption(documents[0])}; {width} x {height}, medians of {views} views"
    figure.text(0.5, 0.08 / size[1], text, ha="center", fontsize=7, color="#555555")
    for x, side, words, color in KEY:
        y = 1 - 0.2 / size[1]
        figure.text(x, y, words, ha=side, fontsize=NAME_POINTS, weight="bold", color=color)
    fronts = []
    for axis, document in zip(axes.flat, documents):
        axis.grid(True, which="major", color="#E5E5E5", linewidth=0.6)
        axis.set_axisbelow(True)
        axis.tick_params(labelsize=8.5, labelbottom=True)
        axis.xaxis.set_major_formatter(matplotlib.ticker.FuncFormatter(plain))
        shown = percent if error == "wrong_pixels" else plain
        axis.yaxis.set_major_formatter(matplotlib.ticker.FuncFormatter(shown))
        axis.set_title(volume_title(document), fontsize=10)
        fronts.append((axis, draw_panel(axis, document, cost, error, least)))
    figure.tight_layout(rect=(0.01, 0.45 / size[1], 1, 1 - 0.25 / size[1]))
    for axis, front in fronts:
        spread_names(axis, front, cost, error)
    save(figure, stem)


def draw_all(documents, stem, save, caption):
    """All charts of speed against accuracy, and of bytes."""
    documents = [
        {
            **document,
            "points": [
                {**point, "memory_mb": point["memory_bytes"] / 1e6} for point in document["points"]
            ],
        }
        for document in documents
    ]
    draw(documents, f"{stem}_pareto", "next_ms", "flip", save, caption)
    draw(documents, f"{stem}_pareto_new", "cold_ms", "flip", save, caption)
    draw(documents, f"{stem}_pareto_wrong", "next_ms", "wrong_pixels", save, caption)
    draw(documents, f"{stem}_pareto_bytes", "memory_mb", "flip", save, caption)
