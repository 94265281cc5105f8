"""The section `paper` of tools/measure, and its tables: the evaluation of Usher, Dyken and Kumar
(LDAV 2023), on our pipelines and Block-Compressed Marching Cubes (BCMC)."""

import json
import shutil
import time

from measuring.cells import ms, name_of
from measuring.run import short_name

# What was published, by dims; times in ms. `paper`: their article, an RTX 3080. `code`: their
# programs on an H100, with data, cameras and rate of their own, so an order of magnitude alone.
PUBLISHED = {
    (512, 512, 512): {"code": {"rays": 510, "rays_mb": 228, "bcmc": (291, 57), "bcmc_mb": 410}},
    (1024, 1024, 1024): {
        "code": {"rays": 586, "rays_mb": 1013, "bcmc": (951, 218), "bcmc_mb": 2094}
    },
    (2048, 2048, 1920): {"paper": {"rays": 1200, "per_pass": 264, "rays_mb": 4190}},
}


# Synthetic volumes of the dims of sets of the Open SciVis collection, and of a like character. They
# are not these sets.
STAND_INS = {
    "noisy_scan_256x256x256": "Skull",
    "shell_512x512x512": "",
    "turbulence_512x512x512": "Magnetic Reconnection",
    "mixing_layer_512x512x512": "",
    "noisy_scan_832x832x494": "Stag Beetle",
    "mixing_layer_1024x1024x1024": "Miranda",
    "scan_1024x1024x1080": "Chameleon",
    "scan_1024x1024x1546": "Beechnut",
    "jet_1408x1080x1100": "JICF-Q",
    "mixing_layer_2048x2048x1920": "Richtmyer-Meshkov",
}


def paper(run):
    """One row for each volume: what `isowave bench paper` says of it. What is in the folder of
    --work from a call that was cut short is not measured again."""
    rows = []
    small = {"isovalues": 4, "views": 3, "size": "640x360", "scaling": "320x180,960x540"}
    if run.options.quick:
        small = {"isovalues": 2, "views": 2, "size": "64x48", "scaling": "32x24", "limits": "1,64"}
    options = small if run.options.quick or run.options.on_cpu else {}
    fields = run.fields() if run.options.quick else STAND_INS
    if run.options.on_cpu and not run.options.quick:
        fields = run.fields()[:1]
    for field in fields:
        name, seconds = make(run, field)
        # 20 to 235 of 255: where the synthetic volumes have surfaces
        row = measure(run, field, name, {}, (20, 235), options)
        rows.append({**row, "stands_for": STAND_INS.get(field, ""), "made_s": seconds})
    for path, isovalues in run.every_volume():
        among = (min(isovalues), max(isovalues)) if isovalues else None
        storage = {} if path.suffix == ".zfp" else {"rate": 4}
        rows.append(measure(run, short_name(path), path, storage, among, options))
    return rows


DEVICE_FIELDS = (
    "mixing_layer_256x256x256",
    "shell_512x512x512",
    "mixing_layer_512x512x512",
)


def devices(run):
    """One row for each volume: what `isowave bench paper --quick` says, on any device."""
    options = {"quick": True}
    if run.options.quick:
        options |= {"isovalues": 1, "views": 2, "size": "64x48"}
    fields = run.fields() if run.options.quick else DEVICE_FIELDS
    if run.options.on_llvmpipe:  # which would take hours
        fields = fields[:1]
        options["isovalues"] = 1
    rows = []
    for field in fields:
        name, _ = make(run, field)
        rows.append(measure(run, field, name, {}, (20, 235), options))
    return rows


def make(run, field):
    """The synthetic volume's file, and how many seconds making and compressing it took."""
    name, log = f"{field}.zfp", run.work / f"{field}.seconds"
    if not log.exists():
        begin = time.monotonic()
        run.run(
            "isowave",
            "convert",
            f"generate:{field}_uint8",
            rate=4,
            no_verify=True,
            device=run.options.device,
            output=name,
        )
        log.write_text(f"{time.monotonic() - begin:.1f}")
    return name, float(log.read_text())


