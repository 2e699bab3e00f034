"""Where the MJCF assets, the embedded data and the extras are, in a wheel, an editable install or a bare checkout."""

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent


def _folder(name: str) -> Path:
    """The folder inside the package if it exists (wheel), else the one beside the package (checkout)."""
    for candidate in (_PACKAGE / name, _PACKAGE.parent / name):
        if candidate.is_dir():
            return candidate
    raise FileNotFoundError(f"no folder {name!r} in {_PACKAGE} or {_PACKAGE.parent}; the installation is incomplete")


def assets_folder() -> Path:
    """Folder of the MJCF files and the trained policies.

    Returns:
        An absolute path.

    Raises:
        FileNotFoundError: If the installation has none.
    """
    return _folder("assets")


def data_folder() -> Path:
    """Folder of the embedded recording and the catalogue.

    Returns:
        An absolute path.

    Raises:
        FileNotFoundError: If the installation has none.
    """
    return _folder("data")


def install_hint(extra: str) -> str:
    """What to type for an extra that is missing.

    Args:
        extra: Its name in pyproject.toml.

    Returns:
        A command of pip: of the checkout where this is one, else of the package.
    """
    checkout = _PACKAGE.parent
    if (checkout / "pyproject.toml").is_file():
        return f"pip install -c {checkout / 'constraints.txt'} -e '{checkout}[{extra}]'"
    return f"pip install 'socialnav-mj[{extra}]'"
