"""The section `paper` of tools/measure, and its tables: the evaluation of Usher, Dyken and Kumar
(LDAV 2023), on our pipelines and Block-Compressed Marching Cubes (BCMC)."""

import json
import shutil
import statistics
import time
from dataclasses import dataclass

from measuring.cells import ms, name_of
from measuring.run import short_name


@dataclass(frozen=True)
class Article:
    """What the article says of a data set: of frames of 1280 x 720, ten views of 100 isovalues.

    passes, n_spec  medians
    visible, utilisation  means [percent]: of all blocks, of pixels
    memory, cache   MB of 1000^2 bytes: of BCMC (None: it failed), of the raycaster
    rate            bits a voxel, if known: the file of Richtmyer-Meshkov is called .crate1
    total_ms        of a frame, if given
    """

    dims: str
    passes: int
    visible: float
    n_spec: int
    utilisation: float
    memory: tuple
    cache: tuple
    rate: int | None = None
    total_ms: int | None = None


# Its tables, by the names of the Open SciVis collection. It calls Magnetic Reconnection "Plasma".
ARTICLE = {
    "Skull": Article("256^3", 3, 2.09, 7, 30.71, (329, 109), (66.0, 16.9)),
    "TACC Turbulence": Article("256^3", 6, 4.12, 5, 51.32, (187, 108), (55.0, 16.0), total_ms=1269),
    "Magnetic Reconnection": Article(
        "512^3", 4, 1.56, 8, 49.00, (563, 191), (107, 44.7), total_ms=922
    ),
    "Kingsnake": Article("1024 x 1024 x 785", 4, 0.54, 13, 35.68, (1340, 607), (545, 145)),
    "Chameleon": Article("1024 x 1024 x 1080", 3, 0.34, 16, 29.55, (2090, 691), (375, 102)),
    "Beechnut": Article("1024 x 1024 x 1546", 7, 0.64, 13, 54.45, (None, 1060), (1990, 243)),
    "Miranda": Article("1024^3", 5, 0.83, 5, 60.22, (4200, 737), (1400, 167), total_ms=1466),
    "JICF-Q": Article("1408 x 1080 x 1100", 3, 0.25, 23, 27.15, (None, 1000), (None, 170)),
    "DNS": Article("1920 x 1440 x 288", 4, 2.61, 10, 53.94, (None, 875), (2020, 406)),
    "Richtmyer-Meshkov": Article(
        "2048 x 2048 x 1920",
        4,
        0.27,
        9,
        55.36,
        (None, 4190),
        (None, 522),
        rate=1,
        total_ms=1200,
    ),
}
# The article's means over its data sets. Memory, cache and blocks: BCMC's over those of rays.
FEWER_PASSES, LESS_TIME = 10, 4.8
LESS_MEMORY, SMALLER_CACHE, FEWER_BLOCKS = 3.1, 4.8, 6.7
DONE_BY_PASS_TWO, VISIBLE = 75, 1.3  # percent
# The authors' programs on an H100, with data, cameras and rate of their own, so an order of
# magnitude alone: ms of rays, and of BCMC cold and warm, by dims.
AUTHORS_PROGRAMS = {(512, 512, 512): (510, 291, 57), (1024, 1024, 1024): (586, 951, 218)}

# Synthetic volumes of the dims of the article's data sets, and of a like character. They are not
# these sets. The shell stands for none: it is what suits rays least.
STAND_INS = {
    "noisy_scan_256x256x256": "Skull",
    "turbulence_256x256x256": "TACC Turbulence",
    "shell_512x512x512": "",
    "turbulence_512x512x512": "Magnetic Reconnection",
    "scan_1024x1024x785": "Kingsnake",
    "mixing_layer_1024x1024x1024": "Miranda",
    "scan_1024x1024x1080": "Chameleon",
    "scan_1024x1024x1546": "Beechnut",
    "turbulence_1920x1440x288": "DNS",
    "jet_1408x1080x1100": "JICF-Q",
    "mixing_layer_2048x2048x1920": "Richtmyer-Meshkov",
}


def rate_of(data_set):
    """Bits a voxel that a data set is compressed with: the article's, or 4 if unknown."""
    return (data_set in ARTICLE and ARTICLE[data_set].rate) or 4


