"""What the documentation site shows besides docs/: pages that stand beside the code, under the same addresses."""

import re
from pathlib import Path
from typing import Any

from mkdocs.plugins import event_priority
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[1]
OUTSIDE = ("CONTRIBUTING.md", "CHANGELOG.md", "data/plaza/README.md", "results/**/*.md", "results/**/*.png")
_LINK = re.compile(r"(\]\(|src=\")(\.\./|docs/)")


@event_priority(-100)
def on_config(config: Any) -> Any:
    """Nothing is fetched from elsewhere: without the theme's shim the search alone needs a server."""
    config.extra["polyfills"] = [url for url in config.extra.get("polyfills", []) if not url.startswith("http")]
    return config


def on_files(files: Files, *, config: Any) -> Files:
    """Add the pages of `OUTSIDE`, and their pictures."""
    for pattern in OUTSIDE:
        for path in sorted(ROOT.glob(pattern)):
            files.append(File.generated(config, path.relative_to(ROOT).as_posix(), abs_src_path=str(path)))
    return files


def on_page_markdown(markdown: str, *, page: Any, **_: Any) -> str:
    """Links that lead out of docs/ lead to these pages; links from the root into docs/ stay here."""
    if "/" in page.file.src_uri:
        return markdown
    return _LINK.sub(r"\1", markdown)
