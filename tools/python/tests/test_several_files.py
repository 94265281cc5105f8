"""Voxels in several files, by headers of NRRD and MetaImage, as ITK reads them: voxels of unequal
sides, spacing and origin."""

import numpy as np
import pytest
from array_checks import ORIGIN, SPACING, make_voxels

import isowave

VOXELS = make_voxels("int16")
NZ, NY, NX = VOXELS.shape
Z, Y, X = SPACING
NRRD = (
    f"NRRD0004\ntype: short\ndimension: 3\nspace: LPS\nsizes: {NX} {NY} {NZ}\n"
    f"space directions: ({X},0,0) (0,{Y},0) (0,0,{Z})\n"
    f"space origin: ({','.join(map(str, ORIGIN[::-1]))})\nendian: little\nencoding: raw\n"
)
META = (
    f"ObjectType = Image\nNDims = 3\nDimSize = {NX} {NY} {NZ}\nElementType = MET_SHORT\n"
    f"ElementSpacing = {X} {Y} {Z}\nOffset = {' '.join(map(str, ORIGIN[::-1]))}\n"
    "BinaryDataByteOrderMSB = False\n"
)
LAYERS = "".join(f"layer_{i}.raw\n" for i in range(8, 8 + NZ))


@pytest.mark.parametrize(
    "name, header",
    [
        ("list.nhdr", f"{NRRD}data file: LIST\n{LAYERS}"),
        ("axes.nhdr", f"{NRRD}data file: LIST 2\n{LAYERS}"),
        ("pattern.nhdr", f"{NRRD}data file: layer_%d.raw 8 {7 + NZ} 1\n"),
        ("back.nhdr", f"{NRRD}data file: back_%03d.raw {NZ} 1 -1\n"),
        ("whole.nhdr", f"{NRRD}data file: LIST 3\nall.raw\n"),
        ("list.mhd", f"{META}ElementDataFile = LIST\n{LAYERS}"),
        ("axes.mhd", f"{META}ElementDataFile = LIST 2\n{LAYERS}"),
        ("pattern.mhd", f"{META}ElementDataFile = layer_%d.raw 8 {7 + NZ} 1\n"),
    ],
)
def test_itk_reads_the_same(tmp_path, name, header):
    SimpleITK = pytest.importorskip("SimpleITK")

    (tmp_path / "all.raw").write_bytes(VOXELS.astype("<i2").tobytes())
    for i, layer in enumerate(VOXELS):
        for file in (f"layer_{8 + i}.raw", f"back_{NZ - i:03}.raw"):
            (tmp_path / file).write_bytes(layer.astype("<i2").tobytes())
    (tmp_path / name).write_text(header)
    volume = isowave.open(tmp_path / name, exact=True)
    image = SimpleITK.ReadImage(str(tmp_path / name))
    assert np.array_equal(volume[...], SimpleITK.GetArrayFromImage(image))
    assert np.array_equal(volume[...], VOXELS)
    assert volume.spacing == pytest.approx(image.GetSpacing()[::-1])
    assert volume.spacing == pytest.approx(SPACING)
    assert volume.origin == pytest.approx(image.GetOrigin()[::-1])
    assert volume.origin == pytest.approx(ORIGIN)
