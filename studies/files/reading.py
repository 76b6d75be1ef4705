"""Files that a user names: read with one sentence where that fails, and found by bare name where they ship."""

from pathlib import Path

from studies.errors import InputError, nearest


def read_bytes(path: str | Path) -> bytes:
    """Return the content of a file.

    Raises
    ------
    InputError
        There is no such file, it is a folder, or it cannot be read.
    """
    try:
        return Path(path).read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such file.") from None
    except IsADirectoryError:
        raise InputError(f"{path}: is a folder; give the name of a file.") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}).") from error


def list_shipped(folder: Path) -> dict[str, Path]:
    """Return name -> path of the TOML files that ship in a folder of the package."""
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}


def find_shipped(name: str | Path, shipped: dict[str, Path], kind: str) -> Path:
    """Return the path of a TOML file that is given by path, or by the bare name of one that ships.

    Raises
    ------
    InputError
        None of that name ships; `kind` says what was looked for.
    """
    path = Path(name)
    if path.suffix == ".toml" or path.exists() or len(path.parts) > 1:
        return path
    if str(name) not in shipped:
        raise InputError(
            f"there is no shipped {kind} '{name}' (a {kind} of your own: give its path){nearest(str(name), shipped)}"
        )
    return shipped[str(name)]
