"""The section `paper` of tools/measure: the evaluation of Usher, Dyken and Kumar (LDAV 2023), on
our pipelines and Block-Compressed Marching Cubes (BCMC). paper_tables.py has its tables."""

import json
import shutil
import time
from dataclasses import dataclass

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


def data_set_of(row):
    """The article's name of what a row stands for, or is; None: it has no such set."""
    if "stands_for" in row:
        return row["stands_for"] if row["stands_for"] in ARTICLE else None
    return in_collection(row["volume"])


def article_of(row):
    """What the article says of the row's data set, or None."""
    return ARTICLE.get(data_set_of(row))


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
