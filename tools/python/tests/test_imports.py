"""The package's modules import each other in one direction."""

from __future__ import annotations

import ast
import graphlib
import pathlib
from collections.abc import Iterator

import isowave

PACKAGE = pathlib.Path(isowave.__file__).parent


def names_of(path: pathlib.Path) -> list[str]:
    """A module's name in parts: ["isowave", "viewer", "scene"]."""
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return [*parts[:-1]] if parts[-1] == "__init__" else [*parts]


def imported(path: pathlib.Path, modules: set[str]) -> Iterator[str]:
    """The package's modules that a module imports: anywhere, in functions and for types, too."""
    package = names_of(path) if path.name == "__init__.py" else names_of(path)[:-1]
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in modules)
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else []
            source = ".".join([*above, *filter(None, [node.module])])
            for alias in node.names:
                inner = f"{source}.{alias.name}"
                if inner in modules or source in modules:
                    yield inner if inner in modules else source


def test_modules_import_each_other_in_one_direction() -> None:
    paths = {".".join(names_of(path)): path for path in PACKAGE.rglob("*.py")}
    modules = {*paths, "isowave._core"}
    graph = {name: {*imported(path, modules)} - {name} for name, path in paths.items()}
    assert "isowave._renderer" in graph["isowave._volume"]
    graphlib.TopologicalSorter(graph).prepare()  # raises CycleError, with the circle
