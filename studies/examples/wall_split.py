"""Split of a dome whose wall is thicker along two diameters: a fourth harmonic of a few tenths of a micrometre."""

from math import degrees

import hrg


def split_of_wall(amplitude_um: float) -> tuple[float, float]:
    """Return the split of n = 2 (Hz) and the azimuth of an antinode of the slower mode (degrees); crests lie at 0°, 90° …"""
    wave = {"of": "wall", "order": 4, "amplitude_um": amplitude_um, "azimuth_deg": 0.0}
    dome = hrg.load_card("free-dome").with_table("imperfection", {"wave": [wave]})
    split = hrg.reference_split(dome).imperfection
    return split.hertz, degrees(split.slow_axis)


if __name__ == "__main__":
    for amplitude in (0.1, 0.2):
        hertz, axis = split_of_wall(amplitude)
        print(f"{amplitude} µm: split {hertz:.4f} Hz, slower mode at {axis:.1f}°")
