"""The sections `bricks_...` of tools/measure, and their tables: volumes drawn by one process for
each device of a host, and single bricks drawn alone."""

import json

from measuring.cells import mebibytes, ms, name_of
from measuring.run import voxels_of, what_was_measured

# Devices -> dims. The mixing layer lies across y, which is the same and is not cut, so each device
# has as much of its surface.
WEAK = {1: "2048x2048x1920", 2: "2048x2048x3840", 4: "4096x2048x3840", 8: "4096x2048x7680"}
STRONG = {devices: "2048x2048x3840" for devices in WEAK}
# A brick of 8192^3 on eight has 1025^3 blocks with its layer, more than 2^30.
LARGE = {4: ("4096x4096x8192", 4), 8: ("8192x8192x8160", 1)}  # and the rate
SMALL, BIG = "1280x720", "3840x2160"
QUICK_SIZES = {SMALL: "64x48", BIG: "96x64"}
# The least volumes, and not all numbers of processes: all of them take long on two processors.
QUICK = {1: "16x16x16", 2: "16x16x32", 4: "32x16x32", 8: "32x16x64"}
CPU = {1: "256x256x256", 2: "256x256x512", 4: "512x256x512", 8: "512x256x1024"}


def num_devices(run):
    """How many devices processes of this host have, as brick_bench shares them out; more than any
    case has if all is only tried."""
    if run.options.quick:
        return max(WEAK)
    selectors = run.options.device.split(",")
    if len(selectors) > 1:
        return len(selectors)
    listed = json.loads(run.run("isowave", "devices", json=True, remember=False))
    names = ("name", "platform")
    wanted = tuple(run.machine[name] for name in ("device", "platform"))
    return sum(tuple(one[name] for name in names) == wanted for one in listed)


def measure(run, field, dims, size, brick=None, ranks=None, **storage):
    """The row of one case: what brick_bench says."""
    quick = run.options.quick
    run.run(
        "bench/brick_bench",
        f"generate:{field}_{dims}_uint8",
        isovalue=128,
        **storage,
        size=QUICK_SIZES[size] if quick else size,
        orbit=2 if quick else 10,
        rounds=1 if quick else 3,
        brick=brick,
        device=run.options.device,
        json="b.json",
        ranks=ranks,
    )
    row = what_was_measured(run.read_json("b.json"))
    for rank in row["ranks"]:
        rank["memory"] = rank["memory"]["peak"]
    exact = storage.get("exact", False)
    return {
        **row,
        "volume": f"{field}_{dims}",
        "storage": "exact" if exact else f"rate {storage['rate']}",
    }


def cases_of(run, section, cases):
    """The rows of all cases (devices, field, dims, size, storage). Cases with more devices than
    there are get a line in place of a row."""
    there = num_devices(run)
    lacking = sorted({case[0] for case in cases if case[0] > there})
    if lacking:
        wanted = " and ".join(map(str, lacking))
        print(f"{section}: cases of {wanted} devices are left out: there are {there}", flush=True)
    return [
        measure(run, field, dims, size, ranks=devices, **storage)
        for devices, field, dims, size, storage in cases
        if devices <= there
    ]


def dims_for(run, dims):
    """The volumes for this device, by number of processes."""
    if run.options.quick:
        few = {devices: QUICK[devices] for devices in dims if devices <= 4}
        return few if 1 in dims else {devices: QUICK[devices] for devices in dims}
    return {devices: CPU[devices] for devices in dims} if run.options.on_cpu else dims


def scaled(run, dims, storage, all_of_it=True):
    """Cases by number of devices: of mixing layer and shell, and in a large picture."""
    pairs = [("mixing_layer", SMALL)]
    if all_of_it:
        pairs += [("mixing_layer", BIG), ("shell", SMALL)]
    of_device = dims_for(run, dims)
    return [(n, field, of_device[n], size, storage) for field, size in pairs for n in of_device]


def bricks_weak(run):
    """As many voxels for each device: 8.05 G."""
    return cases_of(run, "bricks_weak", scaled(run, WEAK, {"rate": 4}))


def bricks_strong(run):
    """The same voxels for all devices: 16.1 G."""
    of_two = dims_for(run, STRONG)[2]
    cases = scaled(run, STRONG, {"rate": 4})
    return cases_of(
        run, "bricks_strong", [(n, field, of_two, *rest) for n, field, _, *rest in cases]
    )


def bricks_exact(run):
    """As bricks_weak, stored without loss: the host compresses."""
    return cases_of(run, "bricks_exact", scaled(run, WEAK, {"exact": True}, False))


def bricks_large(run):
    """The largest volumes that four and eight devices are tried with."""
    dims = dims_for(run, {devices: dims for devices, (dims, _) in LARGE.items()})
    cases = [(n, "mixing_layer", dims[n], SMALL, {"rate": LARGE[n][1]}) for n in LARGE]
    return cases_of(run, "bricks_large", cases)


def bricks_alone(run):
    """Each brick of bricks_weak by itself, on one device."""
    dims = dims_for(run, WEAK)
    if run.options.quick:
        dims = {devices: dims[devices] for devices in (1, 2)}
    return [
        measure(run, "mixing_layer", dims[n], SMALL, brick=f"{brick}/{n}", rate=4)
        for n in dims
        for brick in range(n)
    ]


