"""One reader of declared keys: what a declaration allows is read, anything else is one sentence that names the key.

The strategies are made from the declarations themselves, for every file that has one, so a new key is tried as soon as it is declared.
"""

import string
import tomllib
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from msgspec import inspect

import shell
from shell.property import FORMS, PROPERTIES
from studies.acceptance.limits import Limits
from studies.design.keys import DesignKeys
from studies.errors import InputError
from studies.importing.mapping import ImportMap
from studies.instrument.material_file import MaterialFile, PropertyKeys
from studies.instrument.registry import card_tables
from studies.models.file import ModelKeys
from studies.schema.keys import describe, number_in, options, structs
from studies.schema.reader import read_keys
from studies.sweeps.keys import StudyKeys

CARD = {f"{entry.table}.{entry.name}": entry.keys for es in card_tables().values() for entry in es if entry.keys}
KINDS = {
    "limits": Limits,
    "study": StudyKeys,
    "design": DesignKeys,
    "map": ImportMap,
    "model": ModelKeys,
    "material": MaterialFile,
    **CARD,
}
JUNK = st.one_of(
    st.none(), st.booleans(), st.integers(-(10**20), 10**20), st.floats(), st.text(max_size=5),
    st.lists(st.integers(), max_size=3), st.dictionaries(st.text(max_size=3), st.integers(), max_size=2),
)  # fmt: skip
WORDS = st.text(string.ascii_letters, min_size=1, max_size=6)
PATIENT = settings(max_examples=12, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])


def allowed(node):
    """Values that a type allows, whatever keys may contradict each other."""
    return st.one_of([of_kind(one) for one in options(node) if not isinstance(one, inspect.NoneType)])


def of_kind(kind):
    match kind:
        case inspect.FloatType():
            low = next((end for end in (kind.ge, kind.gt) if end is not None), -1e6)
            high = next((end for end in (kind.le, kind.lt) if end is not None), max(1e6, low))
            return st.floats(low, high, exclude_min=kind.gt is not None, exclude_max=kind.lt is not None)
        case inspect.IntType():
            return st.integers(kind.ge if kind.ge is not None else -5, kind.le if kind.le is not None else 100)
        case inspect.BoolType():
            return st.booleans()
        case inspect.StrType():
            return WORDS
        case inspect.LiteralType():
            return st.sampled_from(list(kind.values))
        case inspect.DateTimeType():
            return st.just("2026-01-31T12:00:00")
        case inspect.TupleType():
            return st.tuples(*map(allowed, kind.item_types)).map(list)
        case inspect.ListType() | inspect.VarTupleType():
            least = kind.min_length or 0
            return st.lists(allowed(kind.item_type), min_size=least, max_size=min(kind.max_length or 9, least + 2))
        case inspect.DictType():
            return st.dictionaries(WORDS, allowed(kind.value_type), max_size=2)
        case inspect.StructType():
            needed = {field.encode_name: allowed(field.type) for field in kind.fields if field.required}
            free = {field.encode_name: allowed(field.type) for field in kind.fields if not field.required}
            tag = {kind.tag_field: st.just(kind.tag)} if kind.tag_field else {}
            return st.fixed_dictionaries(tag | needed, optional=free)


def judge(keys, raw):
    """Read; an error is one sentence that begins with the file, and no other exception leaves the reader."""
    try:
        return read_keys(raw, keys, "file.toml")
    except InputError as error:
        said = str(error)
    assert said.startswith("file.toml")
    assert len(said) < 400
    return said


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_declared_is_read_or_said_to_contradict(kind):
    keys = KINDS[kind]
    told = []

    @PATIENT
    @given(allowed(describe(keys)))
    def run(raw):
        found = judge(keys, raw)
        told.append(found)
        if isinstance(found, str):  # only keys that contradict each other: no type, bound or name is at fault
            assert "must be a finite" not in found
            assert "did you mean" not in found or "is unknown" in found or "is not a column" in found

    run()
    assert told


