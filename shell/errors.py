"""What `shell` raises when it is asked for something that cannot be computed."""


class ShellError(ValueError):
    """An input that `shell` cannot use; the message says what is wrong and how to mend it."""


class FoldedCells(ShellError):
    """A solid part whose cells would overlap."""


def mm(length: float) -> str:
    """A length (m) as the drawings and cards have it, for a message."""
    return f"{1e3 * length:.6g} mm"
