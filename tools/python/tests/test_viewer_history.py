"""Undo and redo; and gestures at random, which leave no error.

ISOWAVE_GESTURES  how many; 120 without
"""

from __future__ import annotations

import os
import random
from collections.abc import Callable
from typing import Any

import numpy as np
from browser_pages import (
    DRAWN,
    browser,
    button,
    changes,
    drag,
    isovalue,
    menu,
    open_page,
    page,
    rests,
    server,
    state,
    type_into,
)

from isowave.viewer.server import Server

GESTURES = int(os.environ.get("ISOWAVE_GESTURES", "120"))


def undo(page: Any) -> None:
    page.locator(".picture").press("Control+z")


def test_undo_and_redo_give_exactly_the_states_before(page: Any) -> None:
    assert button(page, "Undo").is_disabled() and button(page, "Redo").is_disabled()
    acts: list[Callable[[], object]] = [
        lambda: drag(page, 90, 30),
        lambda: type_into(isovalue(page), "120"),
        lambda: page.get_by_label("Colour of surface 1").fill("#3366cc"),
        lambda: button(page, "Add surface").click(),
        lambda: page.get_by_label("y to", exact=True).fill("60"),
        lambda: button(page, "Add plane").click(),
        lambda: button(page, "Add x").click(),
        lambda: page.get_by_label("Good", exact=True).check(),
        lambda: page.get_by_label("Depth", exact=True).check(),
        lambda: page.get_by_label("Background", exact=True).fill("#203040"),
        lambda: page.get_by_label("Axes", exact=True).check(),
        lambda: button(page, "Reset view").click(),
    ]
    states, pictures = [state(page)], [page.evaluate(DRAWN)]
    for act in acts:
        page.wait_for_timeout(550)  # what follows sooner is undone with it
        act()
        rests(page)
        states.append(state(page))
        pictures.append(page.evaluate(DRAWN))
        assert states[-1] != states[-2]
    for before, picture in zip(states[-2::-1], pictures[-2::-1]):
        undo(page)
        rests(page)
        assert state(page) == before and page.evaluate(DRAWN) == picture
    assert button(page, "Undo").is_disabled()
    for after, picture in zip(states[1:], pictures[1:]):
        page.locator(".picture").press("Control+y")
        rests(page)
        assert state(page) == after and page.evaluate(DRAWN) == picture
    assert button(page, "Redo").is_disabled() and page.problems == []


def test_a_drag_is_undone_as_one_and_a_new_change_ends_redo(page: Any) -> None:
    home = state(page)
    drag(page, 100, 0)
    drag(page, 0, 60)
    rests(page)
    turned = state(page)
    button(page, "Undo").click()
    rests(page)
    between = state(page)
    assert between not in (home, turned)
    page.locator(".picture").press("Control+Shift+Z")
    rests(page)
    assert state(page) == turned
    for _ in range(2):
        undo(page)
    rests(page)
    assert state(page) == home
    drag(page, -30, 0)
    rests(page)
    assert button(page, "Redo").is_disabled()


def test_a_text_has_an_undo_of_its_own(page: Any) -> None:
    assert changes(page, lambda: drag(page, 100, 0))
    turned = state(page)["eye"]
    type_into(isovalue(page), "120")
    page.keyboard.press("Control+z")
    rests(page)
    assert state(page)["eye"] == turned
    # On a slider it is the view's.
    page.get_by_label("z to", exact=True).focus()
    page.keyboard.press("Control+z")
    rests(page)
    assert state(page)["iso"] == "80"


def test_what_changes_nothing_is_not_undone(page: Any) -> None:
    home = state(page)
    assert changes(page, lambda: drag(page, 100, 0))
    page.emulate_media(color_scheme="dark")
    page.emulate_media(color_scheme="light")
    rests(page)
    undo(page)
    rests(page)
    assert state(page) == home


def gesture(page: Any, dice: random.Random) -> None:
    """One that people make: drags, wheels, keys, buttons, sliders, tools."""
    x, y = dice.uniform(60, 660), dice.uniform(60, 500)
    kind = dice.choice("drag drag wheel click double key press slide tool undo menu".split())
    if kind == "drag":
        page.mouse.move(x, y)
        page.mouse.down(button=dice.choice(["left", "left", "right", "middle"]))
        page.mouse.move(dice.uniform(0, 990), dice.uniform(0, 630), steps=3)
        page.mouse.up()
        page.mouse.up(button="right")
        page.mouse.up(button="middle")
    elif kind == "wheel":
        page.mouse.move(x, dice.choice([y, 600]))
        page.mouse.wheel(dice.uniform(-50, 50), dice.uniform(-400, 400))
    elif kind == "click":
        page.mouse.click(x, y)
    elif kind == "double":
        page.mouse.dblclick(x, y)
    elif kind == "key":
        keys = "ArrowLeft ArrowUp Shift+ArrowRight + - 1 3 7 9 q e r Escape Tab Control+z"
        page.keyboard.press(dice.choice(keys.split()))
    elif kind == "press":
        buttons = page.locator(".panel button:visible:enabled, .cube g[display=inline]")
        if count := buttons.count():
            buttons.nth(dice.randrange(count)).dispatch_event("click")
    elif kind == "slide":
        sliders = page.locator("input[type=range]:visible:enabled")
        slider = sliders.nth(dice.randrange(sliders.count()))
        slider.evaluate(
            """(e, share) => { e.value = Number(e.min) + share * (e.max - e.min);
            e.dispatchEvent(new Event("input", { bubbles: true })); }""",
            dice.random(),
        )
    elif kind == "tool":
        tools = page.locator(".tools button")
        tools.nth(dice.randrange(tools.count())).click()
    elif kind == "undo":
        page.locator(".picture").press(dice.choice(["Control+z", "Control+z", "Control+y"]))
    else:
        menu(page, dice.choice("file camera export info help".split()))
        page.keyboard.press("Escape")


def test_gestures_at_random_leave_no_error(open_page: Callable[..., Any], server: Server) -> None:
    dice = random.Random(46)
    page = open_page(reduced_motion="reduce")
    page.set_default_timeout(20000)
    page.goto(server.url)
    rests(page)
    for i in range(GESTURES):
        gesture(page, dice)
        assert page.problems == [], f"gesture {i}"
    page.keyboard.press("Escape")
    page.keyboard.press("Escape")
    page.wait_for_timeout(300)
    ready = "() => document.querySelector('main').dataset.state === 'ready'"
    page.wait_for_function(ready)
    # All of it is undone: as often as there is something to undo.
    for _ in range(500):
        if button(page, "Undo").is_disabled():
            break
        undo(page)
    page.wait_for_timeout(200)
    assert np.isfinite([float(x) for x in state(page)["eye"].split(",")]).all()
    assert page.problems == []
