"""Files that packages of Python read, in series, in `isowave view` and for the program."""

import json
import os
import pathlib
import signal
import subprocess
import sys
from dataclasses import replace

import file_writers as write
import numpy as np
import pytest
from file_writers import ORIGIN, SPACING, STEPS, VOXELS
from test_series import nrrd

import isowave
from isowave import _program
from isowave._arrays import as_source
from isowave._given_files import Given, given_files, take_option, write_nrrd
from isowave.viewer.command import make_parser, series_of


def command(*arguments, **more):
    """Runs the command that the wheel installs."""
    path = os.path.join(os.path.dirname(sys.executable), "isowave")
    return subprocess.run(
        [path, *map(str, arguments)], capture_output=True, text=True, check=False, **more
    )


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Where temporary files go; empty at the end."""
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    yield tmp_path
    assert [*temporary.iterdir()] == []


# series -----------------------------------------------------------------------------------------


def test_series_of_files(tmp_path):
    for t in (2, 10, 1):
        write.ome_tiff(tmp_path / f"s_{t}.ome.tif", VOXELS + t)
    for given in (tmp_path / "s_*.tif", [tmp_path / f"s_{t}.ome.tif" for t in (1, 2, 10)]):
        series = isowave.open_series(given, tolerance=0.25)
        assert [pathlib.Path(name).name for name in series.names] == [
            "s_1.ome.tif",
            "s_2.ome.tif",
            "s_10.ome.tif",
        ]
        assert [round(float(v[6, 4, 2])) for v in series] == [
            VOXELS[6, 4, 2] + t for t in (1, 2, 10)
        ]
        assert series[0].spacing == SPACING
    write.ome_tiff(tmp_path / "s_11.ome.tif", VOXELS[:, :4])
    with pytest.raises(isowave.Error, match="s_11.ome.tif: it has another grid than .*s_1.ome.tif"):
        isowave.open_series(tmp_path / "s_*.tif")
    with pytest.raises(isowave.Error, match="no file has such a name"):
        isowave.open_series(tmp_path / "q_*.tif")


def test_series_of_one_file(tmp_path):
    write.ome_tiff(tmp_path / "a.ome.tif", np.stack([STEPS, STEPS + 5], 1), "TCZYX")
    series = isowave.open_series(tmp_path / "a.ome.tif", index="c=1")
    assert series.names[2].endswith("a.ome.tif, step 2")
    assert [np.array_equal(v[...], s + 5) for v, s in zip(series, STEPS, strict=True)] == [True] * 3
    assert len(isowave.open_series(tmp_path / "a.ome.tif", index="c=1,t=2")) == 1


@pytest.mark.parametrize("name", ["a.nrrd", "a.nii.gz"])
def test_index_of_what_the_compiled_part_reads(tmp_path, name):
    steps = (STEPS + 100).astype("uint8")
    if name == "a.nrrd":
        nrrd(tmp_path / name, steps)
    else:
        write.nifti2(tmp_path / name, steps, "Nifti1Image")
    assert np.array_equal(isowave.open(tmp_path / name, index="t=1")[...], steps[1])
    series = isowave.open_series(tmp_path / name, index={"t": 2})
    assert len(series) == 1 and np.array_equal(series[0][...], steps[2])
    for index in ("t=3", "c=0", "t=0,c=0"):
        for opener in (isowave.open, isowave.open_series):
            with pytest.raises(isowave.Error, match=r"its further axes are t \(3 entries\)"):
                opener(tmp_path / name, index=index)
    with pytest.raises(isowave.Error, match="dataset ct: this file has one array"):
        isowave.open(tmp_path / name, dataset="ct", index="t=1")


def test_arrays_have_no_dataset_or_index():
    for option in ("dataset", "index"):
        with pytest.raises(TypeError, match="are for files"):
            isowave.open_series(STEPS, **{option: "t=1"})


# isowave view -----------------------------------------------------------------------------------


def test_view_takes_files_and_folders(tmp_path):
    parsed = make_parser().parse_args(["a.h5", "--dataset", "s/ct", "--index", "t=3,c=0"])
    assert (parsed.dataset, parsed.index) == ("s/ct", "t=3,c=0")
    write.tiff_folder(tmp_path / "layers")
    assert series_of([str(tmp_path / "layers")], {}) is None
    write.ome_tiff(tmp_path / "a.ome.tif", STEPS, "TZYX")
    assert len(series_of([str(tmp_path / "a.ome.tif")], {})) == 3
    assert series_of([str(tmp_path / "a.ome.tif")], {"index": "t=1"}) is None


# the program ------------------------------------------------------------------------------------


def test_the_program_reads_files_of_packages(folder):
    write.ome_zarr(folder / "a.zarr", STEPS, ("c",))
    more = ("--dataset", "0", "--index=c=2")
    done = command("info", "--json", folder / "a.zarr", *more)
    assert done.returncode == 0, done.stderr
    info = json.loads(done.stdout)
    assert info["file"] == str(folder / "a.zarr")
    assert info["dims"] == [*VOXELS.shape[::-1]] and info["type"] == "int16"
    assert info["spacing"] == pytest.approx(SPACING[::-1])
    assert info["origin"] == pytest.approx(ORIGIN[::-1])
    out = folder / "out.zfp"
    done = command("convert", *more, folder / "a.zarr", "--exact", "-o", out)
    assert done.returncode == 0, done.stderr
    assert np.array_equal(isowave.open(out)[...], STEPS[2])


def test_the_program_gets_the_value_of_voxels_without_data(folder):
    h5py = pytest.importorskip("h5py")

    with h5py.File(folder / "a.h5", "w") as file:
        file["ct"] = VOXELS
        file["ct"].attrs["_FillValue"] = VOXELS[1, 2, 1]
    for more, value in (((), VOXELS[1, 2, 1]), (("--no-data", VOXELS[2, 2, 1]), VOXELS[2, 2, 1])):
        done = command("convert", folder / "a.h5", "-o", folder / "out.zfp", *more)
        assert done.returncode == 0, done.stderr
        assert np.array_equal(np.isnan(isowave.open(folder / "out.zfp")[...]), VOXELS == value)


@pytest.mark.parametrize(
    "arguments, text",
    [
        (["a.tif"], "a.tif: image 0: axis t has 3 entries: choose one by --index, as t=0"),
        (["a.tif", "--index", "t=1", "--nonsense"], "--nonsense"),
        (["bad.tif"], "bad.tif: not a TIFF file"),
    ],
)
def test_the_program_says_in_one_line_what_is_wrong(folder, arguments, text):
    write.tiff(folder / "a.tif", STEPS, metadata={"axes": "TZYX"})
    (folder / "bad.tif").write_text("nonsense")
    done = command("info", *arguments, cwd=folder)
    assert done.returncode == 1 and done.stdout == ""
    assert done.stderr.startswith("isowave: ") and done.stderr.count("\n") == 1
    assert text in done.stderr


def stack(folder):
    """Layers in files slices_7.tif to slices_13.tif; returns their paths."""
    write.tiff_folder(folder / "layers")
    for file in (folder / "layers").iterdir():
        file.rename(folder / file.name.replace("layer", "slices"))
    return [folder / f"slices_{i}.tif" for i in range(7, 14)]


def test_a_pattern_of_layers_is_a_volume(folder, monkeypatch):
    """slices_10.tif comes after slices_9.tif, also if the shell, which thinks otherwise, has
    found the files."""
    files = sorted(map(str, stack(folder)))
    assert files[0].endswith("slices_10.tif")
    monkeypatch.chdir(folder)
    volume = isowave.open("slices_*.tif", spacing=SPACING)
    assert np.array_equal(volume[...], VOXELS) and volume.spacing == SPACING
    for given in (["slices_*.tif"], files):
        x, y, z = SPACING[::-1]
        done = command("convert", *given, "--exact", "--spacing", x, y, z, "-o", "out.zfp")
        assert done.returncode == 0, done.stderr
        out = isowave.open("out.zfp")
        assert np.array_equal(out[...], VOXELS) and out.spacing == SPACING
        series = isowave.open_series(given if len(given) > 1 else given[0], spacing=SPACING)
        assert len(series) == 1 and np.array_equal(series[0][...], VOXELS)
    assert series_of(["slices_*.tif"], {})[0].shape == VOXELS.shape
    name = f"slices_iso{volume.suggested_isovalues()[0]:g}.png"
    for given in (["slices_*.tif"], files):
        done = command("render", *given, "--device", "host", "--size", "32x24")
        assert done.returncode == 0, done.stderr
        assert f"wrote {name}" in done.stdout and pathlib.Path(name).exists()
        pathlib.Path(name).unlink()
    done = command("info", "nothing_*.tif")
    assert (done.returncode, done.stderr) == (
        1, "isowave: nothing_*.tif: no file has such a name\n"
    )  # fmt: skip
    with pytest.raises(isowave.Error, match=r"no_\*.tif: no file has such a name"):
        isowave.open("no_*.tif")
    with pytest.raises(isowave.Error, match="dataset 1: layers are one array"):
        isowave.open_series("slices_*.tif", dataset="1")


def test_a_saved_scene_names_the_file(folder, monkeypatch):
    """Not the NRRD file that the program got; from the scene's folder."""
    files = [str(file) for file in stack(folder)]
    monkeypatch.chdir(folder)
    write.ome_tiff(folder / "heat.tif")
    (folder / "scenes").mkdir()
    look = ("-i", 20, "--device", "host", "--size", "32x24", "--color-by", "heat.tif,0,40")
    save = ("--save-scene", "scenes/s.json")
    done = command("render", "slices_*.tif", *look, "-o", "a.png", *save)
    assert done.returncode == 0, done.stderr
    scene = json.loads(pathlib.Path("scenes/s.json").read_text())
    assert (scene["volume"], scene["field"]) == ("../slices_*.tif", "../heat.tif")
    image = isowave.open_scene("scenes/s.json").render(size=(32, 24), device="host")
    image.save("b.png")
    assert pathlib.Path("a.png").read_bytes() == pathlib.Path("b.png").read_bytes()
    done = command("render", *files, *look, "-o", "a.png", *save)
    assert (done.returncode, done.stderr) == (
        1,
        "isowave: --save-scene: a scene names one volume: put the layers' pattern in quotes\n",
    )


