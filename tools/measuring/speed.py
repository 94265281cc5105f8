"""Sections of tools/measure that ask how long it takes. Each returns the rows of its section."""

import re
import statistics

from measuring.run import (
    AS_CPU,
    CPU_VOLUMES,
    GPU_VOLUMES,
    QUICK_VOLUMES,
    Failed,
    as_arguments,
    voxels_of,
    what_was_measured,
)


def frame_row(run, field, storage=(), rounds=3, resident=False, environment={}, **options):
    """One row: what frame_bench says of an orbit around the volume.

    resident     with the floor
    environment  of frame_bench, see Run.run()
    """
    quick = run.options.quick
    volume = run.volume(field, *storage)
    if not resident:
        options["no_resident"] = True
    run.run(
        "bench/frame_bench",
        volume,
        isovalue=128,
        size=(64, 48) if quick else (1280, 720),
        device=run.options.device,
        rounds=1 if quick else rounds,
        orbit=2 if quick else None,
        environment=environment,
        **options,
        json="f.json",
    )
    said = run.read_json("f.json")
    floor = said["resident_floor"]
    times = {kind: said["total_ms"][kind] for kind in ("cold", "next", "warm")}
    return {
        "volume": field,
        "arguments": as_arguments(options),
        "storage": list(storage),
        **times,
        "hits": {kind: spread["median"] for kind, spread in said["hits_ms"].items()},
        "floor": floor["median"] if floor else None,
        "passes": said["median"]["passes"],
        "decoded_blocks": said["median"]["decoded_blocks"],
        "memory": said["memory"]["peak"],
        "bits_per_voxel": 8 * (run.work / volume).stat().st_size / voxels_of(field),
        "stage_ms": {name: stage["median"] for name, stage in said.get("stage_ms", {}).items()},
    }


def slots_for(field):
    """Room for all that a frame of the largest volume needs, which is more than the default."""
    return 2**21 if voxels_of(field) > 2**32 else None


def frames(run):
    rows = []
    for field in run.fields():
        slots = slots_for(field)
        rows.append(
            frame_row(run, field, pipeline="rays", cache_slots=slots, resident=slots is None)
        )
        rows.append(frame_row(run, field, pipeline="blocks", cache_slots=slots))
    return rows


def normals(run):
    return [
        frame_row(run, field, normals=kind, cache_slots=slots_for(field))
        for field in run.fields()
        for kind in ("cell", "smooth")
    ]


def ambient(run):
    return [
        frame_row(run, field, normals="smooth", ambient=n, rounds=1, cache_slots=slots_for(field))
        for field in run.fields()
        for n in (0, 1, 16)
    ]


#: Three clipping planes, which caps close.
CLIP = ["1,0.2,0", "0,1,0.1", "0,0.1,1"]


def scenes(run):
    """One opaque surface first, then what else scenes have. On a CPU, of one volume."""
    kinds = [
        {},
        {"clip": ["0,0,1,-100000"]},
        {"clip": CLIP},
        {"light": "0.5,1,0.7"},
        {"light": "0.5,1,0.7", "shadow": 1},
        {"light": "0.5,1,0.7", "shadow": 16},
        {"light": "0.5,1,0.7", "bounce": 16},
        {"values_of": True},
        {"slice": ["z"]},
        {"slice": ["x", "y", "z"]},
        {"surfaces": 1, "opacity": 1},
        {"surfaces": 2, "opacity": 1},
        {"surfaces": 2, "opacity": 1, "light": "0.5,1,0.7", "shadow": 1},
        {"surfaces": 2, "opacity": 1, "values_of": True},
        *({"surfaces": n, "opacity": 0.3} for n in (1, 2, 4, 8)),
        {"surfaces": 2, "opacity": 0.3, "clip": CLIP},
    ]
    rows = []
    for field in run.fields()[: 1 if run.options.on_cpu else 2]:
        for kind in kinds:
            if "values_of" in kind:
                kind = kind | {"values_of": run.volume(field)}
            rows.append(frame_row(run, field, normals="smooth", rounds=2, **kind))
    return rows


def speculation(run):
    return [
        frame_row(run, run.fields()[0], speculation=kind, pipeline=pipeline)
        for pipeline in ("rays", "blocks")
        for kind in ("off", "global", "per-ray", "scanned")
        if kind != "scanned" or pipeline == "blocks"
    ]


def slots(run):
    field = run.fields()[0]
    counts = (90000, 65536, 40000, 20000, 10000)
    if run.options.quick:
        counts = (300, 200)
    elif run.options.on_cpu:
        field, counts = CPU_VOLUMES[0], (20000, 16384, 12000, 8000)
    rows = [frame_row(run, field, cache_slots=n) for n in counts]
    rows += [frame_row(run, field, cache_slots=n, stream="host") for n in counts[1:3]]
    return rows + [frame_row(run, field, cache_slots=n, pipeline="blocks") for n in counts[1:4:2]]


