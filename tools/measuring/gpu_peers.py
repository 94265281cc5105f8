"""The section `gpu_peer` of tools/measure, and its table: isowave beside textures and NanoVDB on an
NVIDIA GPU."""

from measuring.cells import mebibytes, ms, name_of
from measuring.run import GPU_VOLUMES


def gpu_peer(run):
    """One row for each side of each volume. On a CPU, peers are drawn on the host, for a trial."""
    quick = run.options.quick
    rows = []
    for field in run.fields(*GPU_VOLUMES[:2]):
        run.run(
            "bench/gpu_peer",
            f"generate:{field}_uint8",
            isovalue=128,
            size="64x48" if quick else "1280x720",
            orbit=2 if quick else 10,
            rounds=1 if quick else 5,
            device=run.options.device,
            host_check=run.options.on_cpu,
            json="p.json",
        )
        rows += [{"volume": field, **side} for side in run.read_json("p.json")["sides"]]
    return rows


SIDES = {
    "isowave_exact": "isowave, `--exact`",
    "isowave_rate_4": "isowave, `--rate 4`",
    "texture_uint8": "texture of 8 bits",
    "texture_float": "texture of floats",
    "nanovdb_float_bits": "NanoVDB float, bits",
    "nanovdb_float_ranges": "NanoVDB float, ranges",
    "nanovdb_fpn_bits": "NanoVDB FpN, bits",
    "nanovdb_fpn_ranges": "NanoVDB FpN, ranges",
    "nanovdb_fp8_bits": "NanoVDB Fp8, bits",
    "nanovdb_fp8_ranges": "NanoVDB Fp8, ranges",
    "nanovdb_uint8_bits": "NanoVDB 8-bit integers, bits",
    "nanovdb_uint8_ranges": "NanoVDB 8-bit integers, ranges",
}


def short(value):
    """ms of what may take much less than one."""
    return f"{value:.3f}" if value < 1 else ms(value)


def times(row, *kinds):
    return " / ".join(short(row["ms"][kind]["median"]) for kind in kinds)


def gpu_peers(rows):
    yield (
        "volume",
        "side",
        "hits: any view, or cold / next / warm, ms",
        "picture on the host",
        "hits of a new isovalue",
        "device memory",
        "made in, s",
        "largest error of a voxel",
        "missed, false",
        "distance of hits, p99, voxels",
    )
    for row in rows:
        is_isowave = "cold" in row["ms"]
        kinds = ("cold", "next", "warm")
        yield (
            name_of(row["volume"]),
            SIDES[row["name"]],
            times(row, *kinds) if is_isowave else times(row, "kernel"),
            times(row, *(f"{kind}_picture" for kind in kinds))
            if is_isowave
            else times(row, "picture"),
            times(row, "new"),
            mebibytes(row["device_bytes"]),
            f"{row['build_ms'] / 1000:.2f}",
            f"{row['max_voxel_error']:.2g}",
            f"{row['missed']:,}, {row['false']:,}",
            f"{row['distance_p99']:.1e}",
        )
