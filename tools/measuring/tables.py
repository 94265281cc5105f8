"""The tables that tools/tables writes: each takes the rows of a section of tools/measure, and gives
its own, the head first."""

import pathlib
import statistics

from measuring import bricks, gpu_peers, paper_article, paper_tables
from measuring.cells import mebibytes, ms, name_of, percent
from measuring.fronts import front_of


def option(row, name):
    """The value of an option among the row's arguments; None if it is not given."""
    arguments = row["arguments"]
    return arguments[arguments.index(name) + 1] if name in arguments else None


def thrice(row):
    """Times until the picture is in the host's memory; in brackets, until hits are on the device.
    Rows of old measurements have the latter alone, without brackets."""

    def cell(kind):
        picture = ms(row[kind]["median"])
        return f"{picture} ({ms(row['hits'][kind])})" if "hits" in row else picture

    return [cell(kind) for kind in ("cold", "next", "warm")]


def frames(rows):
    times = ("cold ms", "next", "warm", "cold, of all views", "floor")
    yield "volume", "pipeline", *times, "blocks decoded", "device memory"
    for row in rows:
        cold = row["cold"]
        yield (
            name_of(row["volume"]),
            option(row, "--pipeline"),
            *thrice(row),
            f"{ms(cold['min'])} to {ms(cold['max'])}",
            ms(row["floor"]) if row["floor"] else "",
            f"{row['decoded_blocks']:,.0f}",
            mebibytes(row["memory"]),
        )


def normals(rows):
    """Each volume has a row for each kind of normals, the cells' own first."""
    yield "volume", "normals", "cold ms", "next", "warm", "blocks decoded", "cold", "next", "warm"
    for row in rows:
        kind = option(row, "--normals")
        if kind == "cell":
            cell = row
        more = [
            f"{100 * (row[turn]['median'] / cell[turn]['median'] - 1):+.0f} %"
            for turn in ("cold", "next", "warm")
        ]
        yield (
            name_of(row["volume"]),
            f"`{kind}`",
            *thrice(row),
            f"{row['decoded_blocks']:,.0f}",
            *(["", "", ""] if kind == "cell" else more),
        )


def ambient(rows):
    """Each volume has a row for each number of rays, 0 first. What a ray takes: of warm frames."""
    yield "volume", "ambient rays", "cold ms", "next", "warm", "of a warm frame, each ray"
    for row in rows:
        n = int(option(row, "--ambient"))
        if n == 0:
            without = row
        each = (row["warm"]["median"] - without["warm"]["median"]) / max(n, 1)
        yield name_of(row["volume"]), n, *thrice(row), ms(each) if n else ""


def scenes(rows):
    """Each volume has a row for each scene, one opaque surface first."""
    yield "volume", "scene", "cold ms", "next", "warm", "warm, of one surface", "device memory"
    first = {}
    for row in rows:
        arguments = row["arguments"]
        count, planes = option(row, "--surfaces"), arguments.count("--clip")
        if row["volume"] not in first:
            first[row["volume"]] = row["warm"]["median"]
        scene = "one opaque surface"
        if option(row, "--light") is not None:
            shadow, bounce = option(row, "--shadow"), option(row, "--bounce")
            kinds = {None: "a light", "1": "hard shadows"}
            kind = kinds.get(shadow, f"soft shadows of {shadow} rays")
            scene += ", " + (kind if bounce is None else f"light that bounces by {bounce} rays")
        if option(row, "--values-of") is not None:
            scene += ", colours by a second volume"
        if slices := arguments.count("--slice"):
            scene += f", {slices} slice" + ("s" if slices > 1 else "")
        if count is not None:
            opacity = float(option(row, "--opacity"))
            scene = f"{count} in layers, opacity {opacity:g}" + scene.removeprefix(
                "one opaque surface"
            )
        if planes:
            far = "-100000" in " ".join(arguments)
            scene += ", a plane that cuts nothing" if far else f", {planes} planes with caps"
        yield (
            name_of(row["volume"]),
            scene,
            *thrice(row),
            f"{row['warm']['median'] / first[row['volume']]:.1f}",
            mebibytes(row["memory"]),
        )


