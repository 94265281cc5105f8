"""The package's libzfp is its own, whatever else a process has loaded."""

import os
import shutil
import subprocess
import sys

import pytest

# What libcfitsio exports as libzfp does; and what another libzfp would.
NAMES = """
stream_open stream_close stream_flush stream_size stream_rewind stream_rseek stream_read_bits
stream_write_bits zfp_stream_open zfp_stream_close zfp_stream_set_params zfp_stream_set_bit_stream
zfp_stream_rewind zfp_stream_flush zfp_stream_compression_mode zfp_field_alloc zfp_field_3d
zfp_field_free zfp_field_set_stride_3d zfp_field_dimensionality zfp_read_header zfp_write_header
zfp_compress zfp_decompress zfp_decode_block_float_3 zfp_encode_block_float_3
zfp_encode_block_strided_float_3 zfp_encode_partial_block_strided_float_3
zfp_decode_block_strided_float_3 zfp_decode_partial_block_strided_float_3
""".split()

SCRIPT = """
import hashlib

import numpy as np

import isowave

voxels = np.fromfunction(lambda z, y, x: (z - 5) ** 2 + (y - 6) ** 2 + x, (10, 13, 17))
found = hashlib.sha256()
for options in ({"rate": 4}, {"tolerance": 0.01}, {"tolerance": 0.01, "levels": 0}):
    volume = isowave.compress(voxels, path="volume.zfp", **options)
    found.update(isowave.open("volume.zfp").decode().tobytes())
print(found.hexdigest())
"""


def test_no_other_library_answers_calls_to_libzfp(tmp_path):
    """Functions of libzfp's names come first in the process, as do the libraries that ParaView's
    program was linked with. They end a process that calls them."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if not compiler:
        pytest.skip("no C compiler makes the library that would answer")
    source = "#include <stdlib.h>\n" + "".join(
        f"void {name}(void) {{ abort(); }}\n" for name in NAMES
    )
    (tmp_path / "other.c").write_text(source)
    command = [compiler, "-shared", "-fPIC", "-o", tmp_path / "libother.so", tmp_path / "other.c"]
    subprocess.run(command, check=True)

    def run(**variables):
        return subprocess.run(
            [sys.executable, "-c", SCRIPT],
            cwd=tmp_path,
            env={**os.environ, **variables},
            capture_output=True,
            text=True,
            check=False,
        )

    beside_another = run(LD_PRELOAD=str(tmp_path / "libother.so"))
    assert beside_another.returncode == 0, beside_another.stderr
    assert beside_another.stdout == run().stdout
