"""Sections of tools/measure that ask what is right. Each returns the rows of its section."""

import gzip
import json
import math
import os
import shlex
import statistics
import subprocess

from measuring.run import (
    CPU_VOLUMES,
    GPU_VOLUMES,
    QUICK_VOLUMES,
    TOP,
    Failed,
    as_arguments,
    short_name,
    what_was_measured,
)


def watertight(run):
    run.run(
        "isowave",
        "verify",
        solver="bernstein",
        rays=100,
        watertight=1000 if run.options.quick else 2000000,
        device=run.options.device,
        json="w.json",
    )
    totals = {}
    for case in run.read_json("w.json")["solvers"][0]["watertight"]:
        total = totals.setdefault((case["by"], "levels" in case["surface"]), [0, 0])
        total[0] += case["rays"]
        total[1] += case["leaks"]
    return [
        {"by": by, "levels": with_levels, "rays": rays, "leaks": leaks}
        for (by, with_levels), (rays, leaks) in totals.items()
    ]


def stability(run):
    """A row for each case of the suite, and one for each surface of the twin's watertight test."""
    run.run(
        "isowave",
        "verify",
        rays=50 if run.options.quick else 5000,
        watertight=1000 if run.options.quick else 300000,
        device=run.options.device,
        json="y.json",
    )
    solvers = run.read_json("y.json")["solvers"]
    rows = []
    for cases in zip(*(solver["cases"] for solver in solvers), strict=True):
        by_solver = {solver["solver"]: case for solver, case in zip(solvers, cases, strict=True)}
        default = by_solver["bernstein"]
        row = {
            "case": default["name"],
            "description": default["description"],
            "rays": default["rays"],
            "hits": default["hits"],
            "missed": {name: case["missed"] for name, case in by_solver.items()},
            "false": {name: case["false"] for name, case in by_solver.items()},
            "residual_p99": default["residual_voxels"]["p99"],
            "resumed_differently": sum(case["resumed_differently"] for case in cases),
        }
        rows.append(row)
    surfaces = {}
    for solver in solvers:
        for case in solver["watertight"]:
            if case["by"] != "twin":
                continue
            row = {"surface": case["surface"], "rays": case["rays"], "leaks": {}}
            row = surfaces.setdefault(case["surface"], row)
            row["leaks"][solver["solver"]] = case["leaks"]
    return rows + list(surfaces.values())


def bits(run):
    rows = []
    program = {"ISOWAVE": str(run.options.programs / "isowave")}
    for choice in ({}, {"pipeline": "blocks"}, {"stream": "host", "memory_budget": "100MB"}):
        script = [str(TOP / "tools/test-volumes"), str(run.options.volumes)]
        arguments = as_arguments(choice)
        options = ["--device", run.options.device, *arguments]
        said = subprocess.run(
            [*script, *options], capture_output=True, text=True, env={**os.environ, **program}
        )
        run.commands.append(shlex.join(["tools/test-volumes", "FOLDER", *options]))
        same = said.stdout.count("same bits: ")
        different = said.stdout.count("DIFFERENT: ")
        if same + different == 0:
            why = (said.stderr.strip() or "nothing drawn").splitlines()[-1]
            raise Failed(f"tools/test-volumes: {why}")
        rows.append({"arguments": arguments, "frames": same + different, "differ": different})
    return rows


def oracles(run):
    rows = []
    for path, isovalues in run.real_volumes():
        run.run(
            "isowave",
            "verify",
            path,
            isovalue=isovalues[1],
            rate=8,
            size="640x360",
            device=run.options.device,
            json="v.json",
        )
        judged = {frame["oracle"]: frame for frame in run.read_json("v.json")["frames"]}
        row = {
            "volume": short_name(path),
            "isovalue": isovalues[1],
            "rays": judged["roots"]["rays"],
            "hits": judged["roots"]["hits"],
            "missed": {oracle: frame["missed"] for oracle, frame in judged.items()},
            "false": {oracle: frame["false"] for oracle, frame in judged.items()},
            "unstable": {oracle: frame["unstable"] for oracle, frame in judged.items()},
            "residual_p99": judged["roots"]["residual_voxels"]["p99"],
        }
        rows.append(row)
    return rows


def certified(run):
    rows = []
    for storage in (("--rate", "8"), ("--tolerance-relative", "0.004")):
        for path, isovalues in run.real_volumes():
            run.run(
                "isowave",
                "verify",
                path,
                *storage,
                isovalue=list(isovalues),
                size="640x360",
                orbit=2,
                max_surface_error=1,
                device=run.options.device,
                json="c.json",
            )
            frames = run.read_json("c.json")["frames"]
            drawn = max(sum(frame["pixels"] for frame in frames), 1)
            slack = [frame["slack"]["p50"] for frame in frames if frame["slack"]]
            row = {
                "volume": short_name(path),
                "storage": list(storage),
                "frames": len(frames),
                "proven": sum(frame["certified"] for frame in frames) / drawn,
                "unbounded": sum(frame["uncertain"] for frame in frames) / drawn,
                "exceeded": sum(frame["exceeded"] for frame in frames),
                "bound_over_error": statistics.median(slack),
            }
            rows.append(row)
    return rows