@pytest.mark.parametrize("kind", KINDS)
def test_a_wrong_value_and_a_typo_name_the_key(kind):
    keys = KINDS[kind]

    @PATIENT
    @given(allowed(describe(keys)), st.data())
    def run(raw, data):
        struct = structs(describe(keys), raw)[0]
        field = data.draw(st.sampled_from(struct.fields))
        name, junk = field.encode_name, data.draw(JUNK)
        changed = judge(keys, {name: junk, **{key: value for key, value in raw.items() if key != name}})
        good = {type(one) for one in options(field.type)}
        wrong = isinstance(junk, bool) and inspect.BoolType not in good
        wrong |= isinstance(junk, float) and not abs(junk) < 1e15 and inspect.AnyType not in good
        if wrong:
            assert isinstance(changed, str)
            assert name in changed
        typo = judge(keys, raw | {f"{name}x": 1})
        assert f"unknown key '{name}x'; did you mean '{name}" in typo

    run()


@pytest.mark.parametrize("kind", ["card", "study", "map", "model", "limits", "material"])
def test_the_reference_has_every_key_with_its_unit_and_default(kind, ask):
    rows = ask(["keys", kind])["keys"]
    assert len({(row["table"], row["key"], row.get("only")) for row in rows}) == len(rows)
    assert all(row["meaning"] for row in rows)
    found = {(row["table"], row["key"]): row for row in rows}
    if kind == "material":
        assert found["[NAME.laws.LAW.crystal]", "C11"]["unit"] == "Pa"
    if kind == "card":
        assert found["[thermal]", "base_heat_capacity_J_per_K"]["unit"] == "J/K"
        assert found["[thermal]", "film_emissivity"]["bounds"] == "at least 0, at most 1"
        assert found["[[loss.film]]", "thickness_nm"]["required"]


def all_tables(node):
    """Every class of keys in a declaration."""
    for struct in structs(node):
        yield struct
        for field in struct.fields:
            for one in options(field.type):
                yield from all_tables(getattr(one, "item_type", one))


@pytest.mark.parametrize("kind", KINDS)
def test_every_number_is_finite_and_keeps_its_bounds(kind):
    for struct in all_tables(describe(KINDS[kind])):
        for field in struct.fields:
            number = number_in(field.type)
            texts = any(isinstance(one, inspect.StrType) for one in options(field.type))
            junk = [float("nan"), float("inf"), 1e300, 10**400, True, "1"] if number is not None and not texts else []
            beyond = {"gt": 0, "ge": -1, "lt": 0, "le": 1}
            junk += [
                getattr(number, end) + step for end, step in beyond.items() if getattr(number, end, None) is not None
            ]
            for one in junk:
                tag = {struct.tag_field: struct.tag} if struct.tag_field else {}
                said = judge(struct.cls, {field.encode_name: one, **tag})
                assert isinstance(said, str), (field.encode_name, one)
                assert field.encode_name in said
                assert "must be" in said


def test_every_material_that_ships_has_the_keys_that_are_told_and_no_others():
    """`shell` reads the table by itself; what is told of its keys here is what stands in it, and what its forms need."""
    content = tomllib.loads(Path(shell.__file__).with_name("materials.toml").read_text(encoding="utf-8"))
    schema = content.pop("schema")
    for name, entry in content.items():
        for law in entry["laws"].values():
            plain = {key: value for key, value in law.items() if key not in PROPERTIES}
            for one in [law[key] for key in PROPERTIES if key in law]:
                laws = {"LAW": plain | {"PROPERTY": one}}
                read_keys({"schema": schema, "NAME": entry | {"laws": laws}}, MaterialFile, name)
    numbers = {"at_degC", *(key for _, needed in FORMS.values() for key in needed)}
    assert set(PropertyKeys.__struct_fields__) == numbers | {"form", "uncertainty", "unsettled", "source"}