PARTS = ("bricks_weak", "bricks_strong", "bricks_exact", "bricks_large")


def series_of(rows):
    """Rows by what is the same for all numbers of devices, those of fewer devices first."""
    series = {}
    for row in rows:
        key = (row["volume"].rsplit("_", 1)[0], row["storage"], "x".join(map(str, row["size"])))
        series.setdefault(key, []).append(row)
    return {key: sorted(found, key=lambda row: len(row["ranks"])) for key, found in series.items()}


def efficiency(row, first, kind, strong):
    """Efficiency of a frame with its picture on the host, beside the case of the fewest devices."""
    before, now = (case["frames"][kind]["picture_ms"]["median"] for case in (first, row))
    more = len(row["ranks"]) / len(first["ranks"]) if strong else 1
    return before / (more * now)


KINDS = ("cold", "next", "warm")


def load_seconds(row):
    return f"{max(rank['load_ms'] for rank in row['ranks']) / 1e3:.1f} s"


def largest(row, what):
    return mebibytes(max(rank[what] for rank in row["ranks"]))


def scaling(rows, strong, compared=True):
    """Times are medians, and end with the picture in rank 0's memory; in brackets, with the hits of
    the slowest brick. Memory is that of the process that needs most."""
    yield (
        "volume",
        "voxels",
        "stored with",
        "picture",
        "devices",
        "made and compressed in",
        "cold ms",
        "next",
        "warm",
        *(("efficiency, cold", "next", "warm") if compared else ()),
        "put together, ms",
        "bytes given for it",
        "device memory of one",
    )
    for (_, storage, size), found in series_of(rows).items():
        for row in found:
            frames = row["frames"]
            given = max(rank["frames"]["cold"]["given_bytes"] for rank in row["ranks"])
            yield (
                name_of(row["volume"]),
                f"{voxels_of(row['volume']) / 1e9:.2f} G",
                f"`--{storage}`",
                size.replace("x", " x "),
                len(row["ranks"]),
                load_seconds(row),
                *(
                    f"{ms(frames[kind]['picture_ms']['median'])} "
                    f"({ms(frames[kind]['frame_ms']['median'])})"
                    for kind in KINDS
                ),
                *(
                    f"{efficiency(row, found[0], kind, strong):.2f}"
                    for kind in (KINDS if compared else ())
                ),
                f"{frames['cold']['composition_ms']['median']:.2f}",
                f"{given / 1e6:.2f} MB",
                largest(row, "memory"),
            )


def weak_scaling(rows):
    yield from scaling(rows, False)


def strong_scaling(rows):
    yield from scaling(rows, True)


def exact_scaling(rows):
    yield from scaling(rows, False)


def large_bricks(rows):
    yield from scaling(rows, False, compared=False)


def bricks_by_themselves(rows):
    """Each number of bricks has the times of its slowest, by median, kind by kind."""
    yield (
        "volume",
        "bricks",
        "cold ms",
        "next",
        "warm",
        "efficiency, cold",
        "next",
        "warm",
        "passes, cold",
        "next",
        "blocks decoded, cold",
        "next",
        "slots",
        "made and compressed in",
    )
    series = {}
    for row in rows:
        series.setdefault(int(row["brick"].split("/")[1]), []).append(row["ranks"][0])
    volumes = {int(row["brick"].split("/")[1]): row["volume"] for row in rows}

    def slowest(ranks, kind):
        return max(rank["frames"][kind]["own_ms"]["median"] for rank in ranks)

    def most(ranks, kind, what):
        return f"{max(rank['frames'][kind][what] for rank in ranks):,.0f}"

    first = series[min(series)]
    for number, ranks in sorted(series.items()):
        yield (
            name_of(volumes[number]),
            number,
            *(ms(slowest(ranks, kind)) for kind in KINDS),
            *(f"{slowest(first, kind) / slowest(ranks, kind):.2f}" for kind in KINDS),
            *(most(ranks, kind, "passes") for kind in KINDS[:2]),
            *(most(ranks, kind, "decoded_blocks") for kind in KINDS[:2]),
            f"{max(rank['cache_slots'] for rank in ranks):,}",
            f"{max(rank['load_ms'] for rank in ranks) / 1e3:.1f} s",
        )


def in_bricks(rows):
    """The table of a section that tools/measure made until December 2026: one and two devices.
    Times are medians; memory is that of the process that needs most."""
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
            load_seconds(row),
            *(ms(frames[kind]["frame_ms"]["median"]) for kind in KINDS),
            ms(max(rank["frames"]["cold"]["own_ms"]["median"] for rank in ranks)),
            f"{frames['cold']['composition_ms']['median']:.2f}",
            largest(row, "memory"),
            largest(row, "host_peak"),
        )


# Section -> tables.
TABLES = (
    ("bricks", in_bricks),
    ("bricks_weak", weak_scaling),
    ("bricks_strong", strong_scaling),
    ("bricks_exact", exact_scaling),
    ("bricks_large", large_bricks),
    ("bricks_alone", bricks_by_themselves),
)