def sizes(run):
    def convert(path, **storage):
        run.run("isowave", "convert", path, output="z.zfp", **storage)
        info = run.info("z.zfp", remember=False)
        return info["file_bytes"], info["max_voxel_error"]

    rows = []
    for path, _ in run.real_volumes():
        if path.suffix != ".gz":
            continue
        voxels = gzip.decompress(path.read_bytes())
        packed = len(gzip.compress(voxels, 9))
        row = {"volume": short_name(path), "raw": len(voxels), "gzip": packed, "rates": []}
        for rate in (2, 4, 8):
            size, error = convert(path, rate=rate)
            bounded = convert(path, tolerance=repr(error))[0] if error > 0 else None
            row["rates"].append({"rate": rate, "bytes": size, "error": error, "bounded": bounded})
        row["exact"] = convert(path, exact=True)[0]
        rows.append(row)
    run.commands = ["isowave convert VOLUME -o z.zfp --rate 2 (4, 8), --tolerance ERROR, --exact"]
    return rows


VIEWS = 2
# Rays a pixel along each axis, and --voxel-pixels. The first is what the others are compared with.
DETAIL_PICTURES = ((4, 0), (1, 0), (1, 0.5), (1, 1), (2, 0), (2, 0.25), (2, 0.5), (2, 1))


def picture_errors(run, wanted, got):
    """(root mean square of 8-bit colours, FLIP), over all views."""
    squares, flips = [], []
    for a, b in zip(wanted, got, strict=True):
        said = run.run("isowave", "compare", a, b, json=True, remember=False)
        compared = json.loads(said)
        psnr = compared["psnr_db"]
        squares.append(0.0 if psnr is None else 255.0**2 * 10 ** (-psnr / 10))
        flips.append(compared["flip"])
    return math.sqrt(statistics.mean(squares)), statistics.mean(flips)


def detail(run):
    """A row for each picture of few rays, compared with one of 16 rays a pixel."""
    rows = []
    for path, isovalues in run.real_volumes("aneurism", "bonsai", "engine", "cthead", "ch2"):
        run.run("isowave", "convert", path, output="d.zfp", rate=16, levels="all", no_verify=True)
        wanted = None
        for samples, distance in DETAIL_PICTURES:
            name = f"{short_name(path)}_{samples}_{distance}"
            run.run(
                "isowave",
                "render",
                "d.zfp",
                isovalue=isovalues[1],
                size="16x12" if run.options.quick else "64x48",
                orbit=VIEWS,
                samples=samples,
                voxel_pixels=distance,
                device=run.options.device,
                no_stage_times=True,
                output=f"{name}.png",
                stats="s.json",
            )
            pictures = sorted(run.work.glob(f"{name}_*.png"))
            if len(pictures) != VIEWS:
                raise Failed(f"{name}: {len(pictures)} pictures of {VIEWS} views")
            if wanted is None:
                wanted = pictures
                continue
            frames = run.read_json("s.json")["frames"]
            rms, flip = picture_errors(run, wanted, pictures)
            row = {
                "volume": short_name(path),
                "isovalue": isovalues[1],
                "rays": samples**2,
                "voxel_pixels": distance,
                "rms": rms,
                "flip": flip,
                "decoded_blocks": sum(
                    one["decoded_blocks"] for frame in frames for one in frame["per_pass"]
                ),
            }
            rows.append(row)
    return rows


WAYS_OF_LARGE_VOLUMES = (
    "default,--samples 2,--samples 4,--samples 8,1/2 size,1/4 size,1/8 size,"
    "--voxel-pixels 1,--voxel-pixels 2,"
    "--voxel-pixels 4,--voxel-pixels 1 --samples 2,--voxel-pixels 1 --samples 4,--time-budget 2,"
    "--time-budget 5,--time-budget 10,--normals cell,--solver linear,BCMC"
)


WAYS_BESIDE_VTK = (
    "default,--samples 2,--samples 4,--samples 8,1/2 size,1/4 size,1/8 size,BCMC,"
    "--device host,--device host --samples 2,--device host --samples 4"
)


