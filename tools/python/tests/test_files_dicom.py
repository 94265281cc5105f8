"""DICOM: folders and files of frames, written by pydicom; GDCM (by SimpleITK) reads the same."""

import random

import numpy as np
import pytest
from array_checks import check_source, make_direction, make_voxels, read_all

import isowave
from isowave._arrays import as_source
from isowave._files import source_of_file, steps_of_file

pydicom = pytest.importorskip("pydicom")
Dataset, FileMetaDataset = pydicom.Dataset, pydicom.dataset.FileMetaDataset
generate_uid = pydicom.uid.generate_uid

VOXELS = make_voxels("int16")
SPACING = (3.0, 0.5, 2.0)  # z, y, x
ORIGIN = np.array([30.0, -20.0, 10.0])  # x, y, z
SERIES = generate_uid()


def decimals(values):
    return [pydicom.valuerep.DSfloat(float(v), auto_format=True) for v in values]


def header(storage=pydicom.uid.CTImageStorage, **more):
    image = Dataset()
    image.file_meta = FileMetaDataset()
    image.file_meta.TransferSyntaxUID = pydicom.uid.ExplicitVRLittleEndian
    image.SOPClassUID = image.file_meta.MediaStorageSOPClassUID = storage
    image.SOPInstanceUID = image.file_meta.MediaStorageSOPInstanceUID = generate_uid()
    image.SeriesInstanceUID, image.StudyInstanceUID = SERIES, generate_uid()
    image.Modality, image.SeriesNumber, image.SeriesDescription = "CT", 4, "thorax"
    image.SamplesPerPixel, image.PhotometricInterpretation = 1, "MONOCHROME2"
    image.BitsAllocated = image.BitsStored = 16
    image.HighBit, image.PixelRepresentation = 15, 1
    image.RescaleSlope, image.RescaleIntercept = "2", "-1000"
    for keyword, value in more.items():
        setattr(image, keyword, value)
    return image


def place(image, z, direction=np.eye(3), step=None):
    """Layer z, of columns along direction[:, 0], rows along direction[:, 1]."""
    step = direction[:, 2] * SPACING[0] if step is None else step
    image.ImageOrientationPatient = decimals([*direction[:, 0], *direction[:, 1]])
    image.ImagePositionPatient = decimals(ORIGIN + step * z)
    image.PixelSpacing = decimals(SPACING[1:])  # between rows, between columns


def save(image, path, pixels):
    image.Rows, image.Columns = pixels.shape[-2:]
    image.PixelData = pixels.tobytes()
    image.save_as(path, enforce_file_format=True)


def folder(path, voxels=VOXELS, prefix="", **more):
    """Files whose names, numbers and order say nothing of their place."""
    path.mkdir(exist_ok=True)
    direction, step = more.pop("direction", np.eye(3)), more.pop("step", None)
    names = random.Random(5).sample(range(len(voxels)), len(voxels))
    for z, layer in enumerate(voxels):
        image = header(InstanceNumber=names[z], **more)
        place(image, z, direction, step)
        save(image, path / f"{prefix}{names[z]}", layer)
    (path / "notes.txt").write_text("no image")


def source(path, dataset=None, index=None, spacing=None):
    return source_of_file(str(path), dataset, index, spacing)


def test_layers_are_sorted_by_position_and_rescaled(tmp_path):
    direction = make_direction()
    direction[:, 2] = np.cross(direction[:, 0], direction[:, 1])
    folder(tmp_path / "ct", direction=direction)
    found = source(tmp_path / "ct")
    assert found.dtype == np.int32  # 2 * int16 - 1000
    np.testing.assert_array_equal(read_all(found, 4), 2 * VOXELS.astype("int32") - 1000)
    assert found.spacing == pytest.approx(SPACING)
    assert found.origin == pytest.approx(ORIGIN[::-1])
    np.testing.assert_allclose(found.direction, direction, atol=1e-9)
    volume = isowave.open(tmp_path / "ct")
    assert np.array_equal(volume[...], 2 * VOXELS.astype("float32") - 1000)
    assert volume.spacing == pytest.approx(SPACING)
    assert volume.anatomical and volume.up == (0, 0, 1)


