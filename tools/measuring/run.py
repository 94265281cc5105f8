"""Runs the programs of a build for tools/measure, and knows which volumes are drawn."""

import json
import os
import pathlib
import re
import shlex
import subprocess

TOP = pathlib.Path(__file__).resolve().parent.parent.parent
GPU_VOLUMES = (
    "mixing_layer_512x512x512",
    "mixing_layer_1024x1024x1024",
    "shell_1024x1024x1024",
    "mixing_layer_2048x2048x1920",
)
# tests/pocl_as_cpu.cpp, in the folder of the programs.
AS_CPU = "tests/libpocl_as_cpu.so"
CPU_VOLUMES = ("mixing_layer_256x256x256", "mixing_layer_512x512x512")
QUICK_VOLUMES = ("mixing_layer_32x32x32", "shell_32x32x32")
# Isovalues are those of tools/test-volumes.
REAL_VOLUMES = {
    "aneurism_256x256x256_uint8.raw.gz": (40, 80, 150),
    "bonsai_256x256x256_uint8.raw.gz": (25, 40, 150),
    "engine_256x256x128_uint8.raw.gz": (60, 100, 190),
    "cthead_256x256x113_uint16.raw.gz": (500, 800, 1150),
    "ch2_181x217x181_uint8.raw.gz": (30, 90, 120),
    "isabel_velmag_t33_125x125x25_float32.raw.gz": (15, 25, 40),
    "nucleon_41x41x41_uint8.raw.gz": (50, 100, 180),
    "fuel_64x33x32_uint8.raw.gz": (10, 40, 120),
    "vessel_tree_noisy_101x101x101_uint8.raw.gz": (40, 120, 200),
    "LIDC2.mha": (60, 120, 180),
}


class Failed(Exception):
    """A program did not do what it was asked for; the message is one line."""


def as_arguments(options):
    """The command line that the options are, as strings.

    isovalue=[1, 2]  -> --isovalue 1 --isovalue 2
    size=(640, 360)  -> --size 640 360
    exact=True       -> --exact
    levels=None      -> nothing
    """
    arguments = []
    for name, value in options.items():
        flag = "--" + name.replace("_", "-")
        if value is None or value is False:
            continue
        for one in value if isinstance(value, list) else [value]:
            arguments.append(flag)
            if isinstance(one, tuple):
                arguments += map(str, one)
            elif one is not True:
                arguments.append(str(one))
    return arguments


def voxels_of(field):
    """Number of voxels of a synthetic volume, by its name."""
    x, y, z = field.rsplit("_", 1)[1].split("x")
    return int(x) * int(y) * int(z)


def short_name(path):
    return path.name.split("_")[0].split(".")[0]


def what_was_measured(document):
    """Without what the file of tools/measure says once for all, and without folders."""
    said = {"schema", "benchmark", "device", "date", "context", "command"}
    row = {name: value for name, value in document.items() if name not in said}
    if "volume" in row:
        row["volume"] = pathlib.PurePath(row["volume"]).name
    return row


class Run:
    """One call of tools/measure.

    options   of the command line; on_cpu is added when the device is known
    work      a folder for what is written on the way
    commands  what ran since the section began
    """

    def __init__(self, options, work):
        self.options = options
        self.work = work
        self.commands = []
        self.made = set()

    def run(self, program, *arguments, remember=True, ranks=None, environment={}, **options):
        """The program's standard output. Throws Failed with the last line that it said.

        ranks        started by mpirun, so many times
        environment  variables beside those of this process
        """
        mpirun = (
            ["mpirun", "--oversubscribe", "--bind-to", "none", "-n", str(ranks)] if ranks else []
        )
        if remember:
            self.remember(program, *arguments, mpirun=mpirun, environment=environment, **options)
        path = str(self.options.programs / program)
        return self._output([*mpirun, path], program, arguments, environment, options)

    def run_python(self, script, *arguments, **options):
        """The same of a script for the Python of --python."""
        self.remember(script, *arguments, **options)
        return self._output([self.options.python, str(script)], script.name, arguments, {}, options)

    def _output(self, command, program, arguments, environment, options):
        arguments = [*map(str, arguments), *as_arguments(options)]
        command = [*command, *arguments]
        variables = os.environ | environment
        done = subprocess.run(command, cwd=self.work, env=variables, capture_output=True, text=True)
        if done.returncode:
            said = (done.stderr.strip() or done.stdout.strip() or "it said nothing").splitlines()
            asked = shlex.join([program, *arguments])
            raise Failed(f"{asked}: status {done.returncode}: {said[-1]}")
        return done.stdout

    def remember(self, program, *arguments, mpirun=(), environment={}, **options):
        """As a command that has been run."""
        words = [f"{name}={pathlib.Path(value).name}" for name, value in environment.items()]
        words += [*mpirun, pathlib.Path(program).name, *map(str, arguments), *as_arguments(options)]
        self.commands.append(shlex.join(words))

    def read_json(self, name):
        return json.loads((self.work / name).read_text())

    def info(self, volume, remember=True):
        """What `isowave info` says of a .zfp file."""
        return json.loads(self.run("isowave", "info", volume, json=True, remember=remember))

    def fields(self, *largest):
        """The synthetic volumes for this device: the named ones, or all if none is among them."""
        if self.options.quick:
            return QUICK_VOLUMES
        all_of_them = CPU_VOLUMES if self.options.on_cpu else GPU_VOLUMES
        return [field for field in all_of_them if field in largest] or all_of_them

    def real_volumes(self, *names):
        """(path, isovalues) of those that are there and have these short names; quick: of any."""
        for name, isovalues in REAL_VOLUMES.items():
            path = self.options.volumes / name
            wanted = not names or self.options.quick or short_name(path) in names
            if wanted and path.exists():
                yield path, isovalues

    def every_volume(self):
        """(path, isovalues or None) of all volumes of the folder whose names say what they are."""
        if not self.options.volumes:
            return
        found = set()
        for path in sorted(self.options.volumes.iterdir()):
            name = path.name.lower()
            with_dims = re.search(r"_\d+x\d+x\d+_(u?int|float)\d+\.raw(\.gz)?$", name)
            if not (with_dims or name.endswith((".nrrd", ".nhdr", ".mha", ".mhd", ".zfp"))):
                continue
            if short_name(path) not in found:
                found.add(short_name(path))
                yield path, REAL_VOLUMES.get(path.name)

    def volume(self, field, *storage):
        """A synthetic volume of 8-bit integers, compressed with all levels; made once."""
        storage = storage or ("--rate", "4")
        name = f"{field}_{'_'.join(storage).replace('-', '')}.zfp"
        if name not in self.made and not (self.work / name).exists():
            device = self.options.device if storage[0] == "--rate" else None
            source = f"generate:{field}_uint8"
            self.run(
                "isowave", "convert", source, *storage, levels="all", device=device, output=name
            )
        self.made.add(name)
        return name

    def hide_folder(self):
        """Writes FOLDER for the folder of the volumes, which says nothing to others."""
        folder = str(self.options.volumes)
        self.commands = [command.replace(folder, "FOLDER") for command in self.commands]
