"""`hrg derive`: the symbolic derivation of the HRG paper's equations (1)–(15), for people and for design code."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from math import radians
from typing import TYPE_CHECKING, Any, Literal

from shell.rayleigh import rayleigh_integrals
from studies.cli.output import answers
from studies.errors import InputError
from studies.files.writing import write_text
from studies.progress import tell
from studies.results import Blocks, Chapter, Result, Sentence, Table

if TYPE_CHECKING:
    from shell.derivation.chain import Row
    from studies.derivation import Step

HRG_TITLE = "Rayleigh's inextensional shell, HRG paper equations (1)-(15)"
BELL_TITLE = "The bell's theory, BVG paper equations (1)-(22)"
DYNAMICS_TITLE = "Averaged dynamics of a Coriolis vibratory gyro"
DERIVING, ROWS = "deriving the equations", 30  # of the longest chain
MOST_HARMONIC = 100  # the closed forms of higher ones take minutes


@answers("hrg.derive/1")
def derive(
    *,
    dynamics: bool = False,
    bell: bool = False,
    latex: bool = False,
    code: Literal["python", "c"] | None = None,
    harmonic: int = 2,
    pole_angle_deg: float = 0.0,
    rim_angle_deg: float = 90.0,
    out: str | None = None,
) -> Result:
    """Derive the frequency of the inextensional spherical shell, HRG paper equations (1)-(15).

    Prints the chain of equations for any harmonic n, from the displacements to the frequency, and its
    closed forms for one harmonic and one polar range. With --dynamics, it derives the motion of the standing wave instead:
    amplitude, quadrature, precession and phase of the two-dimensional oscillator.

    Args:
        dynamics: Derive the averaged dynamics of the vibration (Lynch's form; the CVG paper's equations 7 to 25), its
            transfer functions and poles, and its optimal filters (35, 36).
        bell: Derive the theory of the bell (BVG paper, equations 1 to 22), beside the published equations, and compare
            its frequency with the solver on the card bvg-bell.
        latex: Print a LaTeX fragment (amsmath) instead.
        code: Print the frequency, Bryan factor and derivatives as self-contained code instead.
        harmonic: Circumferential harmonic n of the closed forms and of the code, at least 2.
        pole_angle_deg: Polar angle where the shell starts; above 0 the pole is open.
        rim_angle_deg: Polar angle where the shell ends.
        out: Write the equations, the LaTeX fragment or the code to this file instead of printing them.
    """
    from shell.derivation.chain import DerivedCase, steps
    from shell.derivation.design_code import emit_code
    from studies.derivation import read_chain

    if latex and code is not None:
        raise InputError("--latex and --code each print in another form; choose one of them.")
    if dynamics and bell:
        raise InputError("--dynamics and --bell are two derivations; choose one of them.")
    if dynamics or bell:
        if (harmonic, pole_angle_deg, rim_angle_deg) != (2, 0.0, 90.0):
            which = "--dynamics" if dynamics else "--bell"
            raise InputError(f"{which} holds for any harmonic and shape; leave out --harmonic and the angles.")
        if bell and code is not None:
            raise InputError("--bell has equations and numbers but no design code; leave out --code.")
        return _keep(_derive_bell(latex) if bell else _derive_dynamics(latex, code), out)
    if not 0 <= pole_angle_deg < rim_angle_deg < 180:
        raise InputError(
            f"a dome from {pole_angle_deg:g} to {rim_angle_deg:g} degrees has no inextensional mode: the pole angle must "
            "be 0 or more and below the rim angle, the rim angle below 180 degrees."
        )
    if harmonic > MOST_HARMONIC:
        raise InputError(f"--harmonic {harmonic}: closed forms are derived up to n = {MOST_HARMONIC}; choose a lower n.")  # fmt: skip
    shape = rayleigh_integrals(harmonic, radians(pole_angle_deg), radians(rim_angle_deg))
    tell(DERIVING, 0.0)
    case = DerivedCase.from_degrees(harmonic, pole_angle_deg, rim_angle_deg)
    closed_forms = {"I": case.bending, "J": case.mass, "bryan_factor": case.precession}
    # On a cap of a thousandth of a degree a hundred digits do not suffice to evaluate the closed forms.
    for closed, integral in ((case.bending, shape.I), (case.mass, shape.J)):
        if abs(complex(closed.evalf(20)) / integral - 1) > 1e-9:
            raise InputError(f"from {pole_angle_deg:g} to {rim_angle_deg:g} degrees the closed forms of harmonic {harmonic} cancel to nothing; take a wider cap.")  # fmt: skip
    payload: dict[str, Any] = {
        "harmonic": case.harmonic,
        "pole_angle_deg": pole_angle_deg,
        "rim_angle_deg": rim_angle_deg,
        **{name: {"closed_form": str(one), "value": float(one.evalf(20))} for name, one in closed_forms.items()},
        "d_ln_f_d_rim_angle_per_rad": float(case.rim_derivative.evalf(20)),
    }
    lead = f"HRG paper, equations (1) to (15), closed forms for n = {harmonic} from {pole_angle_deg:g}° to {rim_angle_deg:g}°."
    emitted = {"language": code, "text": emit_code(case, code)} if code else None
    title = "Frequency of the inextensional shell"
    return _keep(_answer(payload, read_chain(_told(steps(case), 0.6)), HRG_TITLE, latex, title, lead, emitted), out)


def _told(rows: Iterable["Row"], behind: float = 0.0) -> "Iterator[Row]":
    for k, row in enumerate(rows):
        tell(DERIVING, behind + (1.0 - behind) * k / ROWS)
        yield row


def _keep(found: Result, out: str | None) -> Result:
    if out is None:
        return found
    said = (part.text for part in found.parts if isinstance(part, Sentence))
    write_text(out, next(said) if found.printed is None else found.printed)
    return replace(found, printed=f"wrote {out}\n")


def _derive_dynamics(latex: bool, code: Literal["python", "c"] | None) -> Result:
    from compensation.derivation.chain import steps
    from compensation.derivation.design_code import emit_code
    from studies.derivation import read_chain

    lead = "Averaged equations of amplitude, quadrature, precession and phase of the standing wave."
    emitted = {"language": code, "text": emit_code(code)} if code else None
    payload, chain = {"schema": "hrg.derive-dynamics/1"}, read_chain(_told(steps()))
    return _answer(payload, chain, DYNAMICS_TITLE, latex, "Dynamics of the standing wave", lead, emitted)


def _derive_bell(latex: bool) -> Result:
    from shell.derivation.bell_chain import bell_steps, shorten
    from studies.derivation import read_chain
    from studies.papers.bvg_theory import compare_bell_theory

    payload: dict[str, Any] = {"schema": "hrg.derive-bell/1", "numbers": None}
    lead = "BVG paper, equations (1) to (22), beside what is printed."
    found = _answer(payload, read_chain(_told(bell_steps()), shorten), BELL_TITLE, latex, "Theory of the bell", lead)
    if latex:
        return found
    theory = compare_bell_theory()
    title = f"Equations (21), (22) with these patterns, and the solver: card {theory.card}"
    head = "name: pattern | frequency: f (Hz) .6g | precession_factor: precession factor .5f | membrane_share: membrane share of the energy .3g"
    table = Table(title, [*theory.rows, theory.free, theory.solid], head)
    printed = Sentence(found.printed or "", "source", "terminal")
    parts = [printed, Chapter("Against the solver", [table]), *found.parts]
    return replace(found, payload=found.payload | {"numbers": theory}, parts=parts, printed=None)


def _answer(
    payload: dict[str, Any], chain: "Sequence[Step]", latex_title: str, latex: bool, title: str, lead: str,
    code: dict[str, str] | None = None,
) -> Result:  # fmt: skip
    """Return the equations of a derivation and its code; the page has the equations as a terminal shows them."""
    from studies.derivation import draw, emit_latex, emit_text, typeset, write_plainly

    equations = [
        {"number": step.number or None, "title": step.title, "latex": list(map(typeset, step.equations)),
         "plain": list(map(write_plainly, step.equations))}
        for step in chain
    ]  # fmt: skip
    text = code["text"] if code else emit_latex(chain, latex_title) if latex else emit_text(chain)
    chapters = [Chapter(step.heading, [Blocks(lambda step=step: [Sentence(draw(step), "source")])]) for step in chain]  # type: ignore[misc]
    found = payload | {"equations": equations} | ({"code": code} if code else {})
    return Result(found, title, lead, chapters, printed=text)