def budgets(run):
    budgets_of = {
        "mixing_layer_1024x1024x1024": ("787MB", "250MB"),
        "mixing_layer_2048x2048x1920": ("4626MB", "600MB"),
        "mixing_layer_256x256x256": ("40MB", "20MB"),
        "mixing_layer_32x32x32": ("2MB",),
    }
    return [
        frame_row(run, field, memory_budget=budget, rounds=2)
        for field in run.fields()
        for budget in budgets_of.get(field, ())
    ]


def sweep(run):
    """One row: what `frame_bench --budgets` writes."""
    quick = run.options.quick
    field = CPU_VOLUMES[0] if run.options.on_cpu else GPU_VOLUMES[1]
    run.run(
        "bench/frame_bench",
        run.volume(QUICK_VOLUMES[0] if quick else field),
        isovalue=128,
        size=(64, 48) if quick else (1280, 720),
        device=run.options.device,
        rounds=1 if quick else 2,
        orbit=2 if quick else None,
        budgets="auto:3" if quick else "auto:10",
        json="g.json",
    )
    return [what_was_measured(run.read_json("g.json"))]


def levels(run):
    rows = [
        frame_row(run, field, voxel_pixels=distance, cache_slots=slots_for(field), rounds=2)
        for field in run.fields()
        for distance in (0, 0.5, 1, 2)
    ]
    if run.options.on_cpu or run.options.quick:
        return rows
    largest = {"field": GPU_VOLUMES[-1], "samples": 2, "cache_slots": slots_for(GPU_VOLUMES[-1])}
    return rows + [frame_row(run, voxel_pixels=d, **largest, rounds=1) for d in (0, 1)]


def storage(run):
    rows = []
    for kept in (("--rate", "4"), ("--tolerance", "4"), ("--tolerance", "1"), ("--exact",)):
        row = frame_row(run, run.fields()[0], storage=kept)
        info = run.info(run.volume(row["volume"], *kept))
        rows.append({**row, "max_voxel_error": info["max_voxel_error"]})
    return rows


def orbit(run, field, **options):
    """The frames of an orbit but the first, as `isowave render --stats` says."""
    quick = run.options.quick
    run.run(
        "isowave",
        "render",
        run.volume(field),
        isovalue=128,
        size="64x48" if quick else "1280x720",
        orbit=2 if quick else 10,
        device=run.options.device,
        no_stage_times=True,
        stats="s.json",
        **options,
    )
    return run.read_json("s.json")["frames"][1:]


def error(run):
    rows = []
    for field in run.fields():
        for pixels in (0.25, 1, 2) if "shell" in field else (1,):
            drawn = orbit(run, field, max_surface_error=pixels)
            errors = [frame["error"] for frame in drawn]
            hits = max(sum(one["pixels"] for one in errors), 1)
            median = {
                name: statistics.median(one[name] for one in errors)
                for name in ("decoded_blocks", "median", "choice_ms", "bound_ms")
            }
            row = {
                "volume": field,
                "max_surface_error": pixels,
                "voxel_pixels": sorted({one["chosen"]["voxel_pixels"] for one in errors}),
                "total_ms": statistics.median(frame["total_ms"] for frame in drawn),
                "decoded_blocks": median["decoded_blocks"],
                "proven": sum(one["certified"] for one in errors) / hits,
                "unbounded": sum(one["uncertain"] for one in errors) / hits,
                "median_bound": median["median"],
                "choice_ms": median["choice_ms"],
                "bound_ms": median["bound_ms"],
            }
            rows.append(row)
    return rows


def time(run):
    rows = []
    budgets_ms = (20, 50, 200) if run.options.on_cpu else (1, 2, 3, 5, 10)
    for field in run.fields(*GPU_VOLUMES[1:4:2]):
        for budget in budgets_ms[:1] if run.options.quick else budgets_ms:
            drawn = orbit(run, field, time_budget=budget)
            steps = [frame["time_budget"] for frame in drawn]
            last = [step["steps"][-1]["size"][1] for step in steps]
            row = {
                "volume": field,
                "budget_ms": budget,
                "median_ms": statistics.median(frame["total_ms"] for frame in drawn),
                "max_ms": max(frame["total_ms"] for frame in drawn),
                "complete": sum(step["complete"] for step in steps),
                "frames": len(steps),
                "last_rows": {str(height): last.count(height) for height in sorted(set(last))},
            }
            rows.append(row)
    return rows


