"""What `compensation` raises when it is asked for something that cannot be computed."""


class CompensationError(ValueError):
    """An input that `compensation` cannot use; the message says what is wrong and how to mend it."""


def require_runs(runs: object, kind: type, made: str) -> None:
    """Refuse what is no sequence of runs of arrays: a path, a record."""
    if not isinstance(runs, list | tuple) or not all(isinstance(run, kind) for run in runs):
        raise CompensationError(f"give a list of runs of arrays ({made}); records and their files are for 'hrg fit'.")
