"""What the catalogue knows of a recording that was read: can it be verified, and are its people real?"""

from socialnav_mj.recordings.catalogue import UNKNOWN, catalogue, not_verified
from socialnav_mj.recordings.recording import Recording


def unverified(recording: Recording) -> tuple[str, ...]:
    """What could not be verified of a recording that goes by a name of the catalogue.

    Args:
        recording: Its name, variant and checksum are looked at.

    Returns:
        A sentence for a warning; none if all its files have a sha256 in the catalogue, or it is not in there.
    """
    row = catalogue().get(recording.name)
    files = (
        {} if row is None else dict(next((own for kind, own in row.variants.items() if kind == recording.variant), {}))
    )
    return not_verified([name for name, digest in files.items() if digest == UNKNOWN], recording.checksum)


def is_simulated(name: str, variant: str) -> bool:
    """Whether a simulation made the people of a recording.

    Args:
        name: Of the recording.
        variant: Of its files.

    Returns:
        True if the catalogue says so of it.
    """
    row = catalogue().get(name)
    return row is not None and row.simulated and variant.partition("[")[0] in row.variants


def crowd_of(name: str, variant: str) -> str:
    """How a table names a recording.

    Args:
        name: Of the recording.
        variant: Of its files.

    Returns:
        "zara01 (vsp)", or "plaza (vsp, simulated crowd)".
    """
    return f"{name} ({variant}, simulated crowd)" if is_simulated(name, variant) else f"{name} ({variant})"
