"""Contract: every law of every material keeps its promises; what no source states is refused by name."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.constants import zero_Celsius

from shell.crystal import Crystal, bounds_of
from shell.errors import ShellError
from shell.material import ELASTIC, constant_material
from shell.materials import PROPERTIES, find_material, read_materials

LAWS = [law for laws in read_materials().values() for law in laws.values()]


@pytest.mark.parametrize("law", LAWS, ids=lambda law: f"{law.name}:{law.law}")
def test_law_has_source_range_and_sane_values(law):
    assert law.source
    T = np.linspace(law.lowest, law.highest, 50)
    for name in PROPERTIES:
        try:
            values = law.value(name, T)
        except ShellError as error:
            assert "no source states" in str(error)  # noqa: PT017
            assert name not in law.properties
            continue
        assert np.isfinite(values).all()
    for outside in (law.lowest - 1, law.highest + 1, np.nan):
        with pytest.raises(ShellError, match="outside the range"):
            law.value(next(iter(law.properties)), outside)


def test_incomplete_material_loads_and_names_what_it_lacks():
    steel = find_material("maraging-steel")
    assert steel.value("youngs_modulus", 293.15) == 187e9
    with pytest.raises(ShellError, match="density"):
        steel.value("density", 293.15)
    with pytest.raises(ShellError, match=r"maraging-steel.*(poisson ratio|shear modulus)"):
        steel.elastic(293.15)


def test_spinner_law_has_its_published_statements():
    """Spinner 1962: G 9 % above room temperature at its maximum, nu from 1/6 to 1/5, E more than 11 % (12.1 % here)."""
    law = find_material("fused-silica").properties
    at_maximum = 1125.0 + zero_Celsius
    room = 25.0 + zero_Celsius
    assert law["shear_modulus"](at_maximum) / law["shear_modulus"](room) == pytest.approx(1.09)
    assert law["poisson_ratio"](room) == pytest.approx(1 / 6, abs=1e-4)
    assert law["poisson_ratio"](at_maximum) == pytest.approx(1 / 5, abs=1e-4)


def test_slope_of_g_lies_in_the_published_band():
    """Maximum at 1050 to 1200 °C: d ln G/dT at 25 °C between 1.53e-4 and 1.76e-4 1/K."""
    material = find_material("fused-silica")
    law, slopes = material.properties["shear_modulus"], []
    for top in (1050.0, 1200.0):
        moved = replace(law, numbers={**law.numbers, "maximum_degC": top})
        changed = replace(material, properties={**material.properties, "shear_modulus": moved})
        slopes.append(changed.log_slope("shear_modulus", 298.15))
    assert slopes == pytest.approx([1.756e-4, 1.532e-4], rel=2e-3)
    assert slopes[1] < material.log_slope("shear_modulus", 298.15) < slopes[0]


def test_elastic_constants_are_consistent_for_every_pair():
    T = np.array([260.0, 293.15, 320.0])
    law = find_material("fused-silica")
    E, G, nu = (law.value(name, T) for name in ("youngs_modulus", "shear_modulus", "poisson_ratio"))
    np.testing.assert_allclose(E, 2 * G * (1 + nu), rtol=1e-14)
    gwinc = find_material("fused-silica", "gwinc")
    E, G, nu = (gwinc.value(name, T) for name in ("youngs_modulus", "shear_modulus", "poisson_ratio"))
    np.testing.assert_allclose(G, E / (2 * (1 + nu)), rtol=1e-14)


def test_expansion_conserves_mass():
    law = find_material("fused-silica")
    T = np.linspace(260, 330, 8)
    mass = law.value("density", T) * law.growth(T, 293.15) ** 3
    np.testing.assert_allclose(mass, mass[0], rtol=1e-14)
    assert law.growth(303.15, 293.15) == pytest.approx(np.exp(5.1e-6), rel=1e-12)


SCHEMA = 'schema = "hrg.materials/1"\n'
OPENED = f'{SCHEMA}[x.laws.a]\nsource="s"\n'
LAW = f"{OPENED}range_degC=[0, 9]\n"
BROKEN = [
    ("", ["schema"]),
    (SCHEMA, ["no material"]),
    (f"{SCHEMA}[x]\n", ["laws"]),
    (f"{SCHEMA}[x", ["TOML"]),
    (f"{OPENED}range_degC=[10, 0]", ["range_degC"]),
    (f"{OPENED}range_degC=[-300, 0]", ["absolute zero"]),
    (LAW + 'young={form="constant",value=1}', ["[x.laws.a]", "'young'"]),
    (LAW + 'poisson_ratio={form="constant",value=0.6}', ["poisson_ratio"]),
    (LAW + 'crystal={system="cubic",axis="[001]",at_degC=20,C11=1e11,C12=2e11,C44=1e11}', ["stable"]),
    (LAW + 'crystal={system="cubic",axis="c",at_degC=20,C11=1e11,C12=2e10,C44=1e11}', ["axis", "[111]"]),
    (LAW + 'crystal={system="cubic",axis="[001]",at_degC=20,C11=1e11,C12=2e10}', ["C44", "missing"]),
    (LAW + 'crystal={system="cube",axis="[001]",at_degC=20}', ["cube", "cubic"]),
    (LAW + 'youngs_modulus={form="cubic"}', ["'cubic'"]),
    (LAW + 'youngs_modulus={form="linear",value=1}', ["[x.laws.a.youngs_modulus]", "at_degC"]),
    (LAW + 'youngs_modulus={form="table",temperature_degC=[0,5],values=[1,2]}', ["covers"]),
    (LAW + 'youngs_modulus={form="table",temperature_degC=[0,9],values=3}', ["values", "list"]),
    (LAW + 'youngs_modulus={form="table",temperature_degC=3,values=[1,2]}', ["temperature_degC", "list"]),
    (LAW + 'youngs_modulus={form="constant",value=[1,2]}', ["value", "number"]),
    (LAW + 'youngs_modulus={form=["constant"],value=1}', ["form"]),
    (LAW + 'youngs_modulus={form="constant",value=1e300}', ["1e+06 to 1e+13 Pa"]),
    (LAW + 'youngs_modulus={form="constant",value=190}', ["1e+06 to 1e+13 Pa"]),
    (LAW + 'density={form="constant",value=8.0,at_degC=5}', ["50 to 30000 kg/m³"]),
    (LAW + 'youngs_modulus={form="parabola",value=1,at_degC=5,rise=0.1,maximum_degC=5}', ["maximum_degC", "differ"]),
    (LAW + 'youngs_modulus={form="table",temperature_degC=[0,9],values=[1,2],uncertainty={values=1}}', ["[x.laws.a.youngs_modulus.uncertainty]", "values"]),
]  # fmt: skip


@pytest.mark.parametrize(("broken", "words"), BROKEN)
def test_broken_material_file_is_refused(tmp_path, broken, words):
    path = tmp_path / "mine.toml"
    path.write_text(broken)
    with pytest.raises(ShellError) as caught:
        read_materials(path)
    for word in [str(path), *words]:
        assert word in str(caught.value)


def test_constant_material_does_not_change():
    law = constant_material("m", 70e9, 0.3, 2700.0)
    assert law.elastic(250.0) == law.elastic(350.0)
    assert all(name in law.properties for name in ELASTIC[1:])


@pytest.mark.parametrize(
    ("name", "E", "nu", "percent"),
    [
        (
            "diamond",
            1143.0,
            0.0691,
            0.2,
        ),  # Klein and Cardinale 1993, Diamond Relat. Mater. 2, 918: the mean of the crystal
        ("silicon", 162.9, 0.223, 0.2),  # polycrystal, Hill: K = 97.8, G = 66.6 GPa (Simmons and Wang 1971)
        ("sapphire", 402.5, 0.234, 0.5),  # K = 251.8, G = 163.1 GPa (Simmons and Wang 1971)
    ],
)
def test_published_means_of_crystals(name, E, nu, percent):
    mean = find_material(name).elastic(298.15)
    assert pytest.approx(E, rel=percent / 100) == mean.E / 1e9
    assert pytest.approx(nu, abs=0.002) == mean.nu


def test_limits_a_crystal_without_anisotropy_is_its_own_mean_and_follows_its_constants():
    crystal = Crystal(
        "cubic", "[001]", 25.0, {"C11": 100e9, "C12": 40e9, "C44": 30e9}, dict.fromkeys(("C11", "C12", "C44"), -1e-4)
    )
    E, nu = (crystal.properties()[name] for name in ("youngs_modulus", "poisson_ratio"))
    assert crystal.spread == pytest.approx(0, abs=1e-15)
    assert E(298.15) == pytest.approx(2 * 30e9 * (1 + 40 / 140), rel=1e-12)
    assert E(308.15) / E(298.15) == pytest.approx(1 - 1e-3, rel=1e-6)
    assert nu(308.15) == pytest.approx(40 / 140, rel=1e-12)


def test_limits_voigt_and_reuss_of_a_cubic_crystal():
    """Closed forms: 5 G_V = C11 - C12 + 3 C44, G_R = 5 (C11 - C12) C44/(4 C44 + 3 (C11 - C12)), K alike."""
    a, b, c = 165.7, 63.9, 79.6
    voigt, reuss = bounds_of(Crystal("cubic", "[001]", 25.0, {"C11": a, "C12": b, "C44": c}).stiffness())
    assert voigt == pytest.approx(((a + 2 * b) / 3, (a - b + 3 * c) / 5))
    assert reuss == pytest.approx(((a + 2 * b) / 3, 5 * (a - b) * c / (4 * c + 3 * (a - b))))


def test_contract_a_modulus_without_a_law_is_constant_and_says_so():
    for name in ("ule", "zerodur", "sapphire", "ti-6al-4v"):
        assert find_material(name).constant == ("youngs_modulus",)
        assert "taken as constant" in find_material(name).caveats[0]
    assert not find_material("fused-silica").caveats
    assert "n = 2 splits" in find_material("silicon", "axis-001").caveats[0]
    assert find_material("silicon", "axis-001").rescaled(293.15, youngs_modulus=150e9).crystal is None


@pytest.mark.parametrize("lowest", [-79.8, -60.0, -45.3])
def test_a_table_holds_at_the_very_ends_of_its_range(tmp_path, lowest):
    path = tmp_path / "mine.toml"
    path.write_text(
        f'schema = "hrg.materials/1"\n[glass.laws.data]\nsource = "mine"\nrange_degC = [{lowest}, 50]\n'
        f'youngs_modulus = {{form = "table", temperature_degC = [{lowest}, 50], values = [70e9, 71e9]}}\n'
    )
    law = find_material("glass", path=path)
    np.testing.assert_allclose(law.value("youngs_modulus", np.array([law.lowest, law.highest])), [70e9, 71e9])
