"""Tables of the section `paper` of tools/measure (paper.py): our pipelines beside Block-Compressed
Marching Cubes (BCMC). paper_article.py has those with the article's numbers."""

from measuring.cells import ms, name_of
from measuring.paper import AUTHORS_PROGRAMS, article_of, data_set_of


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
            (
                "refused"
                if m.get("refused")
                else both(m["active_blocks"]["mean"], m["active_blocks"]["max"])
            )
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


TABLES = (
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
