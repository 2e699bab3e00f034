"""Ways to damage a file: bytes, lines, fields, numbers, nesting and encodings; the same seed gives the same damage."""

import re
from collections.abc import Callable, Sequence
from random import Random

Mutator = Callable[[Random, bytes], bytes]

LONGEST = 200_000
"""No input grows beyond this, so that sizes do not explode over several mutations [bytes]."""
NUMBERS = (
    *("0", "-0", "-1", "1", "7.0", "7.5", "+3", ".5", "5.", "1e3", "1e308", "-1e308", "1e309", "1e-320", "1e-999999"),
    *("nan", "-nan", "inf", "Infinity", "-Infinity", "1e99", "1e18", "1e999999999", "0e999999999"),
    *(
        str(sign * (2**power + offset))
        for power in (31, 32, 53, 62, 63, 64)
        for offset in (-1, 0, 1)
        for sign in (1, -1)
    ),
    *("1000000000", "1000000000000000", "9" * 400, "9" * 5000, "0." + "0" * 400 + "1", "0" * 5000 + "1"),
    *(
        "1_0",
        "0x10",
        "0b1",
        "1,5",
        "1d5",
        "1e",
        "--1",
        "1-",
        "\u0661\u0660",
        "\uff11",
        "\u00bd",
        "\u2212" + "1",
        "1\u00a0",
    ),
)
WORDS = (
    *("", "null", "true", "false", "None", "{}", "[]", '""', '"', "'", ",", ";", "#", "\t", "\x00", "\x1b[31m", "\x7f"),
    *("frame", "id", "x", "y", "track", "scene", "fps", "prediction_number", "splines", "A" * 10_000, "\\ud800"),
    *(
        "../../etc/passwd",
        "/dev/zero",
        "subprocess:getoutput",
        "__import__('os')",
        "<script>",
        "\u202e",
        "\ufeff",
        "%s",
    ),
)
_FIELD = re.compile(rb"[^\s,;:{}\[\]\"]+")
_ENCODINGS = ("utf-16", "utf-32", "utf-8-sig", "latin-1", "utf-7", "cp037")


def flip_bytes(random: Random, content: bytes) -> bytes:
    """Change some bytes."""
    changed = bytearray(content)
    for _ in range(random.choice((1, 1, 2, 5, 20))):
        if changed:
            changed[random.randrange(len(changed))] = random.randrange(256)
    return bytes(changed)


def flip_bit(random: Random, content: bytes) -> bytes:
    """Change one bit."""
    changed = bytearray(content)
    if changed:
        changed[random.randrange(len(changed))] ^= 1 << random.randrange(8)
    return bytes(changed)


def insert_bytes(random: Random, content: bytes) -> bytes:
    """Put bytes in between."""
    at = random.randint(0, len(content))
    return content[:at] + random.randbytes(random.choice((1, 2, 8, 100))) + content[at:]


def truncate(random: Random, content: bytes) -> bytes:
    """Cut the end, or the beginning."""
    at = random.randint(0, len(content))
    return content[:at] if random.random() < 0.8 else content[at:]


def delete_slice(random: Random, content: bytes) -> bytes:
    """Take out a piece."""
    a, b = _slice(random, content)
    return content[:a] + content[b:]


def repeat_slice(random: Random, content: bytes) -> bytes:
    """Repeat a piece."""
    a, b = _slice(random, content)
    return content[:b] + content[a:b] * random.choice((1, 2, 50)) + content[b:]


def replace_field(random: Random, content: bytes) -> bytes:
    """Put nasty numbers or words in the place of fields."""
    for _ in range(random.choice((1, 1, 1, 2, 4))):
        fields = list(_FIELD.finditer(content[:LONGEST]))
        if not fields:
            return content
        field = random.choice(fields)
        new = random.choice(NUMBERS if random.random() < 0.75 else WORDS).encode("utf-8", "surrogatepass")
        content = content[: field.start()] + new + content[field.end() :]
    return content


