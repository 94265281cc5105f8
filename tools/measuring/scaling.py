"""The chart of volumes in bricks: time and efficiency against the number of devices."""

import matplotlib.pyplot as plt
import matplotlib.ticker

from measuring.bricks import KINDS, efficiency, series_of

# As tools/charts has them.
KIND_STYLES = {"cold": ("#0072B2", "o"), "next": ("#E69F00", "s"), "warm": ("#009E73", "^")}
LINES = ("-", "--", ":", "-.")
GOAL = 0.8


def title_of(key):
    field, storage, size = key
    return f"{field.replace('_', ' ')}, {storage}, {size.replace('x', ' x ')}"


def draw_scaling(rows, stem, save, caption, strong):
    """A kind of frame has a colour, and a series a line."""
    figure, (times, shares) = plt.subplots(1, 2, figsize=(11, 4.8))
    most = 0
    for line, (key, found) in zip(LINES, series_of(rows).items()):
        devices = [len(row["ranks"]) for row in found]
        for kind in KINDS:
            color, marker = KIND_STYLES[kind]
            style = {"color": color, "marker": marker, "linestyle": line, "markersize": 5}
            spent = [row["frames"][kind]["picture_ms"]["median"] for row in found]
            most = max(most, *spent)
            times.plot(devices, spent, **style, label=f"{kind}: {title_of(key)}")
            shares.plot(
                devices, [efficiency(row, found[0], kind, strong) for row in found], **style
            )
    shares.axhline(GOAL, color="#555555", linewidth=1, linestyle=(0, (1, 3)))
    counts = sorted({len(row["ranks"]) for row in rows})
    for axis in (times, shares):
        axis.set_xscale("log", base=2)
        axis.xaxis.set_major_locator(matplotlib.ticker.FixedLocator(counts))
        axis.xaxis.set_major_formatter(matplotlib.ticker.FuncFormatter(lambda n, _: f"{n:g}"))
        axis.xaxis.set_minor_locator(matplotlib.ticker.NullLocator())
        axis.set_xlabel("devices")
        axis.grid(True, color="#DDDDDD", linewidth=0.6)
        axis.set_axisbelow(True)
    times.set_ylim(0, 1.1 * most)
    shares.set_ylim(bottom=0)
    times.set_ylabel("ms from camera to picture in host memory, median")
    shares.set_ylabel("efficiency beside the fewest devices")
    handles, labels = times.get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncol=3, frameon=False, fontsize=7)
    of_what = "the same voxels in all" if strong else "as many voxels for each device"
    figure.suptitle(f"Volumes in bricks, {of_what}", fontsize=12)
    figure.text(0.5, 0.005, caption(rows[0]), ha="center", fontsize=7, color="#555555")
    save(figure, f"{stem}_{'strong' if strong else 'weak'}", bottom=0.03 + 0.045 * len(labels) / 3)
