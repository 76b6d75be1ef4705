"""The place where mechanics, heat and compensation meet: instruments, records, reports, commands."""

__version__ = "0.1.0"
