#!/usr/bin/env python3
"""relaxed.py ENGINE.wasm: makes a linked engine one that relaxed.js can fit to any browser.

Clang 14 writes opcodes of a draft of WebAssembly's relaxed vector instructions; they become those
of the standard. Their places go into a section of the module, "isowave.relaxed", behind which
nothing follows:

    LEB128  the number of engine_fma(), in two bytes as a call has it
    LEB128  for each instruction, the bytes from the one before it, or from the module's begin

Names of functions, by which engine_fma() is found, go. An instruction that this file does not know
is an error, since no byte after it could be told from an opcode.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

CODE, CUSTOM = 10, 0
REPLACEMENT = "engine_fma"  # tools/page/fma.cpp
# From the draft's opcodes to the standard's, all of two bytes: i32x4.relaxed_trunc_f32x4_s,
# f32x4.relaxed_madd, f32x4.relaxed_nmadd, i32x4.relaxed_laneselect.
STANDARD = {0xA5: 0x101, 0xAF: 0x105, 0xB0: 0x106, 0xD2: 0x10B}

# What follows an opcode: LEB128 numbers (n), bytes (b). Blocks have a type, which is one, too.
NO_OPERANDS = {0x00, 0x01, 0x05, 0x0B, 0x0F, 0x19, 0x1A, 0x1B, 0xD1, *range(0x45, 0xC5)}
OPERANDS = {
    **dict.fromkeys(NO_OPERANDS, ""),
    **dict.fromkeys((0x02, 0x03, 0x04, 0x06, 0x07, 0x08, 0x09, 0x0C, 0x0D, 0x10, 0x18), "n"),
    **dict.fromkeys((0x3F, 0x40, 0x41, 0x42, 0xD0, 0xD2, *range(0x20, 0x27)), "n"),
    **dict.fromkeys((0x11, *range(0x28, 0x3F)), "nn"),
    0x43: "bbbb",
    0x44: "b" * 8,
}
# Behind 0xFC: of memories and tables.
BULK = {**dict.fromkeys(range(8), ""), 8: "nn", 10: "nn", 12: "nn", 14: "nn"}
BULK |= dict.fromkeys((9, 11, 13, 15, 16, 17), "n")
# Behind 0xFD: vectors. Those that are not here have no operands.
VECTOR = {
    **dict.fromkeys((*range(12), 92, 93), "nn"),
    **dict.fromkeys((12, 13), "b" * 16),
    **dict.fromkeys(range(21, 35), "b"),
    **dict.fromkeys(range(84, 92), "nnb"),
}


def fail(text: str) -> None:
    sys.exit(f"relaxed: {text}")


def leb(data: bytes, at: int) -> tuple[int, int]:
    """The number at a place, unsigned, and the place behind it."""
    number = shift = 0
    while True:
        byte = data[at]
        at += 1
        number |= (byte & 0x7F) << shift
        shift += 7
        if byte < 0x80:
            return number, at


def to_leb(number: int, least_bytes: int = 1) -> bytes:
    result = bytearray()
    while number >= 0x80 or len(result) + 1 < least_bytes:
        result.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes([*result, number])


def sections(module: bytes) -> Iterator[tuple[int, int, int, int]]:
    """Number, begin, and begin and end of the content of each section."""
    at = 8
    while at < len(module):
        size, content = leb(module, at + 1)
        yield module[at], at, content, content + size
        at = content + size


def text(data: bytes, at: int) -> tuple[str, int]:
    size, at = leb(data, at)
    return data[at : at + size].decode(), at + size


def behind(code: bytes, at: int, operands: str) -> int:
    for kind in operands:
        at += 1
        if kind == "n":
            while code[at - 1] >= 0x80:
                at += 1
    return at


def relaxed_in(code: bytes, at: int, end: int) -> list[int]:
    """Places of relaxed instructions among those from a place on."""
    found = []
    while at < end:
        begin, opcode = at, code[at]
        at += 1
        if opcode == 0xFD:
            number, at = leb(code, at)
            if number in STANDARD:
                found.append(begin)
            at = behind(code, at, VECTOR.get(number, ""))
        elif opcode == 0xFC:
            number, at = leb(code, at)
            at = behind(code, at, BULK[number])
        elif opcode == 0x0E:  # br_table
            count, at = leb(code, at)
            at = behind(code, at, "n" * (count + 1))
        elif opcode == 0x1C:  # select with types
            count, at = leb(code, at)
            at = behind(code, at, "n" * count)
        elif opcode in OPERANDS:
            at = behind(code, at, OPERANDS[opcode])
        else:
            fail(f"the instruction {opcode:#x} at {begin} is not known")
    if at != end:
        fail(f"a function does not end at {end}")
    return found


def relaxed_instructions(module: bytes, at: int) -> list[int]:
    """The same of a section of code."""
    found = []
    count, at = leb(module, at)
    for _ in range(count):
        size, at = leb(module, at)
        end = at + size
        groups, at = leb(module, at)
        at = behind(module, at, "nn" * groups)  # variables
        found += relaxed_in(module, at, end)
        at = end
    return found


def number_of(name: str, module: bytes, at: int, end: int) -> int | None:
    """The number of a function, from a section of names."""
    while at < end:
        kind, (size, content) = module[at], leb(module, at + 1)
        at = content + size
        if kind != 1:
            continue
        count, place = leb(module, content)
        for _ in range(count):
            number, place = leb(module, place)
            found, place = text(module, place)
            if found == name:
                return number
    return None


def adaptable(linked: bytes) -> bytes:
    module = bytearray(linked)
    places: list[int] = []
    function, kept = None, len(module)
    for kind, begin, at, end in sections(linked):
        name = ""
        if kind == CUSTOM:
            name, at = text(linked, at)
        if kind == CODE:
            places = relaxed_instructions(linked, at)
        if name == "name":
            function = number_of(REPLACEMENT, linked, at, end)
            kept = begin
        elif begin > kept:
            fail("something follows the section of names")
    if function is None or function >= 1 << 14:
        fail(f"{REPLACEMENT}() has no number of two bytes")
    content = bytearray(b"\x0fisowave.relaxed" + to_leb(function, 2))
    before = 0
    for place in places:
        draft, behind_it = leb(linked, place + 1)
        module[place + 1 : behind_it] = to_leb(STANDARD[draft], 2)
        content += to_leb(place - before)
        before = place
    print(f"relaxed: {len(places)} instructions, function {function}")
    return bytes(module[:kept]) + bytes([CUSTOM]) + to_leb(len(content)) + bytes(content)


def main() -> None:
    file = Path(sys.argv[1])
    file.write_bytes(adaptable(file.read_bytes()))


if __name__ == "__main__":
    main()
