"""How every command speaks: a table for people, one JSON object for programs, nothing else on stdout."""

import functools
import inspect
import json as json_module
import math
import sys
from collections.abc import Callable, Generator, Mapping
from typing import Annotated, Any

from cyclopts import Parameter

from studies.errors import InputError
from studies.files.paths import guarded
from studies.results.terminal import print_result
from studies.results.terminal import print_table as print_table

Payload = Mapping[str, Any]
Answer = Generator[Payload | tuple[Payload, int], None, Any]
"""What a command is that prints for itself: it yields the object for programs, with an exit status beside it where that is not 0."""


def answers(schema: str) -> Callable[[Callable[..., Any]], Callable[..., int]]:
    """Make a command of a function that returns a `Result`: give it --json and --report, and keep its inputs from its outputs.

    A generator that yields the object and then prints for itself gets --json only.
    """

    def give(command: Callable[..., Any]) -> Callable[..., int]:
        own = inspect.signature(command)
        prints = inspect.isgeneratorfunction(command)

        @functools.wraps(command)
        def run(*arguments: Any, json: bool = False, **options: Any) -> int:
            report = None if prints else options.pop("report", None)
            if report is not None and not report.lower().endswith((".html", ".htm", "/dev/null")):
                raise InputError(f"--report {report}: a report is an HTML page; give a name that ends in .html.")
            with guarded({**own.bind(*arguments, **options).arguments, **({} if prints else {"report": report})}):
                if prints:
                    return _let_print(command(*arguments, **options), json)
                result = command(*arguments, **options)
                if report is not None:
                    from studies.files.writing import write_text
                    from studies.results.page import render_result

                    write_text(report, render_result(result))
                    say(f"report: {report}")
                if json:
                    print_json(result.payload | ({"report": report} if "report" in result.payload else {}))
                else:
                    print_result(result)
                return int(result.status)

        flag = Annotated[bool, Parameter(help=f"Print one JSON object (schema {schema}) instead of text.")]
        page = Annotated[str | None, Parameter(help="Write a page (HTML).")]
        added: dict[str, tuple[Any, Any]] = (
            {"json": (flag, False)} if prints else {"report": (page, None), "json": (flag, False)}
        )
        keyword = inspect.Parameter.KEYWORD_ONLY
        more = [inspect.Parameter(n, keyword, default=default, annotation=kind) for n, (kind, default) in added.items()]
        signature = own.replace(parameters=[*own.parameters.values(), *more], return_annotation=int)
        run.__signature__ = signature  # type: ignore[attr-defined]
        run.__annotations__ = {**command.__annotations__, **{n: kind for n, (kind, _) in added.items()}, "return": int}
        return run

    return give


def _let_print(steps: Answer, json: bool) -> int:
    try:
        given = next(steps)
    except StopIteration as ended:
        return int(ended.value or 0)
    payload, status = given if isinstance(given, tuple) else (given, 0)
    if json:
        steps.close()
        print_json(payload)
    else:
        next(steps, None)
    return status


def print_json(payload: Mapping[str, Any]) -> None:
    """Print one JSON object."""
    sys.stdout.write(dump_json(payload))


def dump_json(payload: Mapping[str, Any]) -> str:
    """Return the text of one JSON object; NaN and infinity become null, numpy values plain numbers."""
    return json_module.dumps(_plain(payload), indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def say(message: str) -> None:
    """Tell people something beside the result (standard error)."""
    from studies.files.given import printable

    print(printable(message), file=sys.stderr)


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value
