"""The commands by chapter, one line of help each, and where their functions are."""

import re

CHAPTERS: dict[str, dict[str, str]] = {
    # of the list of commands: name, one line of help
    "Design a resonator": {
        "modes": "Frequencies, Bryan factors and sensitivities of the modes.",
        "tcf": "Temperature coefficient of the frequency and its contributions.",
        "loss": "Q over temperature, with loss contributions and what to reduce first.",
        "loads": "Frequency shift, stress and tilt under acceleration, rotation, pressure, gradients.",
        "loop": "Control loops: stability margins, bias and noise by source, start-up, runs.",
        "compare": "Compare designs: differences between cards and their effects.",
        "optimise": "Find dimensions for objectives under constraints, with tolerances.",
        "design new": "Write a task for hrg optimise.",
        "render": "Mode shape as a picture, animation, page or mesh.",
        "mesh": "Quadratic mesh of the solid for a finite-element program.",
        "study run": "Run or resume a parametric study.",
        "study status": "Show the progress of a study and its failed cases.",
        "study report": "Write a page: results, sensitivities, yield and provenance.",
        "study export": "Export the results as CSV, with a file of units.",
        "study new": "Write a study template.",
        "derive": "Symbolic derivation as equations, LaTeX or code.",
    },
    "Manufacture": {
        "scan": "Wall maps, harmonics and frequency splits from measured faces.",
        "trim": "Plan trimming cuts from measured splits.",
        "electrodes": "Electrode softening, split, pull-in and trim voltages.",
    },
    "Simulate and import": {
        "simulate": "Simulate a run of an instrument through a chamber profile.",
        "twin": "Write the virtual gyro of a card as an FMU or as C.",
        "thermal": "Temperatures along the heat path for a chamber profile.",
        "import": "Convert laboratory files to the record format.",
        "show": "Look at records: columns, faults, noise, and what they can be used for.",
        "export": "Write a record for other programs: Parquet, MATLAB, TDMS, MDF, HDF5.",
    },
    "Calibrate, diagnose and accept": {
        "calibrate": "Estimate the uncertain values of a card from records, with intervals.",
        "diagnose": "Find what the simulation gets wrong, its cause, and the gain from correcting it.",
        "fleet": "Calibrate and diagnose a lot of devices: shared causes, odd devices, charts.",
        "effects": "List the physical effects for diagnosis and cards.",
        "acceptance": "Evaluate records against limits with the tests of IEEE 1431.",
    },
    "Compensate": {
        "fit frequency": "f(T) and its inverse from a steady-state table or records.",
        "fit bias": "Bias model over frequency or temperature and their rates.",
        "fit thermal": "Thermal time constants of a gyro from records.",
        "fit cross-damping": "Cross-damping bias over temperature.",
        "fit whole-angle": "Splits, axes and gains from a whole-angle run.",
        "fit ringdown": "Frequencies, Q and axes from free decays.",
        "fit scale": "Bias and scale factor of a bell-shaped gyro, step by step.",
        "compensate": "Apply a saved model to a record, or emit it as C code.",
        "temperature": "Resonator temperature from its frequency.",
    },
    "Library and setup": {
        "cards": "List the built-in instrument cards, or the uncertain values of a card.",
        "card new": "Write a card template.",
        "keys": "List the keys of a card, map, model or limits file: units, defaults, bounds.",
        "materials": "List the materials and their published laws.",
        "reproduce": "Recompute the tables and figures of the source papers.",
        "doctor": "Check the environment for missing programs and packages.",
    },
}
GROUPS = {
    "card": "Write your own card.",
    "design": "Write a design task.",
    "fit": "Fit a compensation model to measured data.",
    "study": "Parametric studies: create, run, monitor, report, export.",
}


def _find(name: str) -> str:
    """Return module and function of a command: its own file, but what is written as a template, and studies."""
    group, _, command = name.partition(" ")
    if command == "new":
        return f"studies.cli.new:{group}"
    word = re.sub("[ -]", "_", name) + "_" * (name == "import")
    return f"studies.cli.study:{command}" if group == "study" else f"studies.cli.{word}:{word}"


COMMANDS = {name: (_find(name), words) for chapter in CHAPTERS.values() for name, words in chapter.items()}
