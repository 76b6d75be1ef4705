"""What `thermal` raises when it is asked for something that cannot be computed."""


class ThermalError(ValueError):
    """An input that `thermal` cannot use; the message says what is wrong and how to mend it."""
