"""Levels of detail as arrays: numpy's indexing, and only the blocks that it needs."""

import copy
import pickle
import subprocess
import sys
import types

import numpy as np
import pytest
from conftest import RecordingCore, sphere_voxels

import isowave

SHAPE = (23, 18, 37)


@pytest.fixture(scope="module", params=[{"rate": 9}, {"tolerance": 0.3}, {"exact": True}], ids=str)
def volume(request):
    voxels = 200 * sphere_voxels(SHAPE) + np.random.default_rng(1).integers(0, 9, SHAPE)
    return isowave.compress(voxels.astype(np.uint16), levels=0, **request.param)


def keys_of(array):
    rows = array[:, 0, 0] > np.median(array[:, 0, 0])
    return [
        (),
        ...,
        0,
        -1,
        np.int16(2),
        np.array(3),
        (1, 2, 3),
        (-1, -1, -1),
        np.s_[3, :, 4],
        np.s_[..., 2],
        np.s_[1, ..., 2:5],
        np.s_[1, 2, 3, ...],
        np.s_[2:5, 1:-1, -3:],
        np.s_[-100:100],
        np.s_[::4, 1::5, 2::6],
        np.s_[::-1],
        np.s_[5:1:-2, ::-3, -2:0:-5],
        np.s_[5:5],
        np.s_[100:],
        np.s_[:, 4:2, 3],
        None,
        np.s_[None, 3:5, None, 2],
        [],
        [4, 0, -1],
        np.s_[:, [1, 2, -1], 2:4],
        np.s_[0, :, [1, 2]],
        np.s_[:, [], 2],
        np.s_[:, [[1, 2], [0, -3]]],
        ([1, 2], [3, 1], [0, 5]),
        rows,
        rows.tolist(),
        np.s_[..., array[0, 0] > 50],
        np.s_[1, array[0] > np.median(array[0])],
        array > np.median(array),
    ]


def test_indexing_is_numpys(volume):
    assert len(volume.levels) == volume.num_levels > 1
    for number, level in enumerate(volume.levels):
        decoded = volume.decode(number)
        assert decoded.dtype == level.dtype == np.float32 and decoded.shape == level.shape
        assert level.ndim == 3 and level.size == decoded.size and level.nbytes == decoded.nbytes
        assert len(level) == len(decoded)
        for key in keys_of(decoded):
            expected, got = decoded[key], level[key]
            assert type(got) is type(expected), key
            assert got.shape == expected.shape and np.array_equal(got, expected), key
            assert np.array_equal(volume.decode(number, key), expected), key
        assert np.array_equal(np.asarray(level), decoded)
        assert np.array_equal(list(level), decoded)


def test_a_volume_is_its_finest_level(volume):
    decoded = volume.decode()
    assert volume.ndim == 3 and volume.size == decoded.size and len(volume) == SHAPE[0]
    assert volume.dtype == np.asarray(volume).dtype == np.float32
    assert volume.source_dtype == np.uint16
    assert np.asarray(volume, np.float64).dtype == np.float64
    assert np.array_equal(volume[3:7, :, -1], decoded[3:7, :, -1])
    assert np.array_equal(np.stack(list(volume)), decoded)
    assert volume[1, 2, 3] == decoded[1, 2, 3] and isinstance(volume[1, 2, 3], np.float32)
    with pytest.raises(ValueError, match="copy=False"):
        np.asarray(volume, copy=False)


def test_what_is_no_index_is_one_line(volume):
    cases = [
        (23, "index 23 on axis 0, which has 23 voxels"),
        (np.s_[:, -19], "index -19 on axis 1, which has 18 voxels"),
        (np.s_[..., [0, 37]], "index 37 on axis 2, which has 37 voxels"),
        ((0, 0, 0, 0), "4 indices for voxels that have 3 axes"),
        ((..., 0, ...), "only once"),
        ("a", "not by 'a'"),
        (1.5, "not by 1.5"),
        ([0.5], r"not by \[0.5\]"),
        (True, "not by True"),
        ({}, "not by {}"),
        (np.zeros(22, bool), r"a mask of shape \(22,\) for voxels of shape \(23,\)"),
        (np.zeros((23, 18, 37, 1), bool), "4 indices for voxels"),
    ]
    decoded = volume.decode()
    for key, words in cases:
        with pytest.raises(IndexError, match=words) as raised:
            volume[key]
        assert "\n" not in str(raised.value)
        if key is not True:  # an axis more, for numpy
            with pytest.raises(IndexError):
                decoded[key]
        with pytest.raises(IndexError, match=words):
            volume.decode(0, key)
    with pytest.raises(ValueError, match="level -1"):
        volume.decode(-1, ...)
    with pytest.raises(ValueError, match="step"):
        volume[::0]
    with pytest.raises(isowave.Error, match="along z: must hold a voxel, and end by 23"):
        volume._core.decode(0, (0, 0, 5), (1, 1, 5), (1, 1, 1))