def speculation(rows):
    yield "pipeline", "speculation", "cold ms", "next", "warm", "passes", "blocks decoded"
    for row in rows:
        yield (
            option(row, "--pipeline"),
            f"`{option(row, '--speculation')}`",
            *thrice(row),
            f"{row['passes']:.0f}",
            f"{row['decoded_blocks']:,.0f}",
        )


def slots(rows):
    yield "volume", "pipeline", "slots", "stream", "cold ms", "next", "warm", "blocks decoded"
    for row in rows:
        yield (
            name_of(row["volume"]),
            option(row, "--pipeline") or "rays",
            f"{int(option(row, '--cache-slots')):,}",
            option(row, "--stream") or "device",
            *thrice(row),
            f"{row['decoded_blocks']:,.0f}",
        )


def budgets(rows):
    yield "volume", "budget", "booked", "cold ms", "next", "warm", "blocks decoded"
    for row in rows:
        yield (
            name_of(row["volume"]),
            option(row, "--memory-budget"),
            mebibytes(row["memory"]),
            *thrice(row),
            f"{row['decoded_blocks']:,.0f}",
        )


def levels(rows):
    yield "volume", "rays a pixel", "`--voxel-pixels`", "cold ms", "next", "warm", "blocks decoded"
    for row in rows:
        samples = int(option(row, "--samples") or 1)
        yield (
            name_of(row["volume"]),
            f"{samples * samples}",
            option(row, "--voxel-pixels"),
            *thrice(row),
            f"{row['decoded_blocks']:,.0f}",
        )


def storage(rows):
    yield "stored with", "largest error", "bits a voxel", "cold ms", "next", "warm"
    for row in rows:
        yield (
            f"`{' '.join(row['storage'])}`",
            f"{row['max_voxel_error']:.3g}",
            f"{row['bits_per_voxel']:.2f}",
            *thrice(row),
        )


def error(rows):
    yield (
        "volume",
        "P",
        "chosen `--voxel-pixels`",
        "ms",
        "blocks decoded",
        "proven",
        "no bound",
        "choose / prove, ms",
    )
    for row in rows:
        chosen = row["voxel_pixels"]
        span = f"{chosen[0]:.3g}" + (f" to {chosen[-1]:.3g}" if len(chosen) > 1 else "")
        yield (
            name_of(row["volume"]),
            f"{row['max_surface_error']:g}",
            span,
            ms(row["total_ms"]),
            f"{row['decoded_blocks']:,.0f}",
            percent(row["proven"]),
            percent(row["unbounded"]),
            f"{row['choice_ms']:.0f} / {row['bound_ms']:.0f}",
        )


def time(rows):
    times = ("budget, ms", "median ms", "largest ms")
    yield "volume", *times, "whole pictures", "rows of the last step"
    for row in rows:
        last = ", ".join(f"{height} ({count})" for height, count in row["last_rows"].items())
        yield (
            name_of(row["volume"]),
            f"{row['budget_ms']:g}",
            ms(row["median_ms"]),
            ms(row["max_ms"]),
            f"{row['complete']} of {row['frames']}",
            last,
        )


def kernels(rows):
    yield "case of `isowave_bench`", "ms", "G items/s", "GB/s", "of the ceiling"
    for row in rows:

        def per_second(key, digits):
            rate = row.get(key)
            return f"{rate / 1e9:.{digits}f}" if rate else ""

        share = row.get("of_ceiling_%")
        yield (
            f"`{row['name']}`",
            f"{row['ms']:.3f}",
            per_second("items_per_second", 2),
            per_second("bytes_per_second", 1),
            f"{share:.1f} %" if share else "",
        )


