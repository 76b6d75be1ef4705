"""Whether a verdict names what was hidden: the checks that hide-and-find tests share, and that a stubbed engine must fail."""

WIDEST = 8
"""Names in one set, a third of the library: naming everything is no answer."""


def names_of(cause):
    return {cause.effect, *cause.equivalent}


def check_first(verdict, hidden, widest=WIDEST):
    """The strongest physical cause is the hidden effect, or a small set that holds it."""
    causes = [cause for cause in verdict.causes if cause.kind == "physics"]
    assert causes, verdict
    assert hidden in names_of(causes[0]), (hidden, verdict.causes)
    assert len(names_of(causes[0])) <= widest, (hidden, verdict.causes)


def check_clean(verdict):
    """Nothing is named where nothing is hidden."""
    assert verdict.verdict == "adequate", verdict
    assert not verdict.causes, verdict.causes