def drawn_by_others(run, volume, isovalue, options, with_vtk=False):
    """Draws a volume with the peers' programs that are there: names of JSON files for --peers."""
    is_large = "ways" in options  # floats of the largest would not fit
    sides = "texture_uint8" if is_large else "texture_uint8,nanovdb_float_ranges,nanovdb_fpn_ranges"
    program, chosen = "bench/gpu_peer", {"peers": sides}
    arguments = (volume,)
    if run.options.on_cpu:
        program, chosen = "bench/peer_bench", {"sides": "mesh_low"}
        arguments = ("--volume", volume)
    shown = {name: value for name, value in options.items() if name != "ways"}
    shown |= {"isovalue": isovalue, "pictures": "peers", "json": "peers/p.json"}
    (run.work / "peers").mkdir(exist_ok=True)
    others = []
    if (run.options.programs / program).exists():
        run.run(program, *arguments, **shown, **chosen)
        others += run.read_json("peers/p.json")["pareto_peers"]
    if with_vtk:
        name = str(volume)
        if name.startswith("generate:"):  # the package reads files
            name = run.volume(name[9:].removesuffix("_uint8"), "--exact")
        run.run_python(TOP / "bench/vtk_peer", name, **shown)
        others += run.read_json("peers/p.json")["pareto_peers"]
    others = [peer for peer in others if not peer["side"].startswith("isowave")]
    if not others:
        return {}
    (run.work / "peers" / "others.json").write_text(json.dumps({"pareto_peers": others}))
    return {"peers": "peers/others.json"}


def drawn_in_every_way(run, subjects, with_vtk=False, **options):
    """Rows of (volume, isovalue): what `isowave bench pareto` writes of it, and of peers."""
    rows = []
    for volume, isovalue in subjects:
        run.run(
            "isowave",
            "bench",
            "pareto",
            volume,
            isovalue=isovalue,
            **options,
            **drawn_by_others(run, volume, isovalue, options, with_vtk),
            device=run.options.device,
            json="o.json",
        )
        rows.append(what_was_measured(run.read_json("o.json")))
    return rows


def pareto(run):
    subjects = [(path, isovalues[0]) for path, isovalues in run.real_volumes("LIDC2")]
    subjects += [(path, isovalues[1]) for path, isovalues in run.real_volumes("bonsai")]
    if run.options.quick:
        ways = "default,--samples 2,1/2 size,--rate 2,--ambient 16,BCMC,--device host"
        return drawn_in_every_way(run, subjects, size="48x32", views=1, rounds=1, ways=ways)
    fields = CPU_VOLUMES if run.options.on_cpu else GPU_VOLUMES[:1]
    subjects += [(f"generate:{field}_uint8", 128) for field in fields]
    size = "640x360" if run.options.on_cpu else "1280x720"
    return drawn_in_every_way(run, subjects, size=size, views=3, rounds=3)


def vtk(run):
    """The same in fewer ways, beside VTK's isosurface mapper, which is slow on a CPU."""
    subjects = [(path, isovalues[0]) for path, isovalues in run.real_volumes("LIDC2")]
    subjects += [(path, isovalues[1]) for path, isovalues in run.real_volumes("bonsai")]
    if run.options.quick:
        ways = "default,--device host"
        return drawn_in_every_way(
            run, subjects[:1], with_vtk=True, size="48x32", views=1, rounds=1, ways=ways
        )
    field = (CPU_VOLUMES if run.options.on_cpu else GPU_VOLUMES)[0]
    subjects += [(f"generate:{field}_uint8", 128)]
    size = "640x360" if run.options.on_cpu else "1280x720"
    ways = WAYS_BESIDE_VTK
    return drawn_in_every_way(run, subjects, with_vtk=True, size=size, views=1, rounds=3, ways=ways)


def pareto_large(run):
    """The same of larger volumes, in fewer ways: each takes its time to store."""
    fields = QUICK_VOLUMES[:1] if run.options.quick else GPU_VOLUMES[1:4:2]
    size = "48x32" if run.options.quick else "1280x720"
    subjects = [(f"generate:{field}_uint8", 128) for field in fields]
    ways = "default,BCMC" if run.options.quick else WAYS_OF_LARGE_VOLUMES
    return drawn_in_every_way(run, subjects, size=size, views=2, rounds=3, ways=ways)


def topology(run):
    """A row for each volume: what `isowave bench topology` writes of it."""
    names = ("aneurism", "bonsai", "LIDC2", "vessel")
    rows = []
    for volume, isovalues in run.real_volumes(*names):
        run.run("isowave", "bench", "topology", volume, isovalue=isovalues[1], json="t.json")
        rows.append(what_was_measured(run.read_json("t.json")))
    return rows


def solvers(run):
    """One row: what `isowave bench solvers` writes."""
    names = ("aneurism", "bonsai", "engine", "cthead")
    subjects = [f"{path}:{isovalues[1]}" for path, isovalues in run.real_volumes(*names)]
    options = {"size": "1280x720", "rounds": 15}
    if run.options.quick:
        options = {"size": "96x64", "rounds": 2}
    else:
        subjects.append(f"{run.volume(run.fields()[0])}:128")
        if run.options.on_cpu:
            options = {"size": "640x360", "rounds": 7}
    device = run.options.device
    run.run(
        "isowave", "bench", "solvers", *subjects, rate=8, **options, device=device, json="b.json"
    )
    return [what_was_measured(run.read_json("b.json"))]
