"""What `shell` raises when it is asked for something that cannot be computed."""


class ShellError(ValueError):
    """An input that `shell` cannot use; the message says what is wrong and how to mend it."""