def measure(run, name, volume, storage, among, options):
    kept = run.work / f"paper_{name}_{run.commit}.json"
    part = run.work / "paper.json"
    asked = {**storage, "range": among, **options, "device": run.options.device}
    if not kept.exists():
        run.run("isowave", "bench", "paper", volume, **asked, json=part.name)
        shutil.move(part, kept)
    else:
        run.remember("isowave", "bench", "paper", volume, **asked, json=part.name)
    (said,) = json.loads(kept.read_text())["volumes"]
    said["volume"] = name
    said["isovalues"] = len(said["isovalues"])
    for method in said["methods"]:
        if isinstance(method.get("refused"), str):
            method["refused"] = method["refused"].splitlines()[0]
    return said


# ---- tables


def subject(row):
    """Such as "mixing layer 512^3", "bonsai"; synthetic ones are stand-ins."""
    name = row["volume"]
    return name_of(name) if name.endswith("x".join(map(str, row["dims"]))) else name


def paper_stand_ins(rows):
    yield "volume", "as large as", "voxels, millions", "made and compressed in"
    for row in rows:
        if "made_s" not in row:
            continue
        x, y, z = row["dims"]
        yield (
            subject(row),
            row["stands_for"],
            f"{x * y * z / 1e6:,.0f}",
            f"{row['made_s']:.1f} s",
        )


def mb(count):
    """MB of 1000^2 bytes, as the paper's."""
    return f"{count / 1e6:,.0f}" if count >= 1e8 else f"{count / 1e6:.1f}"


def methods(row, kind, size=None):
    """The row's results of one kind of method, of its first picture size or of another."""
    first = row["methods"][0]["size"]
    return [m for m in row["methods"] if m["method"] == kind and m["size"] == (size or first)]


def of_rays(row, kind, speculation=True, cache="default"):
    """Of those, the paper's way to look ahead, or the default's."""
    return next(
        m
        for m in methods(row, kind)
        if m["speculation"] == speculation
        and m["cache"] == cache
        and m.get("look_ahead") != "scanned"
    )


def looking(row):
    """Pipeline `blocks`, by how far its rays look ahead."""
    return {m.get("look_ahead"): m for m in methods(row, "blocks")}


def tight(row):
    """Rays with the slots that a frame needs."""
    return of_rays(row, "rays", cache="one frame")


def growing(row, size=None):
    return next(m for m in methods(row, "bcmc", size) if m["memory_budget"] == 0)


def bounded(row):
    return next(m for m in methods(row, "bcmc") if m["memory_budget"] != 0)


def published(row, source, name):
    return PUBLISHED.get(tuple(row["dims"]), {}).get(source, {}).get(name)


def both(mean, most):
    return f"{mean:,.0f} ({most:,.0f})"


def paper_passes(rows):
    yield (
        "volume",
        "speculation",
        "passes",
        "visible blocks per pass: mean (max)",
        "of all blocks",
        "N_Spec: median",
        "mean",
        "utilisation",
    )
    for row in rows:
        for speculation in (True, False):
            m = of_rays(row, "blocks", speculation)
            visible = m["visible_blocks"]
            yield (
                subject(row),
                "global" if speculation else "off",
                f"{m['passes']['mean']:.1f}",
                both(visible["mean"], visible["max"]),
                f"{100 * visible['mean'] / row['blocks']:.2f} %",
                f"{m['n_spec']['median']:.0f}" if m["n_spec"] else "",
                f"{m['n_spec']['mean']:.1f}" if m["n_spec"] else "",
                f"{m['utilization_percent']['mean']:.1f} %",
            )


