"""Values, words and numbers that readers of messages have stumbled over."""

import math
from typing import Any

import msgpack

from benchmarks.fuzz.hostile import Pairs, Raw

NUMBERS: list[Any] = [
    *(0, 1, -1, 2, 3, 4, 14, 255, 256, 257, 1023, 1024, 1025, 2**31, -(2**31), 2**32),
    *(2**53 - 1, 2**53, 2**63 - 1, 2**63, 2**64 - 1, 2**64, -(2**63), 10**25, 10**400),
    *(0.0, -0.0, 0.5, 1.0, 1.0 + 1e-12, 1e-6, 5e-324, 1e-160, 99.9, 100.0, 100.1, 1e75, 1e150, 1.1e150, 1e300),
    *(1.7976931348623157e308, math.nan, math.inf, -math.inf),
]

_FIELDS = """
verb id v left_wrist right_wrist q dq preset mode waist left_elbow right_elbow weights collision starts
current_lr_arm_q current_lr_arm_dq token stream budget_ms
sol_q success error_msg status boot_id tau position_error rotation_error clearance nearest start iterations
solve_us server_us statuses joint_names lower protocol
"""
_CHOICES = """
solve solve_batch fk info track reach off report avoid precise openwbt ok unreachable blocked not_converged
bad_request unsupported overloaded internal superseded expired unauthorized
"""
_STRANGE = ["", "\n", "\x00", "\ud800", "\U0001f9be", "\u202e", "x" * 65, "y" * 5000, "%s{0}", "'\"\\"]
WORDS = [*_FIELDS.split(), *_CHOICES.split(), *_STRANGE]
"""Names of fields, words that stand for a choice, and strings that were never meant for either."""

JSON_VALUES: list[Any] = [
    *(None, True, False, [], {}, [[]], [None], [True, 1.0], {"q": {"q": {}}}, [0.0] * 14, [1] * 14, [["0"] * 4] * 4),
    *(Raw(b"[" * n + b"]" * n) for n in (5, 900, 1100)),
    *(Raw(b'{"q":' * n + b"0" + b"}" * n) for n in (5, 1100)),
    *map(Raw, (b"1e400", b"-1e999", b"1" * 5000, b"0." + b"0" * 400 + b"1", b"01", b"+1", b".5", b"1.", b"0x10")),
    *map(Raw, (b"NaN", b"-Infinity", b"nul", b"'q'", b"[1,]", b"[,1]", b"\xff", b"\xc3", b'"\xed\xa0\x80"', b"/**/1")),
    *map(Raw, (b'"\\ud800"', b'"\\ud83d\\ude00"', b'"\\x"', b'"\\u12"', b'"', b"\xef\xbb\xbf{}", b"1 2", b"")),
    Pairs([("q", 1), ("q", 2)]),
]
"""Beside honest ones, what JSON forbids or its readers take differently."""

MSGPACK_VALUES: list[Any] = [
    *(None, True, False, [], {}, [[]], [None], [True, 1.0], {"q": {"q": {}}}, [0.0] * 14, [["0"] * 4] * 4),
    *(b"", b"\x00", bytes(7), bytes(111), bytes(112), bytes(113), bytes(128), b"\xff" * 112, [bytes(4)] * 4),
    *([b"\x01\x00\x00\x00", b"\x00\x01\x00\x00", b"\x00\x00\x01\x00", b"\x00\x00\x00\x01"], [b"q"], {b"q": b"q"}),
    *(msgpack.ExtType(0, b""), msgpack.ExtType(5, bytes(112)), [msgpack.ExtType(1, b"1234")] * 4),
    *(msgpack.Timestamp(0), msgpack.Timestamp(2**34, 999_999_999)),
    *(Pairs([("q", 1), ("q", 2)]), Pairs([(1, 2)]), Pairs([(None, 1)]), Pairs([([], 1)]), Pairs([({}, 1)])),
    *(Raw(b"\x91" * n + b"\xc0") for n in (5, 500, 1100)),
    *(Raw(b"\x81\xa1q" * n + b"\xc0") for n in (5, 1100)),
    *(Raw((b"\xdd" + n.to_bytes(4, "big")) * 200) for n in (1000, 60_000, 2**32 - 1)),
    *map(Raw, (b"\xc1", b"\xd6\xff\x00\x00", b"\xd7\xff" + b"\xff" * 8, b"\xc7\x0c\xff" + b"\xff" * 12)),
    *map(Raw, (b"\xca\x7f\xc0\x00\x00", b"\xcb\x7f\xf0" + bytes(6), b"\xa2\xff\xfe", b"\xdb\xff\xff\xff\xff", b"\xc6")),
    *map(Raw, (b"\xdf\xff\xff\xff\xff", b"\xdd\x7f\xff\xff\xff", b"\xcf" + b"\xff" * 8, b"\xd3\x80" + bytes(7), b"")),
]
"""Beside honest ones: extension types, time stamps, keys of every kind, lengths that lie, and deep or wide nests."""
