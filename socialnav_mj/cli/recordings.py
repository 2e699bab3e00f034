"""The line in which `evaluate` and `data info` say what recording they read, and how."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from socialnav_mj.recordings import Recording


def describe(recording: "Recording") -> str:
    """Say in one line what was read.

    Args:
        recording: Name, variant, number of people, duration and frame rate are told.

    Returns:
        Text without a line end; it names the option that sets a frame rate where that was assumed.
    """
    from socialnav_mj.recordings.known import is_simulated

    kind = "simulated crowd" if is_simulated(recording.name, recording.variant) else "recording"
    rate = f"{recording.frame_rate:g} Hz ({recording.frame_rate_origin})"
    help_ = "; --frame-rate sets another" if recording.frame_rate_origin == "assumed" else ""
    return (
        f"{kind} {recording.name}, variant {recording.variant}: {recording.n_people} people, "
        f"{recording.duration:.1f} s, frame rate {rate}{help_}"
    )
