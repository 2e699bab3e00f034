"""Lines and fields of a recording's text files, and the error that names a mistake by file and line."""

import codecs
from decimal import Decimal, InvalidOperation
from math import isfinite
from pathlib import Path

LARGEST = 2**62 - 1
"""Frames and ids lie between its negative and itself, so that their differences are exact too."""
_EXACT_DIGITS = 15
"""Decimals of so many digits are one to one with floating-point numbers."""
_SHOWN = 60
"""A longer text is cut in a message."""


class FormatError(ValueError):
    """A mistake in a recording's file; the message names file, line, what is there and what was expected."""

    def __init__(self, path: Path, line: int | None, given: str, expected: str) -> None:
        """Compose the message.

        Args:
            path: The file.
            line: Counted from 1; None if the mistake is in no single line.
            given: What the file says.
            expected: What it should say.
        """
        place = f"{path}" if line is None else f"{path}, line {line}"
        super().__init__(f"{place}: {given}; expected {expected}")
        self._parts = path, line, given, expected

    def __reduce__(self) -> tuple[type["FormatError"], tuple[Path, int | None, str, str]]:
        """Travels between processes by its parts; Exception's own way would call __init__ with the message."""
        return type(self), self._parts


def shown(text: str) -> str:
    """Text of a file as it may stand in a message: cut where it is long, without control characters.

    Args:
        text: Of any length, with any characters.

    Returns:
        At most 60 characters of one line.
    """
    text = text if len(text) <= _SHOWN else text[: _SHOWN - 3] + "..."
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def number(text: str, path: Path, line: int, what: str) -> float:
    """Parse a finite number in ASCII digits.

    Args:
        text: The field.
        path: The file, for the message.
        line: Counted from 1, for the message.
        what: Name of the field, for the message.

    Returns:
        Its value as a float.

    Raises:
        FormatError: If the field is no finite number.
    """
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    # Python reads 1_0 and the digits of all scripts; a recording's file means something else by them.
    if not isfinite(value) or "_" in text or not text.isascii():
        raise FormatError(path, line, f"{what} is '{shown(text)}'", "a finite number")
    return value


def whole_number(text: str, path: Path, line: int, what: str) -> int:
    """Parse a whole number exactly; it may be written like 7, 7.0 or 7.0e+00.

    Args:
        text: The field.
        path: The file, for the message.
        line: Counted from 1, for the message.
        what: Name of the field, for the message.

    Returns:
        Its exact value.

    Raises:
        FormatError: If the field is no whole number, or beyond `LARGEST`.
    """
    value = number(text, path, line, what)
    if len(text) <= _EXACT_DIGITS and abs(value) < 10**_EXACT_DIGITS:
        whole = int(value)
        if whole != value:
            raise FormatError(path, line, f"{what} is '{shown(text)}'", "a whole number")
        return whole
    try:
        exact = Decimal(text.strip())
    except InvalidOperation:
        raise FormatError(path, line, f"{what} is '{shown(text)}'", "a whole number") from None
    if abs(value) > 2.0 * LARGEST or abs(exact) > LARGEST:
        raise FormatError(path, line, f"{what} is '{shown(text)}'", "a whole number between -2^62 and 2^62")
    if exact != int(exact):
        raise FormatError(path, line, f"{what} is '{shown(text)}'", "a whole number")
    return int(exact)


def text_lines(path: Path) -> list[str]:
    """Lines of a UTF-8 text file, with or without a byte-order mark.

    Args:
        path: The file.

    Returns:
        The lines without their ends; these are line feeds, carriage returns or both.

    Raises:
        FormatError: If it is not UTF-8 text.
    """
    content = path.read_bytes()
    mark = len(codecs.BOM_UTF8) if content.startswith(codecs.BOM_UTF8) else 0
    try:
        text = str(memoryview(content)[mark:], encoding="utf-8")
    except UnicodeDecodeError as error:
        byte = error.start + mark
        line = content[:byte].count(b"\n") + 1
        raise FormatError(path, line, f"byte {byte} is not UTF-8", "a text file in UTF-8") from None
    # Not splitlines, which also ends lines where no editor does, so that numbers of lines would differ.
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    if not lines[-1]:
        lines.pop()
    return lines
