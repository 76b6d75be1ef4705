"""TOML files of users: every key is known, has the right type and lies in its range, or the error names it."""

from collections.abc import Collection, Mapping
from typing import Any

from studies.errors import InputError, nearest
from studies.files.given import is_sound


class TomlTable:
    """One table of a TOML file, from which keys are taken by name and type until none may be left."""

    def __init__(self, values: Mapping[str, Any], where: str, known: Collection[str]) -> None:
        self.values = values
        self.where = where
        for key in values:
            if key not in known:
                raise InputError(f"{where}: unknown key '{key}'{nearest(key, known)}")

    def __contains__(self, key: str) -> bool:
        return key in self.values

    def number(
        self,
        key: str,
        default: float | None = None,
        *,
        above: float | None = None,
        least: float | None = None,
        below: float | None = None,
        most: float | None = None,
    ) -> float:
        """Take a finite number within its bounds; without a default the key is required."""
        value = self._take(key, default)
        return check_number(value, f"{self.where}: {key}", above=above, least=least, below=below, most=most)

    def text(self, key: str, default: str | None = None, choices: Collection[str] | None = None) -> str:
        """Take a text, one of `choices` where they are given."""
        value = self._take(key, default)
        if not isinstance(value, str):
            raise InputError(f"{self.where}: {key} must be text in quotes, not {value!r}.")
        if choices is not None and value not in choices:
            raise InputError(f"{self.where}: {key} = '{value}' is unknown{nearest(value, choices)}")
        return value

    def section(self, key: str, known: Collection[str]) -> "TomlTable":
        """Take a sub-table."""
        value = self._take(key, None)
        if not isinstance(value, Mapping):
            raise InputError(f"{self.where}: {key} must be a table ([{key}]), not {value!r}.")
        return TomlTable(value, f"{self.where} [{key}]", known)

    def sections(self, key: str, known: Collection[str]) -> "list[TomlTable]":
        """Take an array of tables; empty when the key is absent."""
        value = self.values.get(key, [])
        if not isinstance(value, list) or not all(isinstance(item, Mapping) for item in value):
            raise InputError(f"{self.where}: {key} must be an array of tables ([[{key}]]).")
        return [TomlTable(item, f"{self.where} [[{key}]] number {k}", known) for k, item in enumerate(value, 1)]

    def raw(self, key: str, default: Any = None) -> Any:
        """Take a value of any type, to be checked by the caller."""
        return self._take(key, default)

    def _take(self, key: str, default: Any) -> Any:
        if key in self.values:
            return self.values[key]
        if default is None:
            raise InputError(f"{self.where}: the key '{key}' is missing; add it.")
        return default


def check_number(
    value: Any,
    what: str,
    *,
    above: float | None = None,
    least: float | None = None,
    below: float | None = None,
    most: float | None = None,
) -> float:
    """Return a finite float within its bounds, or say what was found instead."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not is_sound(value):
        raise InputError(f"{what} must be a finite number, not {value!r}.")
    for bound, bad, words in (
        (above, above is not None and not value > above, "above"),
        (least, least is not None and not value >= least, "at least"),
        (below, below is not None and not value < below, "below"),
        (most, most is not None and not value <= most, "at most"),
    ):
        if bad:
            raise InputError(f"{what} must be {words} {bound:g}, not {value:g}.")
    return float(value)