def test_a_pattern_of_volumes_is_a_series(folder, monkeypatch):
    monkeypatch.chdir(folder)
    for t in (2, 10):
        write.ome_tiff(folder / f"s_{t}.ome.tif", VOXELS + t)
        nrrd(folder / f"{t}.nrrd", (VOXELS + t + 100).astype("uint8"))
    with pytest.raises(isowave.Error, match=r"each of several files is one layer.*open_series\(\)"):
        isowave.open("s_*.tif")
    look = ("-i", 20, "--device", "host", "--size", "32x24")
    done = command("render", "s_*.tif", *look, "-o", "a.png")
    assert done.returncode == 0, done.stderr
    for i, t in enumerate((2, 10)):
        assert command("render", f"s_{t}.ome.tif", *look, "-o", "b.png").returncode == 0
        assert pathlib.Path(f"a_step{i}.png").read_bytes() == pathlib.Path("b.png").read_bytes()


def two_datasets(path):
    h5py = pytest.importorskip("h5py")

    with h5py.File(path, "w") as file:
        for name, voxels in (("s/ct", VOXELS), ("s/heat", VOXELS[::-1])):
            file[name] = voxels
            file[name].attrs["element_size_um"] = SPACING


@pytest.mark.parametrize("name", ["a.h5", "a.nc", "a.zarr"])
def test_a_field_is_chosen_by_its_name(folder, monkeypatch, name):
    """Its file has several arrays. One of them is the volume."""
    monkeypatch.chdir(folder)
    ct, heat = "ct", "heat"
    if name == "a.h5":
        two_datasets(folder / name)
        ct, heat = "s/ct", "s/heat"
    else:
        xarray = pytest.importorskip("xarray")
        axes = {axis: write.even("zyx".index(axis), n) for axis, n in zip("zyx", VOXELS.shape)}
        arrays = {"ct": ("zyx", VOXELS), "heat": ("zyx", VOXELS[::-1])}
        data = xarray.Dataset({n: (list(a), v) for n, (a, v) in arrays.items()}, axes)
        data.to_zarr(name) if name == "a.zarr" else data.to_netcdf(name)
    look = ("-i", 20, "--device", "host", "--size", "32x24")
    done = command(
        "render", name, "--dataset", ct, "--color-by", f"{name},0,40", "--field-dataset", heat,
        *look, "-o", "a.png",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    volume, field = isowave.open(name, dataset=ct), isowave.open(name, dataset=heat)
    by_field = isowave.ColorMap(by="field", range=(0, 40))
    image = volume.render(20, field=field, color_map=by_field, size=(32, 24), device="host")
    image.save("b.png")
    assert pathlib.Path("a.png").read_bytes() == pathlib.Path("b.png").read_bytes()
    done = command("render", name, "--dataset", ct, "--color-by", name, *look, "-o", "a.png")
    assert done.returncode == 1 and done.stderr.count("\n") == 1
    assert "choose one by --field-dataset" in done.stderr
    done = command("render", name, "--dataset", ct, "--field-dataset", heat, *look)
    assert done.stderr == (
        "isowave: --field-dataset: no file of --color-by has several arrays: leave it out\n"
    )


LOOK = ("--device", "host", "--size", "32x24")


def test_a_scene_of_files_of_packages(folder, monkeypatch):
    """The program gets NRRD files in place of those that the scene names."""
    monkeypatch.chdir(folder)
    two_datasets(folder / "a.h5")
    (folder / "scenes").mkdir()
    by = ("--color-by", "a.h5,0,40", "--field-dataset", "s/heat")
    render = ("render", "a.h5", "--dataset", "s/ct", "-i", 20, *by, *LOOK)
    save = ("--save-scene", "scenes/s.json")
    assert command(*render, "-o", "a.png", *save).returncode == 0
    fields = json.loads(pathlib.Path("scenes/s.json").read_text())
    names = ("volume", "dataset", "field", "field_dataset")
    assert [fields[each] for each in names] == ["../a.h5", "s/ct", "../a.h5", "s/heat"]
    for scene in (("--scene", "scenes/s.json"), ("--scene=scenes/s.json",)):
        again = ("--save-scene", "t.json")
        done = command("render", *scene, *LOOK, "-o", "b.png", *again)
        assert done.returncode == 0, done.stderr
        assert pathlib.Path("a.png").read_bytes() == pathlib.Path("b.png").read_bytes()
        fields = json.loads(pathlib.Path("t.json").read_text())
        assert [fields[each] for each in names] == ["a.h5", "s/ct", "a.h5", "s/heat"]
    scene = ("--scene", "scenes/s.json")
    # Options choose others, and VOLUME another file.
    done = command("render", *scene, *LOOK, "-o", "b.png", "--dataset", "s/heat")
    assert done.returncode == 0, done.stderr
    assert pathlib.Path("a.png").read_bytes() != pathlib.Path("b.png").read_bytes()
    done = command("render", *scene, *LOOK, "-o", "b.png", "--field-dataset", "absent")
    assert done.returncode == 1 and "absent" in done.stderr and done.stderr.count("\n") == 1
    np.save("b.npy", VOXELS[::-1])
    nrrd(folder / "b.nrrd", VOXELS[::-1].astype("uint8"))
    for other in ("b.npy", "b.nrrd"):
        done = command("render", other, *scene, *LOOK, "-o", "b.png", *again)
        assert done.returncode == 0, done.stderr
        assert pathlib.Path("a.png").read_bytes() != pathlib.Path("b.png").read_bytes()
        fields = json.loads(pathlib.Path("t.json").read_text())
        assert fields["volume"] == other and "dataset" not in fields
        assert fields["field_dataset"] == "s/heat"
    done = command("render", *scene, *LOOK, "-o", "b.png", "--save-scene", "scenes/s.json")
    assert done.stderr == (
        "isowave: --save-scene: scenes/s.json would take the place of the input scenes/s.json\n"
    )


def test_scenes_that_cannot_be_are_one_line(folder, monkeypatch):
    monkeypatch.chdir(folder)
    two_datasets(folder / "a.h5")
    nrrd(folder / "b.nrrd", VOXELS.astype("uint8"))

    def refused(**more):
        scene = {"isowave_scene": 1, "surfaces": [{"isovalue": 20}], **more}
        pathlib.Path("s.json").write_text(json.dumps(scene))
        done = command("render", "--scene", "s.json", *LOOK, "-o", "c.png")
        assert done.returncode == 1 and not pathlib.Path("c.png").exists()
        return done.stderr

    assert "choose one by --dataset" in refused(volume="a.h5")
    assert refused(volume="b.nrrd", dataset="ct") == (
        "isowave: b.nrrd: dataset ct: this file has one array, without a name\n"
    )
    assert "absent" in refused(volume="a.h5", dataset="absent")
    assert "index c=1" in refused(volume="a.h5", dataset="s/ct", index="c=1")
    assert refused(volume="none.h5").count("\n") == 1


def test_an_index_of_the_programs_files_goes_on_to_it(folder, monkeypatch):
    """Beside a file of packages."""
    monkeypatch.chdir(folder)
    np.save("heat.npy", VOXELS[::-1])
    steps = [VOXELS.astype("uint8"), VOXELS.astype("uint8") + 9]
    sizes = " ".join(map(str, reversed(VOXELS.shape)))
    head = f"NRRD0004\ntype: uint8\nencoding: raw\ndimension: 4\nsizes: {sizes} 2\n\n"
    pathlib.Path("four.nrrd").write_bytes(head.encode() + b"".join(s.tobytes() for s in steps))
    nrrd(folder / "one.nrrd", steps[1])
    found = []
    for volume in (("four.nrrd", "--index", "t=1"), ("one.nrrd",)):
        by = ("--color-by", "heat.npy,0,40")
        done = command("render", *volume, *by, "-i", 20, *LOOK, "-o", "a.png")
        assert done.returncode == 0, done.stderr
        found.append(pathlib.Path("a.png").read_bytes())
    assert found[0] == found[1]
    done = command("render", "one.nrrd", "--dataset", "x", *by, *LOOK, "-o", "a.png")
    assert done.stderr == "isowave: --dataset: VOLUME has one array: leave it out\n"


def test_the_program_compares_files_of_packages(folder, monkeypatch):
    h5py = pytest.importorskip("h5py")

    monkeypatch.chdir(folder)
    with h5py.File("a.h5", "w") as file:
        file["ct"] = VOXELS
        file["ct"].attrs["_FillValue"] = VOXELS[1, 2, 1]
    write.npy("b.npy")
    found = {}
    for other in ("a.h5", "b.npy"):
        done = command("compare", "a.h5", other, "-i", 20, "--size", "32x24", "--json")
        assert done.returncode == 0, done.stderr
        found[other] = json.loads(done.stdout)["voxels"]
    missing = int((VOXELS == VOXELS[1, 2, 1]).sum())
    assert found["a.h5"]["differing"] == 0 and found["a.h5"]["voxels"] == VOXELS.size
    assert found["b.npy"]["without_data_in_one"] == found["b.npy"]["differing"] == missing > 0
    write.ome_zarr(folder / "a.zarr", STEPS, ("c",))
    which = ("--dataset", "0", "--index", "c=2")
    done = command("compare", "a.zarr", "a.zarr", *which, "-i", 20, "--size", "32x24")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(f"equal: all bits of {VOXELS.size} voxels\n")


def test_signals_leave_no_file_behind(folder, monkeypatch):
    """The program, here one that waits, ends with its parent's SIGTERM."""
    write.npy(folder / "a.npy")
    script = (
        "import pathlib, sys\nfrom isowave import _program\n"
        "_program.PROGRAM = pathlib.Path('/bin/sh')\n"
        "_program.with_nrrd = lambda *_: ['-c', 'echo ready; exec sleep 600']\n"
        "sys.argv[1:] = ['info', sys.argv[1]]\nsys.exit(_program.main())"
    )
    with subprocess.Popen(
        [sys.executable, "-c", script, folder / "a.npy"], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout.readline() == "ready\n"
        process.send_signal(signal.SIGTERM)
        assert process.wait(60) == 128 + signal.SIGTERM


def test_which_arguments_are_files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write.npy("a.npy")
    write.tiff_folder(tmp_path / "layers")
    for name in ("pictures", "a.nrrd", "b.tif"):
        pathlib.Path(name).mkdir() if name == "pictures" else pathlib.Path(name).write_text("")
    assert given_files(["render", "a.npy", "--depth", "a.npy"]) == [Given(1, "a.npy")]
    assert given_files(["render", "a.nrrd", "--depth", "a.npy", "--progress-dir", "pictures"]) == []
    assert given_files(["render", "--exact", "layers", "--color-by", "b.tif"]) == [
        Given(2, "layers"),
        Given(4, "b.tif", is_field=True),
    ]
    field = {"path": "b.tif", "is_field": True}
    assert given_files(["render", "a.nrrd", "--color-by", "b.tif,0,100"]) == [
        Given(3, tail=",0,100", **field)
    ]
    assert given_files(["render", "--color-by=b.tif,labels"]) == [Given(1, tail=",labels", **field)]
    assert given_files(["render", "a.nrrd", "--color-by", "x,0,1"]) == []
    np.save("depth.npy", VOXELS[0])
    assert given_files(["compare", "depth.npy", "depth.npy"]) == given_files(["--help"]) == []
    assert given_files(["compare", "a.npy", "depth.npy"]) == [Given(1, "a.npy")]
    assert given_files(["render", "a.nrrd", "-i", "80", "missing.tif"]) == []
    assert given_files(["render", "missing_*.tif"]) == [Given(1, "missing_*.tif")]
    files = [f"layers/layer_{i}.tif" for i in range(7, 14)]
    assert given_files(["render", "-i", "80", *files]) == [Given(3, files[0], count=7)]
    assert given_files(["compare", *files[:2]]) == [Given(1, files[0]), Given(2, files[1])]
    write.tiff("c.tif")
    write.tiff("d.tif")
    assert given_files(["info", "c.tif", "d.tif"]) == [Given(1, "c.tif"), Given(2, "d.tif")]
    arguments = ["a", "--index", "t=1", "--x=y", "--dataset=q", "b"]
    assert (take_option(arguments, "--index"), take_option(arguments, "--dataset")) == ("t=1", "q")
    assert take_option(arguments, "--index") is None and arguments == ["a", "--x=y", "b"]
    with pytest.raises(isowave.Error, match="--index: 1 required TEXT missing"):
        take_option(["a", "--index"], "--index")


@pytest.mark.parametrize(
    "dtype", ["uint8", "int8", "uint16", "uint32", "float32", "float64", "int64"]
)
def test_nrrd_has_the_same_bits_and_place(tmp_path, dtype):
    direction = np.array([[0, 0, -1.0], [0.6, 0.8, 0], [0.8, -0.6, 0]])
    voxels = VOXELS.astype(dtype)
    source = as_source(voxels, spacing=(0.1, 0.3, 1e-3), origin=ORIGIN, direction=direction)
    source = replace(source, is_anatomical=dtype == "uint8")
    write_nrrd(source, str(tmp_path / "a.nrrd"))
    volume = isowave.open(tmp_path / "a.nrrd")
    assert volume.anatomical == (dtype == "uint8")
    assert volume.source_dtype == ("float64" if dtype == "int64" else dtype)
    assert np.array_equal(volume[...], voxels.astype("float32"))
    np.testing.assert_allclose(volume.direction, direction, atol=1e-15)
    assert volume.spacing == pytest.approx((0.1, 0.3, 1e-3), rel=1e-15) and volume.origin == ORIGIN


def test_help_names_the_options(capsys, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["isowave", "--help"])
    assert _program.main() == 0
    shown = capsys.readouterr().out
    for text in ("isowave[files]", "--dataset NAME", "--index AXIS=N", "\n\nExit status:"):
        assert text in shown