def test_gdcm_reads_the_same(tmp_path):
    sitk = pytest.importorskip("SimpleITK")
    direction = np.array([[0, 0, 1], [-1, 0, 0], [0, -1, 0]])  # coronal
    folder(tmp_path / "ct", direction=direction)
    names = sitk.ImageSeriesReader.GetGDCMSeriesFileNames(str(tmp_path / "ct"))
    theirs, ours = as_source(sitk.ReadImage(names)), source(tmp_path / "ct")
    np.testing.assert_array_equal(read_all(ours), read_all(theirs))
    assert ours.spacing == pytest.approx(theirs.spacing) and ours.shape == theirs.shape
    assert ours.origin == pytest.approx(theirs.origin)
    np.testing.assert_allclose(ours.direction, theirs.direction, atol=1e-9)
    np.testing.assert_allclose(ours.direction, direction, atol=1e-9)


def test_a_tilted_gantry_stays_tilted(tmp_path):
    step = np.array([0.0, 0.75, 3.0])
    folder(tmp_path / "ct", step=step)
    found = source(tmp_path / "ct")
    np.testing.assert_allclose(found.direction[:, 2] * found.spacing[0], step)
    np.testing.assert_allclose(found.direction[:, :2], np.eye(3)[:, :2])


@pytest.mark.parametrize(
    "slope, intercept, dtype",
    [("1", "0", "int16"), ("1", "-1024", "int32"), ("0.5", "1", "float64")],
)
def test_types_hold_every_rescaled_value(tmp_path, slope, intercept, dtype):
    folder(tmp_path / "ct", RescaleSlope=slope, RescaleIntercept=intercept)
    found = source(tmp_path / "ct")
    assert found.dtype == dtype
    np.testing.assert_array_equal(read_all(found), VOXELS * float(slope) + float(intercept))


def test_a_layer_that_is_missing(tmp_path):
    folder(tmp_path / "ct")
    names = random.Random(5).sample(range(7), 7)
    (tmp_path / "ct" / str(names[3])).unlink()
    with pytest.raises(isowave.Error, match="3 to 6 mm apart, not evenly: one may be missing"):
        isowave.open(tmp_path / "ct")
    assert source(tmp_path / "ct", spacing=(3, 2, 1)).spacing == (3, 2, 1)


def test_several_series(tmp_path):
    folder(tmp_path / "ct")
    more = {"SeriesInstanceUID": generate_uid(), "SeriesNumber": 5, "SeriesDescription": "head"}
    folder(tmp_path / "ct", VOXELS[:, :4] + 1, "b", **more)
    listed = r"4 \(thorax, 7 images\), 5 \(head, 7 images\)"
    with pytest.raises(isowave.Error, match=f"2 series: choose one by dataset, .*: {listed}"):
        isowave.open(tmp_path / "ct")
    for name in ("5", "head", more["SeriesInstanceUID"]):
        assert source(tmp_path / "ct", name).shape == (7, 4, 3)
    with pytest.raises(isowave.Error, match=f"no series 6: choose one by dataset, .*: {listed}"):
        isowave.open(tmp_path / "ct", dataset="6")


def test_images_at_the_same_positions_are_steps(tmp_path):
    folder(tmp_path / "ct", AcquisitionNumber=2)
    folder(tmp_path / "ct", VOXELS + 1, "a", AcquisitionNumber=1)
    assert steps_of_file(str(tmp_path / "ct"), None, None) == ("t", 2)
    series = isowave.open_series(tmp_path / "ct")
    assert [v[0, 0, 0] for v in series] == [2 * (VOXELS[0, 0, 0] + i) - 1000 for i in (1, 0)]
    (tmp_path / "ct" / "a3").unlink()
    with pytest.raises(isowave.Error, match="1 to 2 at one position: need the same number"):
        isowave.open(tmp_path / "ct")


