"""Bytes made worse: blindly, by the tokens of a text, by the parts of an archive, by the keys of a JSON."""

import io
import json
import random
import re
import zipfile
from collections.abc import Callable, Mapping

Mutation = Callable[[bytes, bytes, random.Random], bytes]
"""Of a file, with another of its kind at hand."""
NUMBERS = (
    *("0", "-0", "1", "-1", "2", "0.5", "1e9", "-1e9", "1e10", "1e300", "-1e300", "1e308", "1e-300", "1e-320", "1e400"),
    *("nan", "inf", "-inf", "NaN", "99999999999999999999", "2147483648", "-2147483649", "1000000", "100000", "1e5"),
    *("0x10", "1_000", "1,5", "", " ", "--1", "1e", "e", ".", "١", "true", "null", "${x}", "-1 0 0", "0 0 0", "1 2"),
)
WORDS = ("$", "[/]", "[red]", "\\", "..", "/", "x" * 300, "é", "\u202e", "'", '"', "%s", "{0}", "__class__", "\t")
_NUMBER = re.compile(rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_WORD = re.compile(rb"[A-Za-z_][A-Za-z_0-9]*")
_ELEMENT = re.compile(rb"<[A-Za-z][^<>]*?/>|<(\w+)[^<>]*>(?:[^<]|<(?!/\1>))*</\1>")


def blind(data: bytes, other: bytes, rng: random.Random) -> bytes:
    """A few bytes flipped, written over, put in, taken away, doubled, or spliced with another file."""
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 4, 16))):
        at, size = rng.randrange(len(out) + 1), rng.choice((1, 1, 2, 4, 8, 64))
        match rng.randrange(7):
            case 0 if at < len(out):
                out[at] ^= 1 << rng.randrange(8)
            case 1:
                out[at : at + size] = rng.randbytes(size)
            case 2:
                out[at : at + size] = rng.choice((b"\0", b"\xff", b"\x7f", b"\x80")) * size
            case 3:
                out[at:at] = rng.randbytes(size)
            case 4:
                del out[at : at + size]
            case 5:
                out[at:at] = out[at : at + 32 * size]
            case _:
                out = out[:at] + bytearray(other[rng.randrange(len(other) + 1) :]) if other else out[:at]
        if not out:
            return b""
    return bytes(out)


def tokens(data: bytes, other: bytes, rng: random.Random) -> bytes:
    """Numbers, words, lines and elements of a text exchanged, doubled, taken away."""
    for _ in range(rng.choice((1, 1, 2, 3))):
        match rng.randrange(7):
            case 0 | 1:
                data = _exchange(data, _NUMBER, [text.encode() for text in NUMBERS], rng)
            case 2:
                data = _exchange(data, _WORD, [match[0] for match in _WORD.finditer(data[:20_000])], rng)
            case 3:
                data = _exchange(data, _WORD, [text.encode() for text in WORDS], rng)
            case 4:
                data = _lines(data, rng)
            case 5:
                data = _exchange(data, _ELEMENT, [b"", *(match[0] for match in _ELEMENT.finditer(other[:20_000]))], rng)
            case _:
                data = _nested(data, rng)
    return data


def archive(data: bytes, other: bytes, rng: random.Random) -> bytes:
    """An NPZ with a member's bytes, header or name changed, or another compression."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as packed:
            members = {name: packed.read(name) for name in packed.namelist()}
    except Exception:  # a mutant of a mutant
        return blind(data, other, rng)
    name = rng.choice(sorted(members) or ["x.npy"])
    content = members.pop(name, b"")
    header, body = content[:128], content[128:]
    match rng.randrange(5):
        case 0:
            header = tokens(header, b"", rng)
        case 1:
            kind = rng.choice(
                (b"<f4", b"<i8", b"<c16", b"|O", b"<U9", b"|b1", b"<M8[s]", b"|V8", b">f8", b"<f2", b"|S4")
            )
            header = header.replace(b"<f8", kind)
        case 2:
            body = blind(body, other, rng)
        case 3:
            name = _exchange(name.encode(), _WORD, [b"q", b"q1", b"tau", b"time", b"v", b"x"], rng).decode()
        case _:
            content = blind(content, other, rng)
            header, body = content[:128], content[128:]
    members[name] = header + body
    kinds = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)
    return zip_of(members, rng.choice(kinds))


def zip_of(members: Mapping[str, bytes], compression: int) -> bytes:
    """A ZIP archive that is the same every time: its clock stands."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as packed:
        for name, content in members.items():
            packed.writestr(zipfile.ZipInfo(name), content, compression)
    return stream.getvalue()


