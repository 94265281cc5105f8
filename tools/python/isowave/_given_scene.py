"""Scene files of the program whose volumes packages of Python read."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from isowave import _core
from isowave._core import Error
from isowave._files.kinds import OF_THE_COMPILED_PART
from isowave._given_files import FIELD, Chosen, Given, as_nrrd, is_there, take_option
from isowave._source_file import SourceFile, text_of_index

OPTION = "--scene"
COMMANDS = ("render", "export")


@dataclass(frozen=True)
class GivenScene:
    """--scene of the program, or the scene that `export` has in the volume's place.

    at      place of the argument that has its name
    fields  of isowave::Scene
    volume, field  whether the program would open these files of the scene, and packages read them
    """

    at: int
    path: str
    fields: dict[str, Any]
    volume: bool
    field: bool
    is_joined: bool  # --scene=NAME

    def option(self, path: str) -> Iterator[tuple[int, str]]:
        """Arguments with another scene: places and texts."""
        yield self.at, f"{OPTION}={path}" if self.is_joined else path

    def write(
        self,
        folder: str,
        chosen: Chosen,
        of_field: Chosen,
        spacing: Sequence[float] | None,
        real: dict[str, SourceFile | None],
    ) -> tuple[str, Any]:
        """Writes its files as NRRD, and a scene of these: its name, and the value without data.

        chosen, of_field  by options, in place of what the scene says
        real              gets the files of the NRRD files
        """
        fields, no_data = dict(self.fields), None
        for name, is_taken, by_option in (
            ("volume", self.volume, chosen),
            ("field", self.field, of_field),
        ):
            if not is_taken:
                continue
            is_field, path = name == "field", fields[name]
            prefix = "field_" if is_field else ""
            part = Chosen(
                by_option.dataset or fields[f"{prefix}dataset"] or None,
                by_option.index or fields[f"{prefix}index"] or None,
            )
            target = os.path.join(folder, f"scene_{name}")
            own_spacing = None if is_field else spacing
            nrrd, missing = as_nrrd([path], part, own_spacing, target, not is_field, is_field)
            real[nrrd] = SourceFile(path, part.dataset or "", text_of_index(part.index))
            fields |= {name: nrrd, f"{prefix}dataset": None, f"{prefix}index": None}
            no_data = no_data if is_field else missing
        shown = fields["annotations"]
        if shown and self.volume:
            shown["title"] = shown["title"] or Path(self.fields["volume"]).name
        written = os.path.join(folder, Path(self.path).name)
        _core.write_scene(fields, written)
        return written, no_data


def given_scene(arguments: Sequence[str], files: Sequence[Given]) -> GivenScene | None:
    """The scene of `render` or `export`, if packages read a file of it that the program would open.

    files  given_files(arguments): a volume among them comes in place of the scene's
    """
    if not arguments or arguments[0] not in COMMANDS:
        return None
    for at, text in enumerate(arguments):
        is_joined = text.startswith(f"{OPTION}=")
        if is_joined or (text == OPTION and at + 1 < len(arguments)):
            at += not is_joined
            break
        if arguments[0] == "export" and _is_scene(arguments, at):
            break
    else:
        return None
    path = arguments[at].removeprefix(f"{OPTION}=")
    try:
        fields = _core.read_scene(path)
    except Error:  # the program says why
        return None
    names_volume = any(not each.is_field for each in files) or _names_volume(arguments)
    volume = not names_volume and is_there(fields["volume"])
    if not (names_volume or volume) and fields["dataset"]:
        dataset, name = fields["dataset"], fields["volume"]
        raise Error(f"{name}: dataset {dataset}: this file has one array, without a name")
    is_named = bool(fields["color_by_field"]) and fields["field"] not in ("", "volume")
    field = is_named and is_there(fields["field"])
    if not volume and not field:
        return None
    return GivenScene(at, path, fields, volume, field, is_joined)


def _is_scene(arguments: Sequence[str], at: int) -> bool:
    """Whether `export` takes an argument for a scene in the volume's place."""
    return arguments[at].endswith(".json") and not arguments[at - 1].startswith("-")


def _names_volume(arguments: Sequence[str]) -> bool:
    """Whether an argument is a volume that the program reads."""
    return any(
        before != FIELD
        and not text.startswith("-")
        and (text.lower().endswith(OF_THE_COMPILED_PART) or text.startswith("generate:"))
        for before, text in zip(arguments, arguments[1:])
    )


def refuse_to_replace(scene: GivenScene, arguments: Sequence[str]) -> None:
    """Raises Error if --save-scene would take the scene's place: the program gets another name."""
    name = take_option([*arguments], "--save-scene")
    if name is not None and os.path.exists(name) and os.path.samefile(name, scene.path):
        raise Error(f"--save-scene: {name} would take the place of the input {scene.path}")


def name_real_files(path: str, names_of: dict[str, SourceFile | None]) -> None:
    """Puts files, datasets and indices in place of NRRD files, in a scene file."""
    fields = _core.read_scene(path)
    for name, prefix in (("volume", ""), ("field", "field_")):
        source = names_of.get(fields[name])
        if source is not None:
            fields |= {
                name: source.path,
                f"{prefix}dataset": source.dataset,
                f"{prefix}index": source.index,
            }
    _core.write_scene(fields, path)