def watertight(rows):
    yield "drawn by", "levels of detail", "rays", "leaks"
    for row in rows:
        yield row["by"], "yes" if row["levels"] else "no", f"{row['rays']:,}", f"{row['leaks']:,}"


def bits(rows):
    yield "options", "frames", "with a bit that differs"
    for row in rows:
        yield f"`{' '.join(row['arguments'])}`" if row["arguments"] else "", row["frames"], row[
            "differ"
        ]


def oracles(rows):
    yield (
        "volume, isovalue",
        "rays",
        "hits",
        "roots: missed, false",
        "cells: missed, false",
        "mesh: missed, false",
        "unstable",
        "distance of hits, p99, voxels",
    )
    for row in rows:
        judged = [
            f"{row['missed'][oracle]}, {row['false'][oracle]}"
            for oracle in ("roots", "cells", "mesh")
        ]
        yield (
            f"{row['volume']}, {row['isovalue']}",
            f"{row['rays']:,}",
            f"{row['hits']:,}",
            *judged,
            max(row["unstable"].values()),
            f"{row['residual_p99']:.1e}",
        )


def certified(rows):
    yield (
        "volume",
        "stored with",
        "frames",
        "proven",
        "no bound",
        "bound / error, median",
        "bounds exceeded",
    )
    for row in rows:
        yield (
            row["volume"],
            f"`{' '.join(row['storage'])}`",
            row["frames"],
            percent(row["proven"]),
            percent(row["unbounded"]),
            f"{row['bound_over_error']:.1f}",
            row["exceeded"],
        )


def sizes(rows):
    yield ("volume", "rate 2: bytes / bounded", "rate 4", "rate 8", "`--exact`", "gzip -9", "raw")
    for row in rows:
        rates = [
            f"{rate['bytes']:,} / {rate['bounded']:,}" if rate["bounded"] else f"{rate['bytes']:,}"
            for rate in row["rates"]
        ]
        exact = f"{row['exact']:,}" if row["exact"] else ""
        yield row["volume"], *rates, exact, f"{row['gzip']:,}", f"{row['raw']:,}"


def stability(rows):
    cases = [row for row in rows if "case" in row]
    solvers = cases[0]["missed"]
    yield "case", "what is hard", "hits", *solvers, "residual p99"
    for row in cases:
        wrong = [f"{row['missed'][name]:,} / {row['false'][name]:,}" for name in solvers]
        hits = f"{row['hits']:,} of {row['rays']:,}"
        yield row["case"], row["description"], hits, *wrong, f"{row['residual_p99']:.0e}"


def leaks(rows):
    surfaces = [row for row in rows if "surface" in row]
    solvers = surfaces[0]["leaks"]
    yield "surface", "rays", *solvers
    for row in surfaces:
        yield row["surface"], f"{row['rays']:,}", *(f"{row['leaks'][name]:,}" for name in solvers)


def cpus(rows):
    """Ratios are those of the machine's own CPU, of the same volume."""
    kinds = ("cold", "next", "warm")
    yield "volume", "kernels compiled for", "cold ms", "next", "warm", "of the first row's"
    own = {}
    for row in rows:
        first = own.setdefault(row["volume"], row)
        ratios = [row[kind]["median"] / first[kind]["median"] for kind in kinds]
        yield (
            name_of(row["volume"]),
            row["device"].removeprefix("pthread-").rsplit("-", 1)[0],
            *(
                f"{ms(row[kind]['median'])} ({ms(row[kind]['min'])} to {ms(row[kind]['max'])})"
                for kind in kinds
            ),
            "" if row is first else ", ".join(f"{ratio:.2f}" for ratio in ratios),
        )


