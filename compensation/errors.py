"""What `compensation` raises when it is asked for something that cannot be computed."""


class CompensationError(ValueError):
    """An input that `compensation` cannot use; the message says what is wrong and how to mend it."""
