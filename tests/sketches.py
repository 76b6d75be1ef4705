"""Pages in the tests: figures without layout, file and curves, stills of one pixel, sliders of one dimension; diagnoses of coarse means.

What draws them whole has tests of its own, which ask for the fixture `drawn`; golden answers and `tests/benchmarks/judge.py` take all means.
"""

import base64
from importlib import import_module
from typing import Any

PIXEL = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNkYPhfDwAChwGA60e6kgAAAABJRU5ErkJggg=="
)


def sketch_pages(patch: Any) -> dict[str, Any]:
    """Put the sketches in; return what stood there, by name. A figure is drawn once of each kind: what cannot be drawn fails so too."""
    known: set[tuple[str, ...]] = set()

    def sketch(figure: Any, caption: str, alt: str) -> Any:
        kind = tuple(caption.split()[:4])
        if kind not in known:
            known.add(kind)
            figure.set_layout_engine("none")
            figure.draw_without_rendering()
        return import_module("studies.results.page").Picture("data:image/svg+xml;base64,", caption, alt)

    sketches = {
        "studies.results.page.draw": sketch,
        "studies.reports.scenes.draw_still": lambda shown: PIXEL,
        "studies.reports.live.MOST_AXES": 1,
    }
    whole = {}
    for name, made in sketches.items():
        module, _, attribute = name.rpartition(".")
        whole[name] = getattr(import_module(module), attribute)
        patch.setattr(name, made)
    return whole


def coarsen(patch: Any, means: int = 200) -> dict[str, Any]:
    """Let a diagnosis take so many means of a run, where it takes 400 of itself, and of a campaign twice as many; return what it takes, by name."""
    module, coarse = import_module("studies.inference.diagnosis"), {"BLOCKS": 2 * means, "BLOCKS_OF_RUN": (50, means)}
    whole = {f"{module.__name__}.{name}": getattr(module, name) for name in coarse}
    for name, value in coarse.items():
        patch.setattr(module, name, value)
    return whole
