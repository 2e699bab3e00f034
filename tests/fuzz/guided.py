"""Coverage-guided attack on one reader: `python -m tests.fuzz.guided --target readers/ndjson --seconds 600`.

atheris (libFuzzer) keeps an input that reaches new code and damages it further. The process ends at the first input
that fails, and leaves it in the folder of failures as crash-, oom- or timeout-; otherwise after the time given.
"""

import argparse
import contextlib
import logging
import sys
import warnings
from pathlib import Path

import atheris

from .attack import SLOWEST, scratch
from .target import seeds_of

with atheris.instrument_imports(include=["socialnav_mj"]):
    from .targets import TARGETS


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--target", required=True, choices=[target.name for target in TARGETS])
    parser.add_argument("--seconds", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--corpus", type=Path, help="folder of inputs that reach something new, kept between runs")
    parser.add_argument("--failures", type=Path, default=Path("runs/fuzz"), help="folder of inputs that fail")
    given = parser.parse_args()
    target = next(target for target in TARGETS if target.name == given.target)
    logging.disable()
    warnings.simplefilter("ignore")
    given.failures.mkdir(parents=True, exist_ok=True)
    with scratch() as folder, scratch() as temporary:
        corpus = given.corpus or Path(temporary)
        corpus.mkdir(parents=True, exist_ok=True)
        with atheris.instrument_imports(include=["socialnav_mj"]):
            # Readers are imported when they are first used.
            for number, content in enumerate(seeds_of(target)):
                target.read(content, Path(folder))
                (corpus / f"seed_{number}").write_bytes(content)
        refused = target.refuses()

        def one(content: bytes) -> None:
            with contextlib.suppress(*refused):
                target.read(content, Path(folder))

        options = [f"-max_total_time={given.seconds}", f"-seed={given.seed + 1}", f"-timeout={SLOWEST:.0f}"]
        options += [
            "-rss_limit_mb=2048",
            "-max_len=8192",
            f"-artifact_prefix={given.failures}/",
            "-print_final_stats=1",
        ]
        atheris.Setup([sys.argv[0], str(corpus), *options], one)
        atheris.Fuzz()


if __name__ == "__main__":
    main()
