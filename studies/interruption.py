"""Ctrl-C and a request to end (SIGTERM): raised every second until heard, for compiled modules and finalisers may drop them."""

import signal
import sys

TYPE_CHECKING = False  # loaded before anything else: `types` and `typing` can wait
if TYPE_CHECKING:
    from types import FrameType

AGAIN = 1.0  # s
SOON = 0.02  # s
_asked = False


def heed() -> None:
    """From now on both requests raise KeyboardInterrupt; one that is ignored (a job in the background) stays ignored."""
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _interrupt)
    signal.signal(signal.SIGALRM, _interrupt)
    sys.unraisablehook = _drop


def has_made(error: BaseException) -> bool:
    """Tell whether an error is what became of an interruption."""
    return _asked or _holds_interrupt(error)


def let_be() -> None:
    """Do not ask again: the program ends."""
    signal.setitimer(signal.ITIMER_REAL, 0.0)


def _interrupt(number: int, frame: "FrameType | None") -> None:
    global _asked
    _asked = True
    signal.setitimer(signal.ITIMER_REAL, AGAIN)
    if number != signal.SIGALRM or not _holds_interrupt(sys.exception()):  # of what the code that was met handles now
        raise KeyboardInterrupt


def _drop(lost: "sys.UnraisableHookArgs") -> None:
    """Say nothing of an interruption that the interpreter has to drop: it comes again, and soon."""
    if issubclass(lost.exc_type, KeyboardInterrupt):
        signal.setitimer(signal.ITIMER_REAL, SOON)
    else:
        sys.__unraisablehook__(lost)


def _holds_interrupt(error: BaseException | None) -> bool:
    while error is not None:
        if isinstance(error, KeyboardInterrupt):
            return True
        error = error.__cause__ or error.__context__
    return False
