"""Readers of the UCY formats: `annotation.vsp` with `H.txt`, and `obsmat.txt` (Lerner et al. 2007; Pellegrini 2009)."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from socialnav_mj.geometry import Array
from socialnav_mj.recordings.fields import FormatError, number, shown, text_lines, whole_number
from socialnav_mj.recordings.reading import AxisOrder
from socialnav_mj.recordings.samples import Row, Samples, samples_of_rows


def read_homography(path: Path) -> Array:
    """Read the map from image to floor.

    Args:
        path: Text file of three lines with three numbers each.

    Returns:
        (3, 3) homography, pixels to metres.

    Raises:
        FormatError: If the file is something else, or the matrix is singular.
    """
    rows = [(i, line.split()) for i, line in enumerate(text_lines(path), 1) if line.strip()]
    for i, fields in rows:
        if len(fields) != 3:
            raise FormatError(path, i, f"{len(fields)} numbers", "3 numbers a line")
    if len(rows) != 3:
        raise FormatError(path, None, f"{len(rows)} lines of numbers", "3 lines (a 3x3 homography)")
    matrix = np.array([[number(text, path, i, "homography") for text in fields] for i, fields in rows])
    # Scaling by row keeps the test independent of the unit of the pixels.
    with np.errstate(over="ignore", invalid="ignore"):
        norms = np.linalg.norm(matrix, axis=1)
        regular = norms.all() and abs(np.linalg.det(matrix / norms[:, None])) >= 1e-9  # not so if it is NaN
    if not regular:
        raise FormatError(path, None, "a singular matrix", "an invertible homography")
    return matrix


def apply_homography(matrix: Array, pixels: Array, axis_order: AxisOrder) -> Array:
    """Map image points to the floor.

    Args:
        matrix: (3, 3) homography.
        pixels: (k, 2) x to the right and y up from the image centre.
        axis_order: Whether the homography takes (x, y) or (y, x).

    Returns:
        (k, 2) [m]; not finite for points on the horizon.
    """
    ordered = pixels if axis_order == "xy" else pixels[:, ::-1]
    with np.errstate(all="ignore"):
        # Sums in a fixed order: a matrix product's last bit is the processor's, see `elementary`.
        mapped = ordered[:, :1] * matrix[:, 0] + ordered[:, 1:] * matrix[:, 1] + matrix[:, 2]
        return np.asarray(mapped[:, :2] / mapped[:, 2:])


def read_vsp(path: Path, homography: Path, *, axis_order: AxisOrder = "xy") -> Samples:
    """Read splines of hand-set control points.

    The first line counts the splines; each spline is a line with its count of control points and then one line
    `x y frame gaze` per point, in pixels from the image centre (x right, y up). Text after the numbers is a remark;
    what follows the last spline (obstacles, groups) is not read. A person's id is its spline's place in the file,
    counted from 1.

    Args:
        path: The `.vsp` file.
        homography: The file of the map from pixels to metres.
        axis_order: Whether that map takes (x, y) or (y, x).

    Returns:
        Control points in metres, spline by spline.

    Raises:
        FormatError: At the first mistake in either file.
    """
    matrix = read_homography(homography)
    samples = samples_of_rows(path, _control_points(path))
    return replace(samples, position=apply_homography(matrix, samples.position, axis_order))


def _control_points(path: Path) -> Iterator[Row]:
    """Control points in pixels, spline by spline."""
    lines = text_lines(path)

    def fields(index: int, count: int, expected: str) -> list[str]:
        if index >= len(lines):
            raise FormatError(path, len(lines), "the file ends here", expected)
        found = lines[index].split(maxsplit=count)[:count]
        if len(found) < count:
            raise FormatError(path, index + 1, f"'{shown(lines[index])}'", expected)
        return found

    def a_count(index: int, what: str) -> int:
        value = whole_number(fields(index, 1, what)[0], path, index + 1, what)
        if value < 0:
            raise FormatError(path, index + 1, f"{what} is {value}", "0 or more")
        return value

    n_splines = a_count(0, "the number of splines")
    index = 1
    for person in range(1, n_splines + 1):
        n_points = a_count(index, f"the number of control points of spline {person} of {n_splines}")
        last = None
        for point in range(1, n_points + 1):
            i = index + point
            x, y, frame, gaze = fields(i, 4, f"x y frame gaze of point {point} of {n_points} of spline {person}")
            number(gaze, path, i + 1, "gaze")
            at = whole_number(frame, path, i + 1, "frame")
            if last is not None and at <= last:
                raise FormatError(path, i + 1, f"frame {at} after frame {last}", "frames that increase")
            last = at
            yield i + 1, at, person, number(x, path, i + 1, "x"), number(y, path, i + 1, "y")
        index += n_points + 1


def read_obsmat(path: Path) -> Samples:
    """Read rows of eight numbers: frame, id, x, z, y, vx, vz, vy, in metres; only frame, id, x, y are used.

    Args:
        path: Text file of eight numbers a line, separated by blanks.

    Returns:
        Frame, id and (x, y) of every line that is not empty, in the order of the file.

    Raises:
        FormatError: At the first mistake.
    """
    return samples_of_rows(path, _rows_of_obsmat(path))


def _rows_of_obsmat(path: Path) -> Iterator[Row]:
    for i, line in enumerate(text_lines(path), 1):
        values = line.split()
        if not values:
            continue
        if len(values) != 8:
            raise FormatError(path, i, f"{len(values)} numbers", "8: frame id x z y vx vz vy")
        frame, person = whole_number(values[0], path, i, "frame"), whole_number(values[1], path, i, "id")
        yield i, frame, person, number(values[2], path, i, "x"), number(values[4], path, i, "y")