def in_collection(volume):
    """The article's name of a file's volume, by the first word of both; None: it has none."""
    for name in ARTICLE:
        if name.lower().replace("-", " ").split()[0] == volume.lower():
            return name
    return None


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
        name, seconds = make(run, field, rate_of(STAND_INS.get(field)))
        # 20 to 235 of 255: the synthetic volumes have surfaces there
        row = measure(run, field, name, {}, (20, 235), options)
        rows.append({**row, "stands_for": STAND_INS.get(field, ""), "made_s": seconds})
    for path, isovalues in run.every_volume():
        among = (min(isovalues), max(isovalues)) if isovalues else None
        rate = rate_of(in_collection(short_name(path)))
        storage = {} if path.suffix == ".zfp" else {"rate": rate}
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


def make(run, field, rate=4):
    """The synthetic volume's file, and how many seconds making and compressing it took."""
    name, log = f"{field}_rate_{rate}.zfp", run.work / f"{field}_rate_{rate}.seconds"
    if not log.exists():
        begin = time.monotonic()
        run.run(
            "isowave",
            "convert",
            f"generate:{field}_uint8",
            rate=rate,
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
    yield "volume", "stands for", "voxels, millions", "made and compressed in"
    for row in rows:
        if "made_s" not in row:
            continue
        x, y, z = row["dims"]
        yield (
            subject(row),
            data_set_of(row) or "",
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
    """A method of rays with `global` or per-ray speculation, never with `scanned`."""
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


def data_set_of(row):
    """The article's name of what a row stands for, or is; None: it has no such set."""
    if "stands_for" in row:
        return row["stands_for"] if row["stands_for"] in ARTICLE else None
    return in_collection(row["volume"])


def article_of(row):
    """What the article says of the row's data set, or None."""
    return ARTICLE.get(data_set_of(row))


def bits_a_voxel(row):
    x, y, z = row["dims"]
    return f"{8 * row['compressed_bytes'] / (x * y * z):.2f}"


def megabytes(value):
    """A number of the article's; None: failed."""
    return "failed" if value is None else f"{value:,}"


def beside_article(rows):
    """(name, what the article says, the row of that set or of its stand-in, or None)"""
    # A set itself goes before its stand-in.
    found = {data_set_of(row): row for row in sorted(rows, key=lambda row: "stands_for" not in row)}
    return [(name, article, found.get(name)) for name, article in ARTICLE.items()]


def paper_published_passes(rows):
    yield (
        "data set",
        "voxels",
        "measured on",
        "passes, median: article",
        "here",
        "visible blocks per pass: article",
        "here",
        "N_Spec, median: article",
        "here",
        "utilisation: article",
        "here",
    )
    for name, article, row in beside_article(rows):
        here = 4 * [""]
        if row:
            m = of_rays(row, "blocks")
            here = [
                f"{m['passes']['median']:.0f}",
                f"{100 * m['visible_blocks']['mean'] / row['blocks']:.2f} %",
                f"{m['n_spec']['median']:.0f}" if m["n_spec"] else "",
                f"{m['utilization_percent']['mean']:.1f} %",
            ]
        said = (
            f"{article.passes}",
            f"{article.visible:.2f} %",
            f"{article.n_spec}",
            f"{article.utilisation:.1f} %",
        )
        pairs = [cell for pair in zip(said, here) for cell in pair]
        yield name, article.dims, subject(row) if row else "not measured", *pairs


def paper_published_memory(rows):
    yield (
        "data set",
        "bits a voxel: article",
        "here",
        "BCMC, MB: article",
        "here",
        "rays, MB: article",
        "here",
        "here / article",
        "cache of BCMC, MB: article",
        "here",
        "cache of rays, MB: article",
        "here",
        "here / article",
    )
    for name, article, row in beside_article(rows):
        bits, bcmc, bcmc_cache = 3 * [""]
        ours, our_cache = 2 * [("", "")]
        if row:
            rays, mesh = of_rays(row, "rays"), growing(row)
            bits = bits_a_voxel(row)
            bcmc, bcmc_cache = (
                "refused" if mesh["refused"] else mb(mesh[f"{kind}_bytes"])
                for kind in ("device", "cache")
            )
            ours, our_cache = (
                (mb(count), f"{count / 1e6 / said:.2f}")
                for count, said in (
                    (rays["device_bytes"], article.memory[1]),
                    (rays["cache_bytes"], article.cache[1]),
                )
            )
        yield (
            name,
            f"{article.rate}" if article.rate else "",
            bits,
            megabytes(article.memory[0]),
            bcmc,
            megabytes(article.memory[1]),
            *ours,
            megabytes(article.cache[0]),
            bcmc_cache,
            megabytes(article.cache[1]),
            *our_cache,
        )


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
        "article: rays",
        "authors' programs, H100: rays",
        "BCMC cold, warm",
    )
    for row in rows:
        blocks, rays, mesh = of_rays(row, "blocks"), of_rays(row, "rays"), growing(row)
        article, programs = article_of(row), AUTHORS_PROGRAMS.get(tuple(row["dims"]))
        yield (
            subject(row),
            ms(blocks["cold_ms"]["median"]),
            ms(blocks["ms_per_pass"]["mean"]),
            ms(rays["cold_ms"]["median"]),
            ms(rays["ms_per_pass"]["mean"]),
            bcmc_time(mesh, "cold_ms"),
            bcmc_time(mesh, "new_ms"),
            bcmc_time(mesh, "next_ms"),
            f"{article.total_ms:,}" if article and article.total_ms else "",
            f"{programs[0]}" if programs else "",
            f"{programs[1]}, {programs[2]}" if programs else "",
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
    )
    for row in rows:
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
    """What the article claims of the mean over its data sets, beside each volume here."""
    yield "claim", "published, mean", "here: least", "mean", "most", "holds for"

    def line(claim, said, values, holds, form):
        if not values:
            return claim, said, "no volume", "", "", ""
        inside = sum(holds(value) for value in values)
        three = (form(v) for v in (min(values), statistics.mean(values), max(values)))
        return claim, said, *three, f"{inside} of {len(values)}"

    def times(value):
        return f"{value:.1f} times"

    def percent(value):
        return f"{value:.1f} %"

    def at_least(claim, said, values):
        return line(claim, f"{said} times", values, lambda value: value >= said, times)

    drawn = [row for row in rows if not growing(row)["refused"]]
    surfaces = [row for row in drawn if growing(row)["triangles"]["mean"] > 0]

    def without_over_with(name, kind):
        pairs = ((of_rays(row, "blocks", False), of_rays(row, "blocks")) for row in rows)
        return [off[name][kind] / looking_ahead[name][kind] for off, looking_ahead in pairs]

    second = [(of_rays(row, "blocks")["completed_percent"] + [100, 100])[1] for row in rows]
    visible = [
        100 * of_rays(row, "blocks")["visible_blocks"]["mean"] / row["blocks"] for row in rows
    ]

    def over(name, rays):
        return [growing(row)[name] / rays(row)[name] for row in drawn]

    def over_article(name, rays):
        said = [(row, article_of(row)) for row in rows if article_of(row)]
        which = "memory" if name == "device_bytes" else "cache"
        return [rays(row)[name] / 1e6 / getattr(article, which)[1] for row, article in said]

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
    fewer, less = without_over_with("passes", "mean"), without_over_with("cold_ms", "median")
    yield at_least("speculation: fewer passes", FEWER_PASSES, fewer)
    yield at_least("speculation: less total time", LESS_TIME, less)
    yield line(
        "pixels that are through by pass two",
        f"{DONE_BY_PASS_TWO} %",
        second,
        lambda value: value >= DONE_BY_PASS_TWO,
        percent,
    )
    yield line(
        "blocks that a pass sees", f"{VISIBLE} %", visible, lambda value: value <= VISIBLE, percent
    )
    both_ways = (("", ample), (", slots for a frame", tight))
    names = (("memory", "device_bytes", LESS_MEMORY), ("cache", "cache_bytes", SMALLER_CACHE))
    for slots, rays in both_ways:
        for what, name, said in names:
            yield at_least(f"{what}: BCMC's over `rays`{slots}", said, over(name, rays))
    yield at_least("blocks decoded: BCMC's over `rays`", FEWER_BLOCKS, decoded)
    for slots, rays in both_ways:
        for what, name, _ in names:
            values = over_article(name, rays)
            yield line(f"{what}: `rays` over the article's{slots}", "", values, at_most_one, times)
    yield line("first picture: BCMC's time over `rays`", "", first, lambda v: v >= 1, times)
    yield line("further pictures: `rays` over BCMC's", "", further, at_most_one, times)


def at_most_one(value):
    return value <= 1


TABLES = (
    paper_claims,
    paper_published_passes,
    paper_published_memory,
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
