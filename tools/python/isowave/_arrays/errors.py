"""Errors of arrays that cannot be read: one line each, which says what is wrong and what helps."""

from __future__ import annotations

from typing import Any

_MOST_CHARACTERS = 400


class ArrayValueError(ValueError):
    """The array is of a kind that can be read, but its voxels, shape or grid cannot."""


class ArrayTypeError(TypeError):
    """The object, or its type of voxels, cannot be read."""


def one_line(text: object) -> str:
    """Returns the text with every run of white space as one blank, cut if it is too long."""
    try:
        line = " ".join(str(text).split())
    except Exception:  # an object whose text raises must still give a message
        line = f"a {type(text).__name__}"
    return line if len(line) <= _MOST_CHARACTERS else line[: _MOST_CHARACTERS - 3] + "..."


def short(value: object) -> str:
    """Returns a value as a message shows it: its repr on one line, at most 60 characters."""
    try:
        line = " ".join(repr(value).split())
    except Exception:
        line = f"a {type(value).__name__}"
    return line if len(line) <= 60 else line[:57] + "..."


def bad_value(what: str, problem: str) -> ArrayValueError:
    """Returns the error of a value: raise it. `what` names the array, as a file name would."""
    return ArrayValueError(one_line(f"{what}: {problem}"))


def bad_type(what: str, problem: str) -> ArrayTypeError:
    """Returns the error of a type: raise it. `what` names the array, as a file name would."""
    return ArrayTypeError(one_line(f"{what}: {problem}"))


def type_name(obj: Any) -> str:
    """Returns the package and the class of an object, as "numpy.ndarray"; "list" for a builtin."""
    cls = type(obj)
    package = str(getattr(cls, "__module__", "")).partition(".")[0]
    return cls.__name__ if package in ("", "builtins", "__main__") else f"{package}.{cls.__name__}"