def by_device(measured):
    """measured: of several devices, (name, rows)."""
    yield (
        "device",
        "volume",
        "`rays`: cold ms",
        "next",
        "`blocks`: cold ms",
        "next",
        "BCMC: cold ms",
        "further frame",
        "`rays`: MB",
        "BCMC: MB",
    )
    for device, rows in measured:
        for row in rows:
            mesh = growing(row)
            drawn = (of_rays(row, "rays"), of_rays(row, "blocks"), mesh)
            times = [ms(m[kind]["median"]) for m in drawn for kind in ("cold_ms", "next_ms")]
            yield device, subject(row), *times, mb(drawn[0]["device_bytes"]), mb(
                mesh["device_bytes"]
            )


def bcmc_time(method, name):
    return "refused" if method["refused"] else ms(method[name]["median"])


def paper_times(rows):
    yield (
        "volume",
        "`blocks`: cold ms",
        "each pass",
        "`rays`: cold ms",
        "each pass",
        "BCMC: cold ms",
        "new isovalue",
        "further frame",
        "published: rays",
        "published: BCMC cold, warm",
    )
    for row in rows:
        blocks, rays, mesh = of_rays(row, "blocks"), of_rays(row, "rays"), growing(row)
        article, code = published(row, "paper", "rays"), published(row, "code", "rays")
        bcmc = published(row, "code", "bcmc")
        yield (
            subject(row),
            ms(blocks["cold_ms"]["median"]),
            ms(blocks["ms_per_pass"]["mean"]),
            ms(rays["cold_ms"]["median"]),
            ms(rays["ms_per_pass"]["mean"]),
            bcmc_time(mesh, "cold_ms"),
            bcmc_time(mesh, "new_ms"),
            bcmc_time(mesh, "next_ms"),
            f"{article:,} (RTX 3080)" if article else f"{code} (H100)" if code else "",
            f"{bcmc[0]}, {bcmc[1]} (H100)" if bcmc else "",
        )


def paper_progress(rows):
    yield "volume", "pipeline", *(f"after pass {i}" for i in range(1, 6)), "of active rays: 1", "2"
    for row in rows:
        for kind in ("blocks", "rays"):
            m = of_rays(row, kind)
            progress = m["progress"]
            steps = [
                f"{done:.1f} %, {ms(at)} ms"
                for at, done in zip(progress["ms"], progress["completed_percent"])
            ]
            active = [f"{part:.1f} %" for part in m["completed_of_active_percent"]]
            yield (
                subject(row),
                f"`{kind}`",
                *(steps + 5 * [""])[:5],
                *(active + 2 * ["100 %"])[:2],
            )


def paper_utilisation(rows):
    yield "volume", "speculation", *(f"pass {i}" for i in (1, 2, 3, 4, 6, 8, 12, 16))
    for row in rows:
        for speculation in (True, False):
            parts = of_rays(row, "blocks", speculation)["utilization_by_pass"]
            cells = [f"{parts[i - 1]:.1f} %" if i <= len(parts) else "" for i in (1, 2, 3, 4, 6, 8)]
            cells += [f"{parts[i - 1]:.1f} %" if i <= len(parts) else "" for i in (12, 16)]
            yield subject(row), "global" if speculation else "off", *cells


def paper_scanned(rows):
    yield (
        "volume",
        "speculation",
        "passes",
        "N_Spec, mean",
        "utilisation",
        "blocks decoded",
        "cold ms",
        "of `global`",
    )
    for row in rows:
        ways = looking(row)
        for name in ("global", "scanned", "off") if "scanned" in ways else ():
            m = ways[name]
            part = m["cold_ms"]["median"] / ways["global"]["cold_ms"]["median"]
            yield (
                subject(row),
                f"`{name}`",
                f"{m['passes']['mean']:.2f}",
                f"{m['n_spec']['mean']:.1f}" if m["n_spec"] else "",
                f"{m['utilization_percent']['mean']:.1f} %",
                f"{m['active_blocks']['mean']:,.0f}",
                ms(m["cold_ms"]["median"]),
                f"{part:.2f}",
            )


