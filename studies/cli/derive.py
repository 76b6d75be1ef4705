"""`hrg derive`: the symbolic derivation of the HRG paper's equations (1)–(15), for people and for design code.

Schema hrg.derive/1: `harmonic`, `pole_angle_deg`, `rim_angle_deg`; `I`, `J` and `bryan_factor`, each with its
`closed_form` (text) and `value`; `d_ln_f_d_rim_angle_per_rad`; `equations`, a list in the order of the derivation
with `number` in the paper (null where it has none), `title`, and the equations of the step in `latex` and in
`plain` text; with --code also `code` with its `language` and `text`.

With --bell: schema hrg.derive-bell/1, `equations` as above and `numbers`, the theory's frequencies beside the solver's.
With --dynamics: schema hrg.derive-dynamics/1, `equations` and, with --code, `code` as above; the numbers are those of the
CVG paper on demodulated dynamics.
"""

from typing import TYPE_CHECKING, Any, Literal

from studies.cli.output import Answer, answers

if TYPE_CHECKING:
    from collections.abc import Iterable

    from shell.derivation.chain import Step

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
) -> Answer:
    """Derive the frequency of the inextensional spherical shell, HRG paper equations (1)-(15).

    Prints the chain of equations for any harmonic n, from the displacements to the frequency, and its
    closed forms for one harmonic and one polar range. With --dynamics, instead, how the standing wave moves: amplitude,
    quadrature, precession and phase from the two-dimensional oscillator.

    Parameters
    ----------
    dynamics : bool
        Derive the averaged dynamics of the vibration (Lynch's form; the CVG paper's equations 7 to 25), its transfer functions and poles, and its optimal filters (35, 36).
    bell : bool
        Derive the theory of the bell (BVG paper, equations 1 to 22), beside what is printed, and hold its frequency against the
        solver on the card bvg-bell; about 20 seconds.
    latex : bool
        Print a LaTeX fragment (amsmath) instead.
    code : {'python', 'c'}, optional
        Print the frequency, Bryan factor and derivatives as self-contained code instead.
    harmonic : int
        Circumferential harmonic n of the closed forms and of the code, at least 2.
    pole_angle_deg : float
        Polar angle where the shell starts; above 0 the pole is open.
    rim_angle_deg : float
        Polar angle where the shell ends.
    """
    from math import radians

    from shell.derivation.chain import DerivedCase, steps
    from shell.derivation.design_code import emit_code
    from shell.derivation.emit import HRG_TITLE, emit_latex, emit_text
    from shell.rayleigh import rayleigh_integrals
    from studies.errors import InputError

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
        return (yield from _derive_bell(latex) if bell else _derive_dynamics(latex, code))
    if not 0 <= pole_angle_deg < rim_angle_deg < 180:
        raise InputError(
            f"a dome from {pole_angle_deg:g} to {rim_angle_deg:g} degrees has no inextensional mode: the pole angle must "
            "be 0 or more and below the rim angle, the rim angle below 180 degrees."
        )
    if harmonic > MOST_HARMONIC:
        raise InputError(
            f"--harmonic {harmonic}: closed forms are derived up to n = {MOST_HARMONIC}; choose a lower one."
        )
    shape = rayleigh_integrals(harmonic, radians(pole_angle_deg), radians(rim_angle_deg))
    case = DerivedCase.from_degrees(harmonic, pole_angle_deg, rim_angle_deg)
    # On a cap of a thousandth of a degree a hundred digits do not suffice to evaluate the closed forms.
    for closed, integral in ((case.bending, shape.I), (case.mass, shape.J)):
        if abs(complex(closed.evalf(20)) / integral - 1) > 1e-9:
            raise InputError(
                f"from {pole_angle_deg:g} to {rim_angle_deg:g} degrees the closed forms of harmonic {harmonic} cancel"
                " to nothing; take a wider cap."
            )
    text = {} if code is None else {"code": {"language": code, "text": emit_code(case, code)}}
    yield _payload(case, pole_angle_deg, rim_angle_deg) | text
    if code is not None:
        print(emit_code(case, code), end="")
    else:
        print(emit_latex(steps(case), HRG_TITLE) if latex else emit_text(steps(case)), end="")


def _derive_dynamics(latex: bool, code: Literal["python", "c"] | None) -> Answer:
    from compensation.derivation import chain
    from compensation.derivation.design_code import emit_code

    text = {} if code is None else {"code": {"language": code, "text": emit_code(code)}}
    equations = [
        {
            "number": step.number or None,
            "title": step.title,
            "latex": [chain.typeset(equation) for equation in step.equations],
            "plain": [chain.write_plainly(equation) for equation in step.equations],
        }
        for step in chain.steps()
    ]
    yield {"schema": "hrg.derive-dynamics/1", "equations": equations} | text
    if code is not None:
        print(emit_code(code), end="")
    else:
        print(chain.emit_latex() if latex else chain.emit_text(), end="")
    return 0


def _derive_bell(latex: bool) -> Answer:
    import dataclasses

    from shell.derivation.bell_chain import bell_steps
    from shell.derivation.emit import BELL_TITLE, emit_latex, emit_text
    from studies.cli.output import print_table, say
    from studies.papers.bvg_theory import compare_bell_theory

    say("deriving the bell's equations ...")
    steps = bell_steps()
    if latex:
        print(emit_latex(steps, BELL_TITLE), end="")
        return 0
    theory = compare_bell_theory()
    yield {"schema": "hrg.derive-bell/1", "equations": _equations(steps), "numbers": dataclasses.asdict(theory)}
    print(emit_text(steps))
    rows = [
        [row.name, f"{row.frequency:.6g}", f"{row.precession_factor:.5f}", f"{row.membrane_share:.3g}"]
        for row in (*theory.rows, theory.free, theory.solid)
    ]
    columns = ["pattern", "f (Hz)", "precession factor", "membrane share of the energy"]
    print_table(f"(21), (22) with these patterns, and the solver: card {theory.card}", columns, rows)
    return 0


def _equations(steps: "Iterable[Step]") -> list[dict[str, Any]]:
    from shell.derivation.emit import typeset, write_plainly

    return [
        {
            "number": step.number or None,
            "title": step.title,
            "latex": [typeset(equation) for equation in step.equations],
            "plain": [write_plainly(equation) for equation in step.equations],
        }
        for step in steps
    ]


def _payload(case: Any, pole_angle_deg: float, rim_angle_deg: float) -> dict[str, Any]:
    from shell.derivation.chain import steps

    return {
        "schema": "hrg.derive/1",
        "harmonic": case.harmonic,
        "pole_angle_deg": pole_angle_deg,
        "rim_angle_deg": rim_angle_deg,
        "I": {"closed_form": str(case.bending), "value": float(case.bending.evalf(20))},
        "J": {"closed_form": str(case.mass), "value": float(case.mass.evalf(20))},
        "bryan_factor": {"closed_form": str(case.precession), "value": float(case.precession.evalf(20))},
        "d_ln_f_d_rim_angle_per_rad": float(case.rim_derivative.evalf(20)),
        "equations": _equations(steps(case)),
    }
