"""Units that the names of keys carry: `mount_conductance_W_per_K` is in W/K."""

UNITS = {
    # end of a key: its unit
    "_deg_per_h_per_Hz": "°/h/Hz", "_deg_per_h_per_Hz2": "°/h/Hz²", "_deg_per_h_per_Hz3": "°/h/Hz³",
    "_deg_per_h_s_per_Hz": "°/h s/Hz", "_deg_per_h_s2_per_Hz2": "°/h s²/Hz²", "_deg_per_h_s3_per_Hz3": "°/h s³/Hz³",
    "_deg_per_h_s_per_Hz2": "°/h s/Hz²", "_deg_per_h_s_per_Hz3": "°/h s/Hz³", "_deg_per_h_s2_per_Hz3": "°/h s²/Hz³",
    "_deg_per_h_per_K_per_s": "°/h/(K/s)", "_deg_per_h_per_K2_per_s": "°/h/(K²/s)", "_deg_per_h_per_K": "°/h/K",
    "_deg_per_h_per_rt_h": "°/h/√h", "_deg_per_rt_h": "°/√h", "_deg_per_h": "°/h", "_Hz_per_V2": "Hz/V²",
    "_Hz_per_K2": "Hz/K²", "_Hz_per_K": "Hz/K", "_K_per_V2": "K/V²", "_kg_m3": "kg/m³", "_W_per_m_K": "W/(m K)",
    "_J_per_kg_K": "J/(kg K)", "_J_per_K": "J/K", "_W_per_K": "W/K", "_per_K2": "1/K²", "_per_K": "1/K", "_degC": "°C",
    "_GPa": "GPa", "_Pa": "Pa", "_nm": "nm", "_pm": "pm", "_mg": "mg", "_eV": "eV", "_mm": "mm", "_deg": "°", "_cm2": "cm²", "_mW": "mW", "_Hz": "Hz", "_V": "V", "_K": "K", "_s": "s",
    "expansion.value": "1/K", "expansion.slope_per_K": "1/K²", "expansion.curvature_per_K2": "1/K³",
}  # fmt: skip


def unit_of(name: str) -> str:
    """Return the unit that the last word of a dotted key carries, or "1"."""
    words = ".".join(word for word in name.split(".") if not word.isdigit())
    found = [suffix for suffix in UNITS if words.endswith(suffix)]
    return UNITS[max(found, key=len)] if found else "1"