def paper_limits(rows):
    """Blocks decoded for a cold frame, and in brackets its passes."""
    ways = [(row, way) for row in rows for way in row.get("limits", ())]
    limits = sorted({at["limit"] for _, way in ways for at in way["by_limit"]})
    yield "volume", "pipeline", "speculation", *(f"at most {limit}" for limit in limits)
    for row, way in ways:
        by_limit = {at["limit"]: at for at in way["by_limit"]}
        cells = [
            f"{by_limit[limit]['active_blocks']['mean']:,.0f} "
            f"({by_limit[limit]['passes']['mean']:.1f})"
            for limit in limits
        ]
        yield subject(row), f"`{way['method']}`", f"`{way['look_ahead']}`", *cells


def paper_working_set(rows):
    yield (
        "volume",
        "blocks",
        "pipeline",
        "blocks of a pass, mean (max)",
        "of all",
        "blocks of a cold frame, mean (max)",
        "cache slots",
    )
    for row in rows:
        for kind in ("blocks", "rays"):
            m = of_rays(row, kind)
            touched, active = m.get("touched_blocks"), m["active_blocks"]
            if not touched:
                continue
            yield (
                subject(row),
                f"{row['blocks']:,}",
                f"`{kind}`",
                both(touched["mean"], touched["max"]),
                f"{100 * touched['mean'] / row['blocks']:.2f} %",
                both(active["mean"], active["max"]),
                f"{m['cache_slots']:,}",
            )


def paper_memory(rows):
    yield (
        "volume",
        "compressed MB",
        "decoded MB",
        "`rays`: MB (cache)",
        "`rays`, slots for a frame",
        "cold ms",
        "`blocks`: MB (cache)",
        "BCMC: MB (cache)",
        "published rays, MB",
        "published BCMC, MB",
    )
    for row in rows:
        article, code = published(row, "paper", "rays_mb"), published(row, "code", "rays_mb")
        rays, few, blocks, mesh = (
            "refused" if m.get("refused") else f"{mb(m['device_bytes'])} ({mb(m['cache_bytes'])})"
            for m in (of_rays(row, "rays"), tight(row), of_rays(row, "blocks"), growing(row))
        )
        yield (
            subject(row),
            mb(row["compressed_bytes"]),
            mb(row["decoded_bytes"]),
            rays,
            few,
            ms(tight(row)["cold_ms"]["median"]),
            blocks,
            mesh,
            f"{article or code:,}" if article or code else "",
            f"{published(row, 'code', 'bcmc_mb'):,}" if code else "",
        )


def paper_blocks(rows):
    yield (
        "volume",
        "blocks",
        "`rays`: active, mean (max)",
        "`blocks`: active",
        "BCMC: active",
        "BCMC / `rays`",
        "triangles, mean",
        "bounded BCMC: MB",
        "parts",
        "each frame, ms",
        "pixels that agree",
    )
    for row in rows:
        rays, blocks, mesh, few = (
            of_rays(row, "rays"),
            of_rays(row, "blocks"),
            growing(row),
            bounded(row),
        )
        active = [
            "refused"
            if m.get("refused")
            else both(m["active_blocks"]["mean"], m["active_blocks"]["max"])
            for m in (rays, blocks, mesh)
        ]
        tight = 3 * ["refused"]
        if not few["refused"]:
            each = few["next_ms"] or few["new_ms"]
            tight = [mb(few["device_bytes"]), f"{few['parts']['max']:.0f}", ms(each["median"])]
        agreement = row["agreement"]
        yield (
            subject(row),
            f"{row['blocks']:,}",
            *active,
            "" if mesh["refused"] else ratio(mesh, rays),
            "" if mesh["refused"] else f"{mesh['triangles']['mean']:,.0f}",
            *tight,
            f"{agreement['percent']:.2f} %" if agreement else "",
        )


def ratio(mesh, rays):
    least = max(rays["active_blocks"]["mean"], 1)
    return f"{mesh['active_blocks']['mean'] / least:.1f}"


