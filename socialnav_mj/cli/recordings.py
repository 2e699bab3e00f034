"""What a recording is, in one line."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from socialnav_mj.recordings import Recording


def describe(recording: "Recording") -> str:
    """Name, size, and the frame rate with who says it."""
    rate = f"{recording.frame_rate:g} Hz ({recording.frame_rate_origin})"
    help_ = "; --frame-rate sets another" if recording.frame_rate_origin == "assumed" else ""
    return (
        f"recording {recording.name}, variant {recording.variant}: {recording.n_people} people, "
        f"{recording.duration:.1f} s, frame rate {rate}{help_}"
    )