def keys(data: bytes, other: bytes, rng: random.Random) -> bytes:
    """A JSON with values exchanged, keys renamed, doubled or taken away."""
    try:
        content = json.loads(data)
    except ValueError:
        return blind(data, other, rng)
    for _ in range(rng.choice((1, 1, 2, 3))):
        place, key = _somewhere(content, rng)
        if place is None:
            break
        match rng.randrange(4):
            case 0:
                del place[key]
            case 1 if isinstance(place, dict):
                place[rng.choice((*map(str, place), *WORDS))] = place.pop(key)
            case _:
                place[key] = _value(content, rng)
    return json.dumps(content).encode("utf-8", "surrogatepass")


def _value(content: object, rng: random.Random) -> object:
    if rng.random() < 0.2:
        place, key = _somewhere(content, rng)
        return None if place is None else json.loads(json.dumps(place[key]))
    simple = (None, True, False, [], {}, "", "x", [[]], {"a": {}}, [1, "a"], float("nan"), float("inf"), -1, 0, 1, 0.5)
    return rng.choice((*simple, 1e300, -1e300, 1e-300, 10**400, 1e8, -1e8, [1.0] * 3, *WORDS))


def _somewhere(content: object, rng: random.Random) -> tuple[object, object]:
    """A container in a JSON and a key in it, those near the top as likely as all others."""
    place, key = None, None
    while isinstance(content, dict | list) and content:
        place, key = content, rng.choice(sorted(content) if isinstance(content, dict) else range(len(content)))
        content = place[key]
        if rng.random() < 0.3:
            break
    return place, key


def _exchange(data: bytes, pattern: re.Pattern[bytes], choices: list[bytes], rng: random.Random) -> bytes:
    found = [match.span() for match in pattern.finditer(data[:100_000])]
    if not found or not choices:
        return data
    start, stop = rng.choice(found)
    return data[:start] + rng.choice(choices) + data[stop:]


def _lines(data: bytes, rng: random.Random) -> bytes:
    lines = data.splitlines(keepends=True)
    if len(lines) < 2:
        return data
    i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    match rng.randrange(4):
        case 0:
            del lines[i]
        case 1:
            lines[i], lines[j] = lines[j], lines[i]
        case 2:
            lines[i:i] = lines[j : j + 3]
        case _:
            lines[i] = lines[i][: rng.randrange(len(lines[i]) + 1)]
    return b"".join(lines)


def _nested(data: bytes, rng: random.Random) -> bytes:
    """A body, link or row many times: replicated, or within itself."""
    spots = [match.start() for match in re.finditer(rb"<body|<geom|<link|<joint", data[:100_000])]
    if not spots:
        return data
    at = rng.choice(spots)
    match = _ELEMENT.match(data, at)
    if match is None:
        return data
    count = str(rng.choice((2, 7, 100, 10_000, 1_000_000, -3))).encode()
    opening = rng.choice((b'<replicate count="' + count + b'">', b"<frame>", b"<body>", b"<attach/>", b"<include/>"))
    closing = b"</" + re.match(rb"<(\w+)", opening)[1] + b">" if not opening.endswith(b"/>") else b""  # type: ignore[index]
    return data[:at] + opening + match[0] + closing + data[match.end() :]