def test_frames_of_one_file(tmp_path):
    image = header(pydicom.uid.EnhancedCTImageStorage, NumberOfFrames=len(VOXELS))
    del image.RescaleSlope, image.RescaleIntercept
    shared, frames = Dataset(), []
    measures, rescale = Dataset(), Dataset()
    measures.PixelSpacing = decimals(SPACING[1:])
    rescale.RescaleSlope, rescale.RescaleIntercept = "3", "7"
    shared.PixelMeasuresSequence = [measures]
    shared.PixelValueTransformationSequence = [rescale]
    for z in reversed(range(len(VOXELS))):  # the first frame is the last layer
        own, position, orientation = Dataset(), Dataset(), Dataset()
        position.ImagePositionPatient = decimals(ORIGIN + [0, 0, SPACING[0] * z])
        orientation.ImageOrientationPatient = decimals([1, 0, 0, 0, 1, 0])
        own.PlanePositionSequence, own.PlaneOrientationSequence = [position], [orientation]
        frames.append(own)
    image.SharedFunctionalGroupsSequence = [shared]
    image.PerFrameFunctionalGroupsSequence = frames
    save(image, tmp_path / "frames.dcm", VOXELS[::-1])
    found = source(tmp_path / "frames.dcm")
    expected = 3 * VOXELS.astype("int32") + 7
    check_source(
        found, expected, spacing=pytest.approx(SPACING), origin=pytest.approx(ORIGIN[::-1])
    )


def test_files_without_positions_go_by_their_numbers(tmp_path):
    (tmp_path / "us").mkdir()
    for z, layer in enumerate(VOXELS):
        image = header(InstanceNumber=z + 1, SliceThickness="3", PixelSpacing=decimals((0.5, 2)))
        save(image, tmp_path / "us" / f"{9 - z}.ima", layer)
    check_source(source(tmp_path / "us"), 2 * VOXELS.astype("int32") - 1000, spacing=SPACING)


def test_layers_are_read_when_they_are_needed(tmp_path):
    folder(tmp_path / "ct")
    last = tmp_path / "ct" / str(random.Random(5).sample(range(7), 7)[6])
    last.write_bytes(last.read_bytes()[:-6])
    found = source(tmp_path / "ct")
    np.testing.assert_array_equal(found.read(0, 6), 2 * VOXELS[:6].astype("int32") - 1000)
    with pytest.raises(isowave.Error, match="ct: .*layers . to 7 cannot be read") as error:
        isowave.open(tmp_path / "ct")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "change, text",
    [
        ({"SamplesPerPixel": 3}, "an image in colour"),
        ({"BitsAllocated": 64}, "voxels of 64 bits"),
        ({"PixelRepresentation": None}, "its voxels are no integers"),
        ({"ModalityLUTSequence": [Dataset()]}, "Modality LUT"),
        ({"PixelSpacing": [1]}, "PixelSpacing is 1.0: need 2"),
    ],
)
def test_images_that_are_refused(tmp_path, change, text):
    (tmp_path / "ct").mkdir()
    for z, layer in enumerate(VOXELS):
        image = header()
        place(image, z)
        for keyword, value in change.items():
            delattr(image, keyword) if value is None else setattr(image, keyword, value)
        save(image, tmp_path / "ct" / str(z), layer)
    with pytest.raises(isowave.Error, match=text) as error:
        isowave.open(tmp_path / "ct")
    assert "\n" not in str(error.value)


def test_images_that_do_not_fit_together(tmp_path):
    folder(tmp_path / "size", VOXELS)
    image = header()
    place(image, 9)
    save(image, tmp_path / "size" / "9", VOXELS[0, :4])
    with pytest.raises(isowave.Error, match="9: size, type or spacing of pixels are not those of"):
        isowave.open(tmp_path / "size")
    folder(tmp_path / "turned", VOXELS)
    image = header()
    place(image, 9, np.eye(3)[:, [1, 0, 2]])
    save(image, tmp_path / "turned" / "9", VOXELS[0])
    with pytest.raises(isowave.Error, match="9: another orientation than"):
        isowave.open(tmp_path / "turned")
    place(image, 0)
    save(image, tmp_path / "one.dcm", VOXELS[0])
    with pytest.raises(isowave.Error, match="one image: give the folder of all"):
        isowave.open(tmp_path / "one.dcm")
