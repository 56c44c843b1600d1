"""Strategies that spoil what is valid: bytes, and documents of the kinds that JSON has."""

import copy
import json
import math
import re

from hypothesis import strategies as st

#: What takes the place of a number in a text; and of a word, as YAML, JSON and WKT have some.
NUMBERS = [b"0", b"-1", b"00", b"-0.0", b"1e-320", b"1e-9", b"0.1", b"1", b"3", b"7", b"1e8", b"1e9", b"1e10", b"1e308", b"1e400",
           b"nan", b"inf", b"-inf", b"NaN", b"Infinity", b".nan", b"-.inf", b"0x10", b"1_0", b"30000", b"65535", b"65536",
           b"2147483648", b"-2147483648", b"4294967295", b"4294967296", b"18446744073709551616", b"9" * 400, b"9" * 5000,
           b"1.", b".", b"1e", b"- 1", "\u0663".encode()]
WORDS = [b"", b"null", b"~", b"true", b"yes", b"[]", b"{}", b"''", b'""', b"*a", b"&a", b"!!int", b"!!python/none", b"<<", b"---",
         b"?", b"|", b"#", b"%YAML 1.1", b"EMPTY", b"Z", b"ZM", b"MULTI", b"POLYGON", b"CURVEPOLYGON", b"GEOMETRYCOLLECTION",
         b"raw", b"scale", b"/dev/zero", b"..", b"a/../b", b"~root", b"n" * 5000, b"\xff\xfe", b"\xef\xbb\xbf",
         b"\0", b"\x1b[31m", b"\r\n", b"\t", "\u2028".encode(), b'"\\ud800"', b'"\\u0000"']
NESTS = [b"[", b"(", b"{", b'{"a":', b"- ", b"? ", b"((", b"[[0, 0],", b"'", b'"', b"\\", b" ", b"\n", b"#"]
#: What takes the place of a value in a document.
ODD = [None, True, False, 0, -1, 1, 2**31, -2**63, 2**64, 10**400, 0.0, -0.0, 0.5, 1e-320, 1e-9, 1e8, 1e9, 1e308, math.nan,
       math.inf, -math.inf, "", " ", "1", "nan", "two\nlines", "\x1b[31m", "\0", "\ud800", "n" * 5000, "/dev/zero", "..", "~\0",
       [], {}, [[]], [0], [0, 0], [0, 0, 0], [0, 0, 0, 0], ["0", "0", "0"], [True, True, True], [None] * 3, [10**400] * 3,
       [[0, 0]] * 4, {"a": 1}]

odd_values = (st.sampled_from(ODD).map(copy.deepcopy) | st.integers() | st.floats() | st.text(max_size=20)
              | st.lists(st.floats(), max_size=4))


@st.composite
def spoiled(draw, seeds):
    """One of several contents in bytes, changed in up to four places."""
    content = draw(st.sampled_from(seeds))
    for _ in range(draw(st.integers(1, 4))):
        content = draw(st.sampled_from(_EDITS))(draw, content)
    return content


def _place(draw, content, longest=12):
    at = draw(st.integers(0, len(content)))
    return at, at + draw(st.integers(0, longest))


def _flipped(draw, content):
    at, _ = _place(draw, content)
    return content[:at] + bytes(b ^ 1 << draw(st.integers(0, 7)) for b in content[at:at + 1]) + content[at + 1:]


def _replaced(draw, content):
    at, end = _place(draw, content)
    return content[:at] + draw(st.binary(max_size=12)) + content[end:]


def _cut(draw, content):
    at, end = _place(draw, content, len(content))
    return content[:at] + content[end:]


def _doubled(draw, content):
    at, end = _place(draw, content, len(content))
    return content[:end] + draw(st.sampled_from([1, 2, 50])) * content[at:end] + content[end:]


def _renumbered(draw, content):
    found = list(re.finditer(rb"[-+]?\d[\d.eE+-]*", content))
    if not found:
        return content
    number = draw(st.sampled_from(found))
    return content[:number.start()] + draw(st.sampled_from(NUMBERS)) + content[number.end():]


def _reworded(draw, content):
    found = list(re.finditer(rb"[^\W\d]+|[\[\](){}:,]", content))
    if not found:
        return content
    word = draw(st.sampled_from(found))
    other = draw(st.sampled_from(WORDS) | st.sampled_from(found).map(lambda match: match[0]))
    return content[:word.start()] + other + content[word.end():]


def _nested(draw, content):
    at, end = _place(draw, content)
    return content[:at] + draw(st.sampled_from(NESTS)) * draw(st.sampled_from([2, 40, 3000, 20_000])) + content[end:]


_EDITS = [_flipped, _replaced, _cut, _doubled, _renumbered, _reworded, _nested]


@st.composite
def spoiled_documents(draw, seeds):
    """One of several documents of dicts, lists and plain values, changed in up to three places."""
    root = [copy.deepcopy(draw(st.sampled_from(seeds)))]
    for _ in range(draw(st.integers(1, 3))):
        places = list(_places(root))
        if places:
            draw(st.sampled_from(_CHANGES))(draw, *draw(st.sampled_from(places)), places)
    return root[0] if root else None


def _places(node):
    """(container, key) of every value in a document."""
    for key, value in list(node.items() if isinstance(node, dict) else enumerate(node)):
        yield node, key
        if isinstance(value, dict | list):
            yield from _places(value)


def _put_odd(draw, container, key, places):
    container[key] = draw(odd_values)


def _drop(draw, container, key, places):
    del container[key]


def _rename(draw, container, key, places):
    if isinstance(container, dict):
        container[draw(st.text(max_size=8))] = container.pop(key)


def _wrap(draw, container, key, places):
    value = container[key]
    container[key] = draw(st.sampled_from([[value], {"a": value}, str(value), repr(value), [value] * 9]))


def _copy_over(draw, container, key, places):
    other, at = draw(st.sampled_from(places))
    container[key] = copy.deepcopy(other[at])


def _insert(draw, container, key, places):
    if isinstance(container, list):
        container.insert(key, draw(odd_values | st.just(copy.deepcopy(container[key]))))


def _scale(draw, container, key, places):
    if isinstance(container[key], int | float) and abs(container[key]) < 1e300:  # a longer integer is no float
        container[key] *= draw(st.sampled_from([-1, 0.5, 1e-9, 1e9, 1 + 1e-12, math.nan]))


_CHANGES = [_put_odd, _drop, _rename, _wrap, _copy_over, _insert, _scale]


def json_of(seeds):
    """Texts of JSON, as bytes: spoiled documents, spoiled texts, and any bytes."""
    texts = [json.dumps(seed).encode() for seed in seeds]
    return spoiled_documents(seeds).map(lambda document: json.dumps(document).encode()) | spoiled(texts) | st.binary(max_size=80)
