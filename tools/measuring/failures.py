"""Charts of where methods fail: rays of hard cases by root finder (`isowave verify`), and parts of
surfaces by storage and level of detail (`isowave bench topology`)."""

import matplotlib.pyplot as plt
import matplotlib.ticker

from measuring.fronts import volume_title

# Okabe and Ito's colours, told apart by colour-blind readers too, and a marker for print.
SOLVERS = {
    "linear": ("#E69F00", "o"),
    "marmitt": ("#56B4E9", "s"),
    "analytic": ("#CC79A7", "D"),
    "bernstein": ("#009E73", "^"),
}
LINES = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#555555")


def percent_axis(axis, least):
    """A logarithmic axis of per cents with a place for 0."""
    axis.set_xscale("symlog", linthresh=least, linscale=0.4)
    axis.set_xlim(-0.25 * least, 100)
    axis.xaxis.set_major_formatter(matplotlib.ticker.FuncFormatter(lambda x, _: f"{x:g} %"))
    axis.xaxis.set_major_locator(matplotlib.ticker.FixedLocator([0, 0.1, 1, 10, 100]))
    axis.xaxis.set_minor_locator(matplotlib.ticker.NullLocator())
    axis.grid(True, axis="x", color="#E5E5E5", linewidth=0.6)
    axis.set_axisbelow(True)
    axis.tick_params(labelsize=7)


def draw_stability(rows, stem, save, caption):
    """Missed and false hits of each case and solver, the hardest cases at the top."""
    cases = [row for row in rows if "case" in row]
    shares = [
        {
            solver: 100 * (case["missed"][solver] + case["false"][solver]) / case["rays"]
            for solver in SOLVERS
        }
        for case in cases
    ]
    order = sorted(range(len(cases)), key=lambda i: sum(shares[i].values()))
    figure, axis = plt.subplots(figsize=(6.4, 0.19 * len(cases) + 1.2))
    for solver, (color, marker) in SOLVERS.items():
        axis.plot(
            [shares[i][solver] for i in order],
            range(len(order)),
            marker,
            color=color,
            markersize=4,
            label=solver,
        )
    axis.set_yticks(range(len(order)), [cases[i]["case"] for i in order])
    percent_axis(axis, 0.02)
    axis.set_xlabel("rays missed or false", fontsize=8)
    axis.legend(frameon=False, fontsize=7, ncol=4, loc="lower center", bbox_to_anchor=(0.5, 1))
    figure.text(0.5, 0.01, caption(rows[0]), ha="center", fontsize=5, color="#555555")
    figure.tight_layout(rect=(0, 0.03, 1, 1))
    save(figure, f"{stem}_stability")


def draw_topology(documents, stem, save, _):
    """Share of a surface's components that each way to store it loses, a line for each volume."""
    names = [row["stored"] for row in max(documents, key=lambda d: len(d["rows"]))["rows"]]
    figure, axes = plt.subplots(1, 2, figsize=(7, 3.2), sharey=True)
    for axis, of_all, what, title in (
        (axes[0], "components", "lost", "components lost"),
        (axes[1], "large", "lost_large", "of them, those of 64 or more triangles"),
    ):
        for document, color in zip(documents, LINES):
            shares = {
                row["stored"]: 100 * row[what] / max(1, document[of_all])
                for row in document["rows"]
            }
            axis.plot(
                [shares[name] for name in names if name in shares],
                [i for i, name in enumerate(names) if name in shares],
                "o-",
                color=color,
                markersize=4,
                linewidth=0.8,
                label=volume_title(document),
            )
        percent_axis(axis, 0.05)
        axis.set_title(title, fontsize=8)
    axes[0].set_yticks(range(len(names)), [name.replace("--", "") for name in names])
    axes[0].invert_yaxis()
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, frameon=False, fontsize=7, ncol=3, loc="lower center")
    figure.tight_layout(rect=(0, 0.12, 1, 1))
    save(figure, f"{stem}_topology")