def peer(rows):
    sides = {
        "host": "without OpenCL",
        "rays": "pipeline rays",
        "blocks": "pipeline blocks",
        "mesh_low": "Flying Edges, Embree (low quality)",
        "mesh_medium": "Flying Edges, Embree (medium quality)",
    }
    kinds = ("new", "new_kept", "warm", "next")
    views = next((row["views"]["count"] for row in rows if "views" in row), None)
    with_files = all("of_files" in row for row in rows)
    yield (
        "volume",
        "side",
        "new isovalue, nothing decoded, ms",
        "new isovalue, cache kept",
        "same view",
        "next view",
        "memory of the process (of it files)" if with_files else "memory of the process",
        *((f"{views} views from a new isovalue on", "the peer is ahead") if views else ()),
    )
    for row in rows:
        spreads = [row["ms"].get(kind) for kind in kinds]
        times = [
            f"{ms(one['median'])} ({ms(one['min'])} to {ms(one['max'])})" if one else ""
            for one in spreads
        ]
        memory = mebibytes(row["peak"])
        if with_files:
            memory += f" ({mebibytes(row['of_files'])})"
        cells = [name_of(row["volume"]), sides[row["side"]], *times, memory]
        if views:
            counts = [count for count in row["views"]["overtaken_after"].values() if count]
            is_peer = row["side"].startswith("mesh")
            cells.append(f"{row['views']['total_ms'] / 1000:.1f} s")
            cells.append("" if is_peer else f"from view {min(counts)} on" if counts else "never")
        yield cells


def detail(rows):
    pictures = list(dict.fromkeys((row["rays"], row["voxel_pixels"]) for row in rows))
    titles = [f"{rays} ray{'s' * (rays > 1)}, {distance:g}" for rays, distance in pictures]
    yield "volume, isovalue", *titles
    volumes = {}
    for row in rows:
        cell = f"{row['rms']:.2f} ({row['flip']:.3f}), {row['decoded_blocks']:,}"
        cells = volumes.setdefault(f"{row['volume']}, {row['isovalue']:g}", {})
        cells[row["rays"], row["voxel_pixels"]] = cell
    for volume, cells in volumes.items():
        yield volume, *(cells[picture] for picture in pictures)


def subject(row):
    """Such as "bonsai, 40", of a file's or a synthetic volume's name."""
    name = pathlib.PurePath(row["volume"]).name.removeprefix("generate:")
    if name.startswith("mixing_layer"):
        return f"mixing layer, {row['isovalue']:g}"
    return f"{name.split('_')[0].split('.')[0]}, {row['isovalue']:g}"


def solvers(rows):
    cells = rows[0]["cells"]
    yield "solver", "steps", "ns a test", "missed", "false", "error p99, voxels"
    for entry in cells["entries"]:
        counts = [f"{entry[name]:,}" for name in ("missed", "false")]
        ns = f"{entry['ns']:.4f}" if entry["ns"] < 1 else f"{entry['ns']:.1f}"
        yield entry["solver"], entry["steps"], ns, *counts, f"{entry['p99']:.0e}"


def solver_frames(rows):
    frames_of = rows[0]["frames"]
    yield "solver", "steps", *(f"{subject(frame)}" for frame in frames_of)
    for entries in zip(*(frame["entries"] for frame in frames_of)):
        cells = [f"{entry['ms']:.3g}: {entry['missed'] + entry['false']:,}" for entry in entries]
        yield entries[0]["solver"], entries[0]["steps"], *cells


def of_size(row):
    """Such as "mixing layer 512^3, 128" of the volume and the isovalue."""
    name, isovalue = subject(row).rsplit(", ", 1)
    dims = row["dims"]
    size = f"{dims[0]}^3" if len(set(dims)) == 1 else " x ".join(str(dim) for dim in dims)
    return f"{name} {size}, {isovalue}"


def way(point):
    return f"`{point['way']}`" if point["way"].startswith("-") else point["way"]