def paper_scaling(rows):
    yield (
        "volume",
        "picture",
        "`blocks`: cold ms",
        "`rays`: cold ms",
        "`rays`: active blocks",
        "BCMC: cold ms",
        "further frame",
    )
    for row in rows:
        sizes = sorted({tuple(m["size"]) for m in row["methods"]})
        for size in map(list, sizes):
            (blocks, *_), (rays, *_) = methods(row, "blocks", size), methods(row, "rays", size)
            mesh = growing(row, size)
            yield (
                subject(row),
                f"{size[0]} x {size[1]}",
                ms(blocks["cold_ms"]["median"]),
                ms(rays["cold_ms"]["median"]),
                f"{rays['active_blocks']['mean']:,.0f}",
                bcmc_time(mesh, "cold_ms"),
                bcmc_time(mesh, "next_ms"),
            )


def paper_claims(rows):
    """A claim holds for a volume where the number is at least, or at most, the claimed one."""
    yield "claim", "published", "here: least to most of the volumes", "holds for"

    def line(claim, said, values, holds, form):
        if not values:
            return claim, said, "no volume", ""
        inside = sum(holds(value) for value in values)
        text = f"{form(min(values))} to {form(max(values))}"
        return claim, said, text, f"{inside} of {len(values)}"

    def times(value):
        return f"{value:.1f} times"

    def percent(value):
        return f"{value:.1f} %"

    drawn = [row for row in rows if not growing(row)["refused"]]
    surfaces = [row for row in drawn if growing(row)["triangles"]["mean"] > 0]
    fewer = [
        of_rays(row, "blocks", False)["passes"]["mean"] / of_rays(row, "blocks")["passes"]["mean"]
        for row in rows
    ]
    second = [(of_rays(row, "blocks")["completed_percent"] + [100, 100])[1] for row in rows]
    visible = [
        100 * of_rays(row, "blocks")["visible_blocks"]["mean"] / row["blocks"] for row in rows
    ]

    def over(name, rays):
        return [growing(row)[name] / rays(row)[name] for row in drawn]

    def ample(row):
        return of_rays(row, "rays")

    decoded = [
        growing(row)["active_blocks"]["mean"]
        / max(of_rays(row, "rays")["active_blocks"]["mean"], 1)
        for row in surfaces
    ]
    first = [
        growing(row)["cold_ms"]["median"] / of_rays(row, "rays")["cold_ms"]["median"]
        for row in surfaces
    ]
    further = [
        of_rays(row, "rays")["next_ms"]["median"] / growing(row)["next_ms"]["median"]
        for row in surfaces
        if growing(row)["next_ms"]
    ]
    yield line("speculation: fewer passes", "5 times", fewer, lambda v: v >= 5, times)
    yield line("pixels that are through by pass two", "75 %", second, lambda v: v >= 75, percent)
    yield line("blocks that a pass sees", "near 1 %", visible, lambda v: v <= 1.5, percent)
    for slots, rays in (("", ample), (", slots for a frame", tight)):
        for name, said, least in (("device", "1.7 to 5.7", 1.7), ("cache", "4.8", 4.8)):
            what = "memory" if name == "device" else "cache"
            yield line(
                f"{what}: BCMC's over `rays`{slots}",
                said,
                over(f"{name}_bytes", rays),
                lambda value, least=least: value >= least,
                times,
            )
    yield line("blocks decoded: BCMC's over `rays`", "up to 8.4", decoded, lambda v: v >= 1, times)
    yield line("first picture: BCMC's time over `rays`", "", first, lambda v: v >= 1, times)
    yield line("further pictures: `rays` over BCMC's", "", further, lambda v: v <= 1, times)


TABLES = (
    paper_claims,
    paper_stand_ins,
    paper_passes,
    paper_times,
    paper_progress,
    paper_utilisation,
    paper_scanned,
    paper_limits,
    paper_working_set,
    paper_memory,
    paper_blocks,
    paper_scaling,
)
