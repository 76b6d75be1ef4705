"""A user's own Python function of a design, run in a process of its own that may raise, hang or crash.

It is named by module path, `function = "package.module:name"` or `"file.py:name"` (beside the spec), takes
(instrument, parameters) and returns one finite number. It runs only where the study was started with --allow-python.
"""

from studies.errors import InputError
from studies.files.toml import TomlTable
from studies.sweeps.case import Case, Options
from studies.sweeps.quantity import Column, Number, Option, Quantity, number


def _text(default: str | None, meaning: str) -> Option:
    def read(section: TomlTable, key: str) -> str:
        return section.text(key, default)

    return Option(meaning, read)


def _columns(options: Options) -> tuple[Column, ...]:
    module, colon, name = options["function"].rpartition(":")
    if not (colon and module and name.isidentifier()):
        raise InputError(f'function = \'{options["function"]}\' must be "package.module:name" or "file.py:name".')
    return (Column(name, options["unit"], name.replace("_", " ")),)


def _evaluate(case: Case, options: Options) -> tuple[Number, ...]:
    from studies.sweeps.child import ask

    return (Number(ask(options["function"], options["time_limit_s"], case)),)


QUANTITY = Quantity(
    "python",
    "A user's own function (instrument, parameters) -> number; needs --allow-python.",
    {
        "function": _text(None, '"package.module:name" or "file.py:name" beside the spec'),
        "unit": _text("1", "unit of what it returns"),
        "time_limit_s": number(30.0, "seconds that one design may take", above=0.0),
    },
    _columns,
    _evaluate,
)
