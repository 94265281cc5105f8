"""Signatures of functions that hand on arguments: help(), completion and inspect know all names."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any, TypeVar

Function = TypeVar("Function", bound=Callable[..., Any])


def takes(
    target: Callable[..., Any], *, without: tuple[str, ...] = (), **more: Any
) -> Callable[[Function], Function]:
    """Makes a function's signature name the arguments of `target` in place of `**more`.

    Type checkers know these arguments by the TypedDict of `**more`.

    without  those that the function does not take
    more     defaults that differ from target's, and those of further arguments
    """

    def decorate(function: Function) -> Function:
        signature = inspect.signature(function)
        own = [each for each in signature.parameters.values() if each.kind is not each.VAR_KEYWORD]
        known = {"self", *without, *(each.name for each in own)}
        handed_on = [
            each.replace(kind=each.KEYWORD_ONLY, default=more.get(each.name, each.default))
            for each in inspect.signature(target).parameters.values()
            if each.name not in known
        ]
        own += [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default)
            for name, default in more.items()
            if name not in inspect.signature(target).parameters
        ]
        whole = signature.replace(parameters=[*own, *handed_on])
        function.__signature__ = whole  # type: ignore[attr-defined]
        return function

    return decorate