def change_number(random: Random, content: bytes) -> bytes:
    """Give one number another sign, size or digit; it often stays one that is allowed."""
    fields = [field for field in _FIELD.finditer(content[:LONGEST]) if field[0][:1].isdigit() or field[0][:1] == b"-"]
    if not fields:
        return content
    field = random.choice(fields)
    old = field[0]
    new = random.choice(
        (b"-" + old, old + b"0", old + b"000000", old[:-1] or b"0", b"0." + old, old + b"e5", old + old)
    )
    return content[: field.start()] + new + content[field.end() :]


def swap_fields(random: Random, content: bytes) -> bytes:
    """Exchange two fields."""
    fields = list(_FIELD.finditer(content[:LONGEST]))
    if len(fields) < 2:
        return content
    first, second = sorted(random.sample(fields, 2), key=lambda field: field.start())
    between = content[first.end() : second.start()]
    return content[: first.start()] + second[0] + between + first[0] + content[second.end() :]


def change_lines(random: Random, content: bytes) -> bytes:
    """Delete, repeat, move or shuffle lines."""
    lines = content.splitlines(keepends=True)
    if not lines:
        return content
    at = random.randrange(len(lines))
    match random.randrange(5):
        case 0:
            del lines[at]
        case 1:
            lines[at:at] = [lines[at]] * random.choice((1, 2, 300))
        case 2:
            lines.insert(random.randrange(len(lines)), lines.pop(at))
        case 3:
            random.shuffle(lines)
        case _:
            lines[at] = lines[at].rstrip(b"\r\n") + random.choice((b"", b"\r", b"\r\n", b"\x0b", b"\x85", b"\x1c"))
    return b"".join(lines)


def nest(random: Random, content: bytes) -> bytes:
    """Put deep brackets around a piece, or in the place of one."""
    depth = random.choice((2, 50, 1000, 20_000))
    left, right = random.choice(((b"[", b"]"), (b'{"a":', b"}"), (b"(", b")")))
    a, b = _slice(random, content)
    inside = content[a:b] if random.random() < 0.5 else b"1"
    return content[:a] + left * depth + inside + right * random.choice((depth, 0)) + content[b:]


def encode(random: Random, content: bytes) -> bytes:
    """Other encodings, byte-order marks, other ends of lines."""
    if random.random() < 0.3:
        return content.replace(b"\n", random.choice((b"\r\n", b"\r", b"\n\n")))
    if random.random() < 0.3:
        return random.choice((b"\xef\xbb\xbf", b"\xff\xfe", b"\xfe\xff", b"\xef\xbb\xbf" * 2)) + content
    return content.decode("latin-1").encode(random.choice(_ENCODINGS), "replace")


MUTATORS: tuple[Mutator, ...] = (
    *(flip_bytes, flip_bit, insert_bytes, truncate, delete_slice, repeat_slice),
    *(replace_field, replace_field, replace_field, change_number, change_number, swap_fields),
    *(change_lines, change_lines, nest, encode),
)


def mutate(random: Random, seeds: Sequence[bytes]) -> bytes:
    """Damage one of several files, or paste two together and damage that.

    Args:
        random: Where all choices come from.
        seeds: Valid files.

    Returns:
        At most `LONGEST` bytes.
    """
    content = random.choice(seeds)
    if random.random() < 0.05:
        other = random.choice(seeds)
        content = content[: random.randint(0, len(content))] + other[random.randint(0, len(other)) :]
    for _ in range(random.choice((1, 1, 1, 2, 2, 3, 5))):
        content = random.choice(MUTATORS)(random, content)[:LONGEST]
    return content


def _slice(random: Random, content: bytes) -> tuple[int, int]:
    a = random.randint(0, len(content))
    return a, min(len(content), a + random.choice((1, 4, 30, 300)))