# Cases of every stem of kernels_cl.
KERNELS = (
    "(active_blocks|block_triangles|marching_cubes|noise_field|request_surface)/.*edge:256",
    "(ambient|bounce|field_values|hit_positions|initial_rays|kept_picture)/.*width:1280",
    "(march|request_ahead|resident)/.*width:1280",
    "(march_packets|shade|smooth_normals|start_and_march|start_rays)/.*width:1280",
    "block_cache/.*(uniform|hot)/width:1280/key_bits:18",
    "layers/.*width:1280",
    "composite/.*width:1280.*n_spec:(1|64)/",
    "group/.*slot_bits:18/visible_bits:14",
    "intersect/width:1280",
    "macrocells/.*rate:4",
    "prefix_sum/entries:1048576",
    "radix_sort/.*key_bits:18",
    "rasterise/edge:256/width:1280",
    "scan/(exclusive/entries:1800|.*width:1280)",
    "speculation",
    "traverse/width:1280/edge:256/n_spec:8/",
    "zfp_decode/.*rate:(1|4|16)",
    "zfp_decode/whole_numbers",
    "zfp_encode/.*rate:4",
)


def kernels(run):
    wanted = "scan/exclusive/entries:450" if run.options.quick else "|".join(KERNELS)
    run.run(
        "bench/isowave_bench",
        f"--benchmark_filter={wanted}",
        "--benchmark_min_time=0.1",
        "--benchmark_out=k.json",
        device=run.options.device,
    )
    to_ms = {"ns": 1e-6, "us": 1e-3, "ms": 1, "s": 1e3}
    rows = []
    for case in run.read_json("k.json")["benchmarks"]:
        if case.get("run_type", "iteration") != "iteration" or case.get("error_occurred"):
            continue
        name = re.sub("/(manual_time|real_time|iterations:[0-9]+)", "", case["name"])
        ms = case["real_time"] * to_ms[case["time_unit"]]
        row = {"name": name, "ms": ms}
        for kept in ("items_per_second", "bytes_per_second", "of_ceiling_%"):
            row[kept] = case.get(kept)
        rows.append(row)
    return rows


# As tests/pocl_as_cpu.cpp knows them; None: the machine's own.
CPUS = (None, "haswell", "athlon64")


def cpus(run):
    """PoCL told to compile for CPUs that can do less than this one, in turns."""
    turns = {}
    for field in run.fields():
        for cpu in 3 * (CPUS[:1] if run.options.quick else CPUS):
            environment = {}
            if cpu:
                environment["LD_PRELOAD"] = str(run.options.programs / AS_CPU)
                environment["POCL_AS_CPU"] = cpu
                environment["POCL_CACHE_DIR"] = str(run.work / f"kernels_as_{cpu}")
            row = frame_row(run, field, rounds=1, environment=environment)
            device = run.read_json("f.json")["context"]["device"]
            if cpu and not device.startswith(f"pthread-{cpu}-"):
                raise Failed(f"PoCL does not compile for {cpu}: its device is {device}")
            turns.setdefault((field, cpu, device), []).append(row)
    return [
        {
            "volume": field,
            "told": cpu,
            "device": device,
            **{
                kind: {
                    "median": statistics.median(row[kind]["median"] for row in rows),
                    "min": min(row[kind]["min"] for row in rows),
                    "max": max(row[kind]["max"] for row in rows),
                }
                for kind in ("cold", "next", "warm")
            },
        }
        for (field, cpu, device), rows in turns.items()
    ]


def peer(run):
    quick = run.options.quick
    run.run(
        "bench/peer_bench",
        dims=32 if quick else (256, 512),
        rounds=1 if quick else 5,
        views=3 if quick else 100,
        size="64x48" if quick else "1280x720",
        device=run.options.device,
        json="p.json",
    )
    return [
        {
            "volume": size["volume"].removeprefix("generate:").removesuffix("_uint8"),
            "side": side,
            "load": [size["load_average_before"][0], size["load_average_after"][0]],
            "ms": {
                name: measured[f"{name}_ms"]
                for name in ("new", "new_kept", "warm", "next")
                if f"{name}_ms" in measured
            },
            "cpu_ms": {
                name: measured[f"{name}_cpu_ms"]
                for name in ("new", "new_kept", "warm", "next")
                if f"{name}_cpu_ms" in measured
            },
            "open_ms": measured.get("open_ms"),
            "peak": measured["peak_byte_count"]["max"],
            "of_files": measured["file_byte_count"]["max"],
            "views": {
                "count": size["views"]["count"],
                "total_ms": size["views"]["sides"][side]["total_ms"],
                "overtaken_after": size["views"]["sides"][side].get("overtaken_after", {}),
            },
        }
        for size in run.read_json("p.json")["sizes"]
        for side, measured in size["sides"].items()
    ]
