"""Damage to files: bits, cuts, repeats, lengths that lie, and, in JSON, values that nobody expects."""

from __future__ import annotations

import json
import random
import struct
from typing import Any

EDGES = (0, 1, -1, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, -0x80000000, 0x7FFFFFFFFFFFFFFF)
VALUES: tuple[Any, ...] = (
    *(None, True, -1, 0, 1, 2**31, 2**63, 10**30, 1e308, -1e-320, float("nan"), float("inf")),
    *("", "x", "../../outside", "/etc/passwd", "\x00", "é" * 1000, [], {}, [[]], [None], {"": {}}, "1" * 5000),
)
WORDS = (b"nan", b"-inf", b"1e400", b"\x00", b"\xff\xfe", b"99999999999999999999", b"../", b"{", b"[" * 2000, b"\n")


def damaged(data: bytes, chance: random.Random, others: list[bytes]) -> bytes:
    """Return a file's bytes with one to four kinds of damage; ``others`` are files that it may be spliced with."""
    if data[:1] in (b"{", b"[") and chance.random() < 0.6:
        try:
            return json.dumps(_replaced(json.loads(data), chance)).encode()
        except (ValueError, RecursionError):
            pass
    result = bytearray(data)
    for _ in range(chance.randint(1, 4)):
        chance.choice((_flip, _flip, _edge, _edge, _cut, _repeat, _word, _noise))(result, chance)
    if others and chance.random() < 0.05:
        result[chance.randrange(len(result) + 1) :] = chance.choice(others)
    return bytes(result)


def _replaced(value: Any, chance: random.Random) -> Any:
    """Replace, remove or double something in a JSON value."""
    if isinstance(value, dict) and value and chance.random() < 0.9:
        key = chance.choice(list(value))
        if chance.random() < 0.1:
            return {name: item for name, item in value.items() if name != key}
        return value | {key: _replaced(value[key], chance)}
    if isinstance(value, list) and value and chance.random() < 0.8:
        place = chance.randrange(len(value))
        if chance.random() < 0.15:
            return value[:place] + value[place + 1 :]
        if chance.random() < 0.05:
            return value * 50
        return [*value[:place], _replaced(value[place], chance), *value[place + 1 :]]
    return chance.choice(VALUES)


def _flip(data: bytearray, chance: random.Random) -> None:
    for _ in range(chance.choice((1, 1, 4, 30)) if data else 0):
        data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)


def _edge(data: bytearray, chance: random.Random) -> None:
    """Write a number of 1 to 8 bytes that is at the end of some range, rather where headers are."""
    kind = chance.choice("bhiq")
    size = struct.calcsize(kind)
    if len(data) < size:
        return
    start = min(int(len(data) * chance.random() ** chance.choice((1, 3))), len(data) - size)
    value = chance.choice(EDGES) & (2 ** (8 * size) - 1)
    data[start : start + size] = value.to_bytes(size, chance.choice(("little", "big")))


def _cut(data: bytearray, chance: random.Random) -> None:
    start = chance.randrange(len(data) + 1)
    end = len(data) if chance.random() < 0.5 else min(len(data), start + chance.randint(1, 64))
    del data[start:end]


def _repeat(data: bytearray, chance: random.Random) -> None:
    start = chance.randrange(len(data) + 1)
    part = data[start : start + chance.randint(1, 200)]
    data[start:start] = part * chance.choice((1, 2, 50))


def _word(data: bytearray, chance: random.Random) -> None:
    start = chance.randrange(len(data) + 1)
    data[start:start] = chance.choice(WORDS)


def _noise(data: bytearray, chance: random.Random) -> None:
    start = chance.randrange(len(data) + 1)
    data[start : start + chance.randint(1, 40)] = chance.randbytes(chance.randint(1, 40))
