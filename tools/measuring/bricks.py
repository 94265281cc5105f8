"""The section `bricks` of tools/measure, and its table: volumes drawn by one process, and by two
with a device each."""

from measuring.cells import mebibytes, ms, name_of
from measuring.run import what_was_measured

# Volume, processes, what is compared with what.
GPU_CASES = (
    ("mixing_layer_2048x2048x1920", 1),
    ("mixing_layer_2048x2048x1920", 2),
    ("mixing_layer_2048x2048x3840", 2),
    ("mixing_layer_4096x4096x2048", 1),
    ("mixing_layer_4096x4096x4096", 2),
)
CPU_CASES = (("mixing_layer_256x256x256", 1), ("mixing_layer_256x256x256", 2))
QUICK_CASES = (("mixing_layer_32x32x32", 1), ("mixing_layer_32x32x32", 2))


def bricks(run):
    """One row for each case: what brick_bench says."""
    quick = run.options.quick
    cases = QUICK_CASES if quick else CPU_CASES if run.options.on_cpu else GPU_CASES
    rows = []
    for field, ranks in cases:
        run.run(
            "bench/brick_bench",
            f"generate:{field}_uint8",
            isovalue=128,
            rate=4,
            size="64x48" if quick else "1280x720",
            orbit=2 if quick else 10,
            rounds=1 if quick else 3,
            device=run.options.device,
            json="b.json",
            ranks=ranks,
        )
        row = what_was_measured(run.read_json("b.json"))
        for rank in row["ranks"]:
            rank["memory"] = rank["memory"]["peak"]
        rows.append({**row, "volume": field})
    return rows


def in_bricks(rows):
    """Times are medians; memory is that of the process that needs most."""
    yield (
        "volume",
        "voxels",
        "devices",
        "made and compressed in",
        "cold ms",
        "next",
        "warm",
        "slowest brick alone, cold ms",
        "picture put together, ms",
        "device memory of one",
        "host memory of one",
    )
    for row in rows:
        x, y, z = (int(side) for side in row["volume"].rsplit("_", 1)[1].split("x"))
        ranks, frames = row["ranks"], row["frames"]
        yield (
            name_of(row["volume"]),
            f"{x * y * z / 1e9:.2f} G",
            len(ranks),
            f"{max(rank['load_ms'] for rank in ranks) / 1e3:.1f} s",
            *(ms(frames[kind]["frame_ms"]["median"]) for kind in ("cold", "next", "warm")),
            ms(max(rank["frames"]["cold"]["own_ms"]["median"] for rank in ranks)),
            f"{frames['cold']['composition_ms']['median']:.2f}",
            mebibytes(max(rank["memory"] for rank in ranks)),
            mebibytes(max(rank["host_peak"] for rank in ranks)),
        )
