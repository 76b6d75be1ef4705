"""The command line `hrg`: one file per command, loaded only when that command runs.

Exit status: 0 done, 1 a fault of the program, 2 unusable input or arguments, 3 the environment, 4 a study finished with failed cases, 130 interrupted
and resumable.
"""

import gc
import os
import re
import sys
import warnings
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from importlib.util import LazyLoader
from itertools import takewhile
from types import ModuleType

from studies.cli.catalogue import CHAPTERS, COMMANDS, GROUPS
from studies.files.given import printable
from studies.interruption import has_made, heed, let_be
from studies.threads import ONE_THREAD

TYPE_CHECKING = False  # `typing` takes as long to load as all the rest here, and until `run` nobody heeds Ctrl-C
if TYPE_CHECKING:
    from cyclopts import App, Argument, Token

for _name, _count in ONE_THREAD.items():  # read by the libraries when numpy is first imported
    os.environ.setdefault(_name, _count)


EPILOGUE = "With --json a command prints one JSON object; --report FILE.html, where it is listed, writes a page; --debug shows the traceback of an error."


def spell_default(value: object) -> str | None:
    """Return a default as it is typed on a command line; None for what is off or empty unless given."""
    if value is None or value is False or value in ("", ()):
        return None
    if isinstance(value, tuple):
        return " ".join(f"{one:g}" if isinstance(one, float) else str(one) for one in value)
    return re.sub(r"e([-+])0+", r"e\1", f"{value:g}") if isinstance(value, float) else str(value)


def convert_exactly(kind: object, tokens: "Sequence[Token]") -> object:
    """Convert what was typed as cyclopts does, but no 2.5 to a whole number."""
    from cyclopts import CoercionError, convert

    kinds = (kind, *getattr(kind, "__args__", ()))
    for token in tokens if int in kinds and float not in kinds else ():
        if re.fullmatch(r"[-+]?\d*\.\d*[1-9]\d*", token.value):
            raise CoercionError(token=token, target_type=int)
    return convert(kind, tokens)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    debug = "--debug" in words
    words = [word for word in words if word != "--debug"]
    plain = warnings.formatwarning
    warnings.formatwarning = lambda message, *_, **__: f"hrg: warning: {printable(str(message))}\n"
    try:
        from studies.cli.guard import find_name_clash

        clash = find_name_clash()
        if clash:
            return _complain(clash, 3)
        status = _command_line(words)(words)
    except KeyboardInterrupt as stop:
        return _complain(str(stop) or "interrupted.", 130)
    except BrokenPipeError:
        sys.stderr.close()
        return 0
    except Exception as error:
        if has_made(error):  # as compiled modules do while they are loaded
            return _complain("interrupted.", 130)
        return _complain(*_judge(error, words), error if debug else None)
    finally:
        warnings.formatwarning = plain
    return int(status) if isinstance(status, int) else 0


def _command_line(words: Sequence[str]) -> "App":
    from cyclopts import App, Group, Parameter

    from studies import __version__
    from studies.files.given import refuse_unsound

    app = App(
        name="hrg",
        help="Workbench for hemispherical, cylindrical and bell-shaped resonator gyroscopes.",
        help_epilogue=EPILOGUE,
        version=f"hrg-workbench {__version__}",
        result_action="return_value",
        exit_on_error=False,
        print_error=False,
        suppress_keyboard_interrupt=False,
        default_parameter=Parameter(
            negative="", validator=refuse_unsound, show_default=spell_default, converter=convert_exactly
        ),
    )
    if not words or words[0] in ("--install-completion", "--help", "-h"):  # it takes a tenth of a short command to load
        app.register_install_completion_command(help="Install completion for the shell in use (bash, zsh or fish).")
    groups: dict[str, App] = {}
    for place, (title, commands) in enumerate(CHAPTERS.items()):
        heading = Group(title, sort_key=place)
        for name, help_line in commands.items():
            *group, command = name.split(" ")
            parent = app
            if group:
                if group[0] not in groups:
                    groups[group[0]] = App(name=group[0], help=GROUPS[group[0]], group=heading)
                    app.command(groups[group[0]])
                parent = groups[group[0]]
            # the line stands in lists of commands; a command's own help page shows its whole docstring
            more = {} if words[: len(group) + 1] == name.split(" ") else {"help": help_line}
            parent.command(COMMANDS[name][0], name=command, **(more if group else {**more, "group": heading}))
    return app