@pytest.mark.parametrize(
    "key, blocks",
    [
        (np.s_[3], 5 * 10),
        (np.s_[3:5], 2 * 5 * 10),
        (np.s_[:, :, 36], 6 * 5),
        (np.s_[1, 2, 3], 1),
        (np.s_[::-8, 0, ::8], 3 * 5),
        (np.s_[:, [3, 8, 4], 0], 6 * 3),
        (np.s_[2:2], 0),
        (np.s_[...], 6 * 5 * 10),
    ],
    ids=str,
)
def test_only_needed_blocks_are_decoded(volume, key, blocks):
    core = RecordingCore(volume._core)
    isowave.Level(types.SimpleNamespace(_core=core), 0)[key]
    assert sum(core.blocks) == blocks


def test_a_file_may_lose_what_is_not_indexed(tmp_path):
    volume = isowave.compress(sphere_voxels(SHAPE), rate=8, path=tmp_path / "a.zfp")
    first = volume[:4]
    layer = 5 * 10 * 64  # bytes: a block has 64
    with (tmp_path / "a.zfp").open("r+b") as file:
        file.truncate(12 + layer)
    assert np.array_equal(volume[3], first[3])
    with pytest.raises(isowave.Error, match="a.zfp"):
        volume[4]


def test_dask_decodes_chunks(volume):
    da = pytest.importorskip("dask.array", reason="dask is not installed")
    decoded = volume.decode()
    core = RecordingCore(volume._core)
    recording = types.SimpleNamespace(_core=core, __dask_tokenize__=volume.__dask_tokenize__)
    array = da.from_array(isowave.Level(recording, 0), chunks=(8, 8, 16))
    assert array.dtype == np.float32 and array.shape == SHAPE
    assert np.array_equal(array.compute(scheduler="threads"), decoded)
    assert sum(core.blocks) == 6 * 5 * 10  # each once
    core.blocks.clear()
    assert array[9, 3:5, 20].compute().tolist() == decoded[9, 3:5, 20].tolist()
    assert sum(core.blocks) <= 2  # dask asks for the slice, not for its chunk
    assert np.array_equal(array[:, [1, 7, 9]].compute(), decoded[:, [1, 7, 9]])
    of_volume = da.from_array(volume, chunks="auto")
    assert of_volume.dtype == np.float32
    assert of_volume.max().compute() == decoded.max()


def test_levels_are_compressed_as_their_arrays(volume):
    level = volume.levels[1]
    again = isowave.compress(level, tolerance=0.1)
    assert np.array_equal(again.decode(), isowave.compress(level[...], tolerance=0.1).decode())


def test_volumes_and_levels_are_pickled(volume, tmp_path):
    volume.save(tmp_path / "a.zfp")
    of_file = isowave.open(tmp_path / "a.zfp", spacing=(3, 2, 1))
    for given in (volume, of_file):
        data = pickle.dumps(given)
        again = pickle.loads(data)
        assert np.array_equal(again.decode(), given.decode())
        assert again.spacing == given.spacing and again.num_levels == given.num_levels
        assert again.value_range == given.value_range
        assert copy.copy(given) is given and copy.deepcopy(given) is given
        level = pickle.loads(pickle.dumps(given.levels[1]))
        assert np.array_equal(level[3:5], given.levels[1][3:5])
    assert len(data) < 1000, "a file's path, not its voxels"
    (tmp_path / "a.zfp").unlink()
    with pytest.raises(isowave.Error, match="a.zfp"):
        pickle.loads(data)


def test_a_relative_path_is_pickled_as_it_was_opened(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    volume = isowave.compress(sphere_voxels(SHAPE), rate=8, path="a.zfp")
    data = pickle.dumps(volume), pickle.dumps(isowave.open("a.zfp"))
    monkeypatch.chdir("/")
    for one in data:
        assert np.array_equal(pickle.loads(one)[3], volume[3])


OTHER_PROCESS = """
import pickle, sys
import numpy as np
print(float(np.asarray(pickle.load(sys.stdin.buffer)).sum(dtype=float)))
"""


def test_another_process_reads_what_is_pickled(volume):
    data = pickle.dumps(volume)
    command = [sys.executable, "-c", OTHER_PROCESS]
    done = subprocess.run(command, input=data, capture_output=True, check=True)
    assert float(done.stdout) == volume.decode().sum(dtype=float)


def test_dask_names_chunks_without_pickling(volume, monkeypatch):
    da = pytest.importorskip("dask.array", reason="dask is not installed")
    monkeypatch.setattr(isowave.Volume, "__reduce__", lambda self: pytest.fail("pickled"))
    arrays = [da.from_array(v, chunks=(8, 8, 16)) for v in (volume, volume, volume.levels[0])]
    assert arrays[0].name == arrays[1].name
    coarser = da.from_array(volume.levels[1], chunks=(8, 8, 16))
    assert coarser.name != arrays[2].name
