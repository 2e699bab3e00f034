"""All that is attacked; a further reader is a further `Target`."""

from .recordings import RECORDINGS
from .results import RESULTS

TARGETS = (*RECORDINGS, *RESULTS)