def _judge(error: Exception, words: Sequence[str]) -> tuple[str, int]:
    """Return the sentence that a user reads of an error, and the exit status."""
    import cyclopts

    from studies.errors import UNUSABLE_INPUT, MissingEnvironment, nearest
    from studies.files.lines import point_out

    match error:
        case cyclopts.UnusedCliTokensError():
            return _say_unused(error.unused_tokens or [], words), 2
        case cyclopts.UnknownCommandError():  # its own words would load every command
            word = " ".join([*words[:1], *(error.unused_tokens or [])[:1]] if words[0] in GROUPS else words[:1])
            return f"unknown command '{word}'{nearest(word, (*COMMANDS, *GROUPS))}", 2
        case cyclopts.MissingArgumentError() if error.argument is not None and not error.tokens_so_far:
            lacking = f"{error.keyword}: its value" if error.keyword else _spell(error.argument)
            return f"{lacking} is missing. {_see(words)}", 2
        case cyclopts.CoercionError() if error.token is not None and error.target_type in KINDS:
            given = f"{error.token.keyword or _spell(error.argument)} {error.token.value}"
            return f"{given}: give {KINDS[error.target_type]}. {_see(words)}", 2
        case cyclopts.ValidationError() if error.argument is not None and isinstance(error.__cause__, UNUSABLE_INPUT):
            return f"{_spell(error.argument)} {error.__cause__}", 2
        case cyclopts.CycloptsError():
            return f"{' '.join(str(error).split())} {_see(words)}", 2
        case _ if isinstance(error, UNUSABLE_INPUT):
            return point_out(str(error)), 2
        case MissingEnvironment():
            return str(error), 3
        case OSError() | MemoryError() | UnicodeError():
            return describe_environment_error(error), 3
    return f"internal fault: {type(error).__name__}: {error}. Run again with --debug and report it.", 1


def _say_unused(unused: Sequence[str], words: Sequence[str]) -> str:
    """Say which words no argument takes, and that a profile in words is one argument."""
    named = ", ".join(f"'{word}'" for word in unused)
    before = list(words[: words.index(unused[0])]) if unused and unused[0] in words else []
    if before and before[-1] in PROFILE_WORDS:
        whole = " ".join([before[-1], *takewhile(lambda word: not word.startswith("-") or word[1:2].isdigit(), unused)])
        return f'put a profile of several words in quotes: "{whole}".'
    return f"{named}: too many arguments; put text with spaces in quotes. {_see(words)}"


def _see(words: Sequence[str]) -> str:
    """Return a hint that leads to the help of the command that the leading words name."""
    named = next((words[:size] for size in (2, 1) if " ".join(words[:size]) in COMMANDS), [])
    return f"See '{' '.join(['hrg', *named, '--help'])}'."


def _spell(argument: "Argument | None") -> str:
    """Return the name of an argument as its help has it: --out, or CARD for one that stands by its place."""
    if argument is None:
        return "an argument"
    positional = argument.field_info.is_positional and not argument.field_info.is_keyword_only
    return argument.name.lstrip("-").upper() if positional else argument.name


KINDS: dict[object, str] = {int: "a whole number", float: "a number", bool: "yes or no"}
PROFILE_WORDS = ("soak", "step", "ramp", "staircase", "cycle")


def _complain(message: str, status: int, error: BaseException | None = None) -> int:
    if error is not None:
        import traceback

        traceback.print_exception(error)
    print(f"hrg: {printable(message)}", file=sys.stderr)
    return status


def describe_environment_error(error: BaseException) -> str:
    """Say in one sentence what the system refused: a file, memory, a character that the terminal cannot show."""
    if isinstance(error, MemoryError):
        return "there is not enough memory for this; take fewer rows, a lower rate or a smaller study."
    if isinstance(error, UnicodeError):
        return f"a text cannot be shown or read here ({error}); set PYTHONUTF8=1, or rename the file."
    assert isinstance(error, OSError)
    named = f"{os.fsdecode(error.filename)!r}: " if error.filename else ""
    return f"{named}the system refuses ({error.strerror or error}); check permissions, path and disk space."


DEFERRED = ("numpy.f2py", "numpy.testing", "pydoc")


class _Deferred:
    """What SciPy imports with all the rest and nothing here uses: loaded when first used, if ever (0.15 s)."""

    @staticmethod
    def find_spec(name: str, path: Sequence[str] | None = None, target: object = None) -> ModuleSpec | None:
        found = PathFinder.find_spec(name, path) if name in (*DEFERRED, _Unread.name) else None
        if found and found.loader:
            found.loader = _Unread(name, str(found.origin)) if name == _Unread.name else LazyLoader(found.loader)
        return found


class _Unread(SourceFileLoader):
    """SciPy's reader of what it says of its functions, which it edits as it loads (0.2 s of a command on records): it reads nothing, for no command shows that."""

    name = "scipy._lib._docscrape"

    def exec_module(self, module: ModuleType) -> None:
        super().exec_module(module)
        if read := getattr(module, "FunctionDoc", None):
            vars(module)["FunctionDoc"] = lambda function, **_: read(function, doc="")


def run() -> None:
    """Entry point of the console script: a request to end counts as Ctrl-C, and a terminal shows what it can."""
    try:
        heed()
        sys.meta_path.insert(0, _Deferred)
        gc.set_threshold(20_000)  # what is imported stays: looking through it costs a tenth of a short command
        for stream in (sys.stdout, sys.stderr):
            if stream is not None and hasattr(stream, "reconfigure"):
                stream.reconfigure(errors="backslashreplace")
        if sys.stdout is None:
            sys.exit(_complain("standard output is closed; redirect it to a file or to /dev/null.", 3))
        status = main()
        sys.stdout.flush()
    except KeyboardInterrupt:
        status = _complain("interrupted.", 130)
    except BrokenPipeError:
        os._exit(0)  # who reads has gone; nothing is left to tell
    except OSError as error:
        status = _complain(describe_environment_error(error), 3)
    finally:
        let_be()
    sys.exit(status)