def pareto(rows):
    """The fronts of time and error."""
    yield (
        "volume, isovalue",
        "way to draw",
        "ms, next",
        "ms, new",
        "FLIP",
        "wrong pixels",
        "MB to draw",
    )
    for row in rows:
        for point in front_of(row["points"], "next_ms", "flip"):
            yield (
                of_size(row),
                way(point),
                ms(point["next_ms"]),
                "" if point["cold_ms"] is None else ms(point["cold_ms"]),
                f"{point['flip']:.4f}",
                f"{100 * point['wrong_pixels']:.2g} %",
                f"{point['memory_bytes'] / 1e6:,.0f}",
            )


def pareto_large(rows):
    yield from pareto(rows)


def pareto_ways(rows):
    """Every way: ms of next frames and FLIP, a column for each volume."""
    yield "way to draw", *(f"{of_size(row)}: ms, FLIP" for row in rows)
    by_way = [{point["way"]: point for point in row["points"]} for row in rows]
    for name in dict.fromkeys(name for points in by_way for name in points):
        found = [points.get(name) for points in by_way]
        yield (
            way({"way": name}),
            *(f"{ms(p['next_ms'])}, {p['flip']:.4f}" if p else "" for p in found),
        )


def vtk(rows):
    yield from pareto_ways(rows)


def pareto_spans(rows):
    """The factors from one end of a front to the other, of time and FLIP, and of wrong pixels."""
    yield "volume, isovalue", "time", "FLIP", "wrong pixels"
    for row in rows:
        factors = []
        for name, error in (("next_ms", "flip"), ("flip", "flip"), ("wrong_pixels",) * 2):
            front = front_of(row["points"], "next_ms", error)
            least, most = (pick(point[name] for point in front) for pick in (min, max))
            factors.append(f"{most / least:,.0f}" if least > 0 else "")
        yield (of_size(row), *factors)


def topology(rows):
    yield (
        "volume, isovalue",
        "stored",
        "components",
        "Euler's characteristic",
        "lost (large)",
        "false (large)",
    )
    for row in rows:
        yield (
            of_size(row),
            "lossless",
            f"{row['components']:,} ({row['large']})",
            f"{row['euler']:,}",
            "",
            "",
        )
        for stored in row["rows"]:
            yield (
                "",
                f"`{stored['stored']}`" if stored["stored"].startswith("-") else stored["stored"],
                f"{stored['components']:,}",
                f"{stored['euler']:,}",
                f"{stored['lost']:,} ({stored['lost_large']})",
                f"{stored['false']:,} ({stored['false_large']})",
            )


def pareto_large_ways(rows):
    yield from pareto_ways(rows)


def pareto_large_spans(rows):
    yield from pareto_spans(rows)


# Name of a table -> (section of the JSON, table).
TABLES = {
    table.__name__: (section, table)
    for section, *tables in (
        ("frames", frames),
        ("normals", normals),
        ("ambient", ambient),
        ("scenes", scenes),
        ("speculation", speculation),
        ("slots", slots),
        ("budgets", budgets),
        ("levels", levels),
        ("storage", storage),
        ("error", error),
        ("time", time),
        ("kernels", kernels),
        ("watertight", watertight),
        ("stability", stability, leaks),
        ("cpus", cpus),
        ("peer", peer),
        ("gpu_peer", gpu_peers.gpu_peers),
        ("paper", *paper_article.TABLES, *paper_tables.TABLES),
        ("devices", paper_tables.by_device),
        *bricks.TABLES,
        ("bits", bits),
        ("oracles", oracles),
        ("certified", certified),
        ("sizes", sizes),
        ("detail", detail),
        ("solvers", solvers, solver_frames),
        ("pareto", pareto, pareto_ways, pareto_spans),
        ("pareto_large", pareto_large, pareto_large_ways, pareto_large_spans),
        ("topology", topology),
        ("vtk", vtk),
    )
    for table in tables
}
# Their rows are (name of the device, rows), of one or more.
OF_SEVERAL_DEVICES = ("by_device",)
