"""Reader of declared keys: a TOML file becomes its class, or one sentence names file, table and key, and the mend."""

import datetime
import operator
import re
import tomllib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path as FilePath
from typing import Any, TypeVar

from msgspec import inspect

from studies.errors import InputError, nearest
from studies.files.given import is_sound, printable, shorten
from studies.files.reading import read_bytes
from studies.schema.keys import Path, describe, known_keys, number_in, options, structs

T = TypeVar("T")
Numbers = Callable[[Any, Path, inspect.Type, str], Any]
MOST_BYTES = 16 * 1024**2
BOUNDS = {"gt": "above", "ge": "at least", "lt": "below", "le": "at most"}
UNFIT = object()


def read_file(path: str | FilePath, keys: type[T], schema: str) -> T:
    """Read a TOML file into the class of its keys; raise as `read_toml` and `read_keys`."""
    return read_keys(read_toml(path, schema), keys, str(path))


def read_text(path: str | FilePath) -> str:
    """Read the text of a TOML file."""
    try:
        return read_bytes(path, MOST_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{path}: not UTF-8 text; save the file as UTF-8.") from None


def read_toml(path: str | FilePath, schema: str | None = None, text: str | None = None) -> dict[str, Any]:
    """Read a TOML file, or the `text` that it has or will have, and check its `schema` key."""
    text = read_text(path) if text is None else text
    try:
        content = tomllib.loads(text)
    except ValueError as error:  # a TOMLDecodeError, or a number of more digits than Python converts
        raise InputError(f"{path}{_spell_syntax(text, str(error).partition(';')[0])}") from None
    except RecursionError:
        raise InputError(f"{path}: not valid TOML: nested too deeply.") from None
    for key, said in _texts(content):
        if said != printable(said):
            raise InputError(f"{path}: {printable(key)} holds a control character ({printable(said)!s:.60}); remove it.")  # fmt: skip
    if schema is not None:
        found = content.get("schema")
        if not text.strip():
            raise InputError(f"{path}: the file is empty.")
        if found is None:
            raise InputError(f'{path}: the line schema = "{schema}" is missing; add it at the top.')
        if found != schema:
            raise InputError(f'{path}: schema must be "{schema}", not {found!r}; give such a file, or correct that line.')  # fmt: skip
    return content


def _spell_syntax(text: str, error: str) -> str:
    found = re.search(r"\(at line (\d+), column \d+\)$", error)
    lines = text.splitlines()
    number = int(found.group(1)) if found else 0
    line = lines[number - 1] if 0 < number <= len(lines) else ""
    if re.search(r"=\s*[-+]?\d+,\d", line):
        return f", line {number}: write a decimal point, not a comma: {line.strip():.60}"
    if found and "=" not in "".join(lines[:number]) and line.count(",") > 0:
        return f": not a TOML file; its line {number} looks like a table (CSV). Give a TOML file here."
    return f": not valid TOML: {error}."


def read_keys(raw: Any, keys: type[T], where: str, numbers: Numbers | None = None) -> T:
    """Read a table (`where`: "file [table]") into its class; `numbers` sees what stands for a number before it is checked."""
    declared: Any = keys
    found: T = _Reader(where, numbers).read(describe(declared), raw, ())
    return found


class _Reader:
    """One table on its way into its class."""

    def __init__(self, where: str, numbers: Numbers | None) -> None:
        self.where = where
        self.numbers = numbers

    def read(self, node: inspect.Type, raw: Any, path: Path) -> Any:
        """Return what stands at a place, as one of the types that its description allows."""
        if self.numbers is not None and isinstance(raw, Mapping) and (one := number_in(node)) is not None:
            raw = self.numbers(raw, path, one, spell_place(self.where, path))
        if isinstance(raw, Mapping) and (tables := structs(node)):
            return self._read_table(tables, raw, path)
        kinds = options(node)
        for kind in kinds:
            if (found := self._read_as(kind, raw, path)) is not UNFIT:
                return found
        raise self._refused(path, f"must be {spell_wanted(kinds, path)}, not {shorten(repr(raw))}.")

    def _read_table(self, tables: list[inspect.StructType], raw: Mapping[str, Any], path: Path) -> Any:
        table = tables[0]
        if table.tag_field is not None:
            tag, tags = raw.get(table.tag_field), {str(one.tag): one for one in tables}
            if table.tag_field not in raw:
                raise self._lacking(path, table.tag_field)
            if not isinstance(tag, str):
                raise self._refused((*path, table.tag_field), f"must be text in quotes, not {shorten(repr(tag))}.")
            if tag not in tags:
                raise self._refused((*path, table.tag_field), f"= {shorten(repr(tag))} is unknown{nearest(tag, tags)}")
            table = tags[tag]
        fields = {field.encode_name: field for field in table.fields}
        for key in raw:
            if key not in fields and key != table.tag_field:
                known = known_keys(table)
                raise InputError(f"{spell_table(self.where, path)}: unknown key '{key}'{nearest(key, known)}")
        given = {fields[k].name: self.read(fields[k].type, v, (*path, k)) for k, v in raw.items() if k in fields}
        for field in table.fields:
            if field.required and field.name not in given:
                raise self._lacking(path, field.encode_name)
        try:
            return table.cls(**given)
        except InputError:
            raise
        except ValueError as error:  # keys that contradict each other
            raise InputError(f"{spell_table(self.where, path)}: {error}") from None

    def _read_as(self, kind: inspect.Type, raw: Any, path: Path) -> Any:
        """Return a value as one type, UNFIT where it is of another."""
        found: Any = UNFIT
        match kind:
            case inspect.BoolType():
                found = raw if isinstance(raw, bool) else UNFIT
            case inspect.FloatType() | inspect.IntType():
                found = self._read_number(kind, raw, path)
            case inspect.LiteralType():
                if isinstance(raw, str) and raw not in kind.values:
                    raise self._refused(path, f"= {shorten(repr(raw))} is unknown{nearest(raw, map(str, kind.values))}")
                found = raw if isinstance(raw, str) else UNFIT
            case inspect.StrType():
                found = raw if isinstance(raw, str) else UNFIT
            case inspect.NoneType():
                found = None if raw is None else UNFIT
            case inspect.DateTimeType():
                found = _as_time(raw)
            case inspect.TupleType() if isinstance(raw, list | tuple) and len(raw) == len(kind.item_types):
                pairs = zip(kind.item_types, raw, strict=True)
                found = tuple(self.read(item, one, (*path, place)) for place, (item, one) in enumerate(pairs))
            case inspect.ListType() | inspect.VarTupleType() if isinstance(raw, list | tuple):
                if (kind.min_length or 0) <= len(raw) <= (kind.max_length or len(raw)):
                    members = [self.read(kind.item_type, one, (*path, place)) for place, one in enumerate(raw)]
                    found = members if isinstance(kind, inspect.ListType) else tuple(members)
            case inspect.DictType() if isinstance(raw, Mapping):
                found = {key: self.read(kind.value_type, one, (*path, key)) for key, one in raw.items()}
            case inspect.AnyType():
                found = raw
        return found

    def _read_number(self, kind: inspect.FloatType | inspect.IntType, raw: Any, path: Path) -> Any:
        if isinstance(raw, bool) or not isinstance(raw, int | float):
            return UNFIT
        whole = isinstance(kind, inspect.IntType)
        large = whole and isinstance(raw, int) and kind.le is not None  # a seed, whose own bound decides
        if not (large or is_sound(raw)) or (whole and raw != int(raw)):
            return UNFIT
        found = int(raw) if whole else float(raw)
        for bound, words in BOUNDS.items():
            end = getattr(kind, bound)
            if end is not None and not getattr(operator, bound)(found, end):
                shown = f"{found:g}" if is_sound(found) else shorten(repr(found))
                raise self._refused(path, f"must be {words} {end:g}, not {shown}.")
        return found

    def _refused(self, path: Path, what: str) -> InputError:
        return InputError(f"{spell_place(self.where, path)} {what}")

    def _lacking(self, path: Path, key: str) -> InputError:
        return InputError(f"{spell_table(self.where, path)}: the key '{key}' is missing; add it.")


def spell_table(where: str, path: Path) -> str:
    """Return "file [table.inner]" for a place in a table; members of an array of tables are counted from 1."""
    for word in path:
        if isinstance(word, int):
            where = re.sub(r"\[([^\[\]]*)\]$", r"[[\1]]", where) + f" number {word + 1}"
        elif where.endswith("]") and not where.endswith("]]"):
            where = f"{where[:-1]}.{word}]"
        else:
            where = f"{where} [{word}]"
    return where


def spell_place(where: str, path: Path) -> str:
    """Return "file [table.inner]: key" for a place in a table; members of a list of numbers are counted from 0."""
    names = [k for k, word in enumerate(path) if isinstance(word, str)]
    last = names[-1] if names else 0
    key = ".".join(str(word) for word in path[last:])
    return f"{spell_table(where, path[:last])}: {key}" if key else where


def spell_wanted(kinds: Any, path: Path = ()) -> str:
    """Return what a place may hold, in words."""
    words = []
    for one in kinds:
        match one:
            case inspect.FloatType():
                words.append("a finite number")
            case inspect.IntType():
                words.append("a whole number")
            case inspect.StrType() | inspect.LiteralType():
                words.append("text in quotes")
            case inspect.BoolType():
                words.append("true or false")
            case inspect.DateTimeType():
                words.append("a time such as 2026-01-31T12:00:00")
            case inspect.TupleType():
                words.append(f"a list of {len(one.item_types)} numbers")
            case inspect.ListType() | inspect.VarTupleType():
                words.append(_spell_list(one))
            case inspect.StructType() | inspect.DictType():
                words.append(f"a table ([{path[-1]}])" if path and isinstance(path[-1], str) else "a table")
    return " or ".join(dict.fromkeys(words))


def _spell_list(node: inspect.ListType | inspect.VarTupleType) -> str:
    (one, *_) = options(node.item_type)
    match one:
        case inspect.TupleType():
            members = "[position, value] pairs" if len(one.item_types) == 2 else "lists"
        case inspect.StructType():
            members = "tables"
        case inspect.StrType() | inspect.LiteralType():
            members = "texts"
        case inspect.ListType() | inspect.VarTupleType():
            members = "lists"
        case _:
            members = "numbers"
    least, most = node.min_length, node.max_length
    return f"a list of {least} {f'to {most}' if most else 'or more'} {members}" if least else f"a list of {members}"


def _as_time(raw: Any) -> Any:
    if isinstance(raw, str):
        try:
            return datetime.datetime.fromisoformat(raw)
        except ValueError:
            return UNFIT
    return raw if isinstance(raw, datetime.datetime) else UNFIT


def _texts(content: Any, key: str = "") -> Iterator[tuple[str, str]]:
    """Yield every text in a file, keys included, and the key where it stands."""
    if isinstance(content, Mapping):
        for name, value in content.items():
            yield name, name
            yield from _texts(value, name)
    elif isinstance(content, list):
        for value in content:
            yield from _texts(value, key)
    elif isinstance(content, str):
        yield key, content
