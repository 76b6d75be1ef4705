"""How every command speaks: a table for people, one JSON object for programs, nothing else on stdout."""

import functools
import inspect
import re
import sys
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import msgspec
from cyclopts import Parameter

from shell.errors import ShellError
from studies.errors import InputError
from studies.files.given import printable
from studies.files.paths import guarded
from studies.files.writing import write_text
from studies.progress import Stages
from studies.results import Result, Sentence
from studies.results.terminal import print_result

if TYPE_CHECKING:
    from studies.instrument.card import Instrument
    from studies.models import Model
    from studies.record import Record


def answers(
    schema: str, page: bool = True, **endings: tuple[str, ...]
) -> Callable[[Callable[..., Result]], Callable[..., int]]:
    """Make a command of a function that returns a `Result`: give it --json and --report, and keep its inputs from its outputs.

    Its JSON object begins with the first of `schema`, unless it states another. Without `page` there is no --report: the command writes a page of its own, or computes nothing.
    `save=("-inner.csv",)`: with --save NAME.toml, NAME-inner.csv is written too.
    """
    flag = Annotated[bool, Parameter(help=f"Print one JSON object (schema {schema}) instead of text.")]
    html = Annotated[str | None, Parameter(help="Write a page (HTML).")]
    added: dict[str, tuple[Any, Any]] = {**({"report": (html, None)} if page else {}), "json": (flag, False)}
    usual = {"schema": re.split("[;,]", schema)[0]}
    keyword = inspect.Parameter.KEYWORD_ONLY

    def give(command: Callable[..., Result]) -> Callable[..., int]:
        own = inspect.signature(command)
        name = "hrg " + command.__name__.strip("_").replace("fit_", "fit ").replace("_", "-")

        @functools.wraps(command)
        def run(*arguments: Any, json: bool = False, **options: Any) -> int:
            report = options.pop("report", None) if page else None
            if report is not None:
                check_ending("--report", report, "a report is an HTML page", ".html", ".htm")
            given = own.bind(*arguments, **options).arguments
            with guarded({"report": report, **given}, endings) as read:
                if given.get("save") is not None:
                    check_ending("--save", given["save"], "a card or a model is a TOML file", ".toml")
                with Stages(name):
                    result = command(*arguments, **options)
                result = replace(result, payload=usual | result.payload)
                if caveats := _caveats_of(read):
                    parts = [*result.parts, *(Sentence(text, "note") for text in caveats)]
                    result = replace(result, payload=result.payload | {"caveats": caveats}, parts=parts)
                if report is not None:
                    from studies.results.page import render_result

                    with Stages("the page"):
                        write_text(report, render_result(result.page() if result.page else result))
                    say(f"report: {report}")
                if json:
                    named = {"report": report} if "report" in result.payload and page else {}
                    sys.stdout.write(dump_json(result.payload | named))
                else:
                    print_result(result)
                return int(result.status)

        more = [inspect.Parameter(n, keyword, default=default, annotation=kind) for n, (kind, default) in added.items()]
        signature = own.replace(parameters=[*own.parameters.values(), *more], return_annotation=int)
        run.__signature__ = signature  # type: ignore[attr-defined]
        run.__annotations__ = {**command.__annotations__, **{n: kind for n, (kind, _) in added.items()}, "return": int}
        return run

    return give


@contextmanager
def resumable(out: str, kept: str) -> Iterator[None]:
    """Say of an interruption that a folder keeps what is done, and how to go on."""
    try:
        yield
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"interrupted; {out} keeps the finished {kept}; run the same command again to resume.") from None  # fmt: skip


def check_ending(option: str, path: str, what: str, *endings: str) -> None:
    """Refuse the name of an output that is not of its kind: it may be that of something else."""
    if not path.lower().endswith((*endings, "/dev/null")):
        raise InputError(f"{option} {path}: {what}; give a name that ends in {endings[0]}.")


def _caveats_of(paths: Iterable[Path]) -> list[str]:
    """Return the caveats of the materials of all cards among some files, each once."""
    from studies.instrument.card import SCHEMA, load_card

    found: dict[str, None] = {}
    for path in paths:
        if path.suffix != ".toml":
            continue
        # the command says what is wrong with it
        with suppress(OSError, ValueError, RecursionError, InputError, ShellError):
            if tomllib.loads(path.read_text(encoding="utf-8-sig")).get("schema") == SCHEMA:
                found |= dict.fromkeys(load_card(path).material.caveats)
    return list(found)


def keep_card(instrument: "Instrument", path: str | None, against: str | None = "", kind: str = "card") -> str | None:
    """Save a card where a path was given and nothing speaks against it, say so, and return where it is."""
    if path is None:
        return None
    if against:
        say(f"{path} not saved: {against}.")
        return None
    from studies.instrument.card import save_card

    save_card(instrument, path)
    say(f"{kind}: {path}")
    return path


def keep_model(model: "Model", path: str | None) -> None:
    """Save a model where a path was given, and say so."""
    from studies.models import write_model

    if path is not None:
        write_model(model, path)
        say(f"model: {path}")


def keep_record(record: "Record", path: str) -> None:
    """Write a record, and say so."""
    from studies.record import write_record

    write_record(record, path)
    say(f"record: {path}")


def dump_json(payload: Mapping[str, Any]) -> str:
    """Return the text of one JSON object; NaN and infinity become null, numpy values plain numbers, what has fields an object."""
    return msgspec.json.format(msgspec.json.encode(payload, enc_hook=_plain), indent=2).decode() + "\n"


def say(message: str) -> None:
    """Tell people something beside the result (standard error)."""
    print(printable(message), file=sys.stderr)


def _plain(value: Any) -> Any:
    """Return a number or an array of numpy, or another mapping, as the builtin type that it stands for."""
    return value.tolist() if hasattr(value, "tolist") else dict(value)
