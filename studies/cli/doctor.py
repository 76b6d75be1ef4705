"""`hrg doctor`: what this environment has and what it lacks."""


def doctor(*, json: bool = False) -> int:
    """Show versions, OpenGL and name clashes, with the remedy for what is missing."""
    raise NotImplementedError
