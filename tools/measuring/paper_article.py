"""Tables of the section `paper` of tools/measure that stand beside what the article says."""

import statistics

from measuring.paper import (
    ARTICLE,
    DONE_BY_PASS_TWO,
    FEWER_BLOCKS,
    FEWER_PASSES,
    LESS_MEMORY,
    LESS_TIME,
    SMALLER_CACHE,
    VISIBLE,
    article_of,
    data_set_of,
)
from measuring.paper_tables import growing, mb, of_rays, subject, tight


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


def times(value):
    return f"{value:.1f} times"


def percent(value):
    return f"{value:.1f} %"


def at_most_one(value):
    return value <= 1


def claim_row(claim, said, values, holds, form):
    """A row of paper_claims(). values: of each volume; holds: whether one bears the claim out."""
    if not values:
        return claim, said, "no volume", "", "", ""
    inside = sum(holds(value) for value in values)
    three = (form(v) for v in (min(values), statistics.mean(values), max(values)))
    return claim, said, *three, f"{inside} of {len(values)}"


def at_least(claim, said, values):
    return claim_row(claim, f"{said} times", values, lambda value: value >= said, times)


def paper_claims(rows):
    """What the article claims of the mean over its data sets, beside each volume here."""
    yield "claim", "published, mean", "here: least", "mean", "most", "holds for"

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
    yield claim_row(
        "pixels that are through by pass two",
        f"{DONE_BY_PASS_TWO} %",
        second,
        lambda value: value >= DONE_BY_PASS_TWO,
        percent,
    )
    yield claim_row(
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
            yield claim_row(
                f"{what}: `rays` over the article's{slots}", "", values, at_most_one, times
            )
    yield claim_row("first picture: BCMC's time over `rays`", "", first, lambda v: v >= 1, times)
    yield claim_row("further pictures: `rays` over BCMC's", "", further, at_most_one, times)


TABLES = (
    paper_claims,
    paper_published_passes,
    paper_published_memory,
)
