"""Bodies that many tests solve: fused silica, the dome of 15 mm by 0.9 mm free and on a stem, and a shape of each kind."""

from math import pi

from shell.elastic import Elastic
from shell.meridian import Stem, bell, cylinder, hemisphere

SILICA = Elastic(72.7e9, 0.17, 2203.0)
R, H = 15e-3, 0.9e-3
DOME = hemisphere(R, H)
STEMMED = hemisphere(R, H, support="stem", stem=Stem(2.5e-3, -5e-3, 0.5e-3))
BODIES = {
    "dome": DOME,
    "open pole": hemisphere(R, H, pole_angle=0.3),
    "closed sphere": hemisphere(R, H, rim_angle=pi),
    "inner stem": STEMMED,
    "two stems, sharp": hemisphere(R, H, support="stem", stem=Stem(2.5e-3, (-5e-3, 25e-3), 0.0, "both")),
    "cup": cylinder(12.5e-3, 0.7e-3, 18e-3, bottom_thickness=2e-3, clamp_radius=4e-3),
    "bell": bell(12.5e-3, 0.8e-3, 10e-3, 6e-3, 15e-3),
}
