"""The words of headings in English: those of other languages, and names that are run together, become words that are known."""

import functools
import re

PRINTED = str.maketrans({"−": "-", "–": "-", "’": "'", "\u00a0": " ", "\u202f": " ", "\u2009": " "})
"""Signs of printers and word processors, and those of keyboards."""
BRACKETED = r"[\[(（]\s*([^\])）]{1,40}?)\s*[\])）]"
ENGLISH: tuple[tuple[str, str], ...] = (
    # (word, how others write it in small letters; longer ones first)
    ("time stamp", r"zeitstempel|horodat\w*|日時|时间戳"),
    ("quality factor", r"facteur (de )?qualité|factor (de )?calidad|gütefaktor|güte\b|добротност\w*|品质因数|q值"),
    ("date", r"datum\b|\bfecha|\bдата|日期|日付"),
    ("time", r"zeit|uhr|\btemps\b|\bheures?\b|tiempo|\bhora\b|\bвремя|\bчас(ы|ов)?\b|时间|時間|时刻|時刻"),
    ("elapsed", r"laufzeit|\bdauer|écoulé|transcurrid\w*|прошедш\w*"),
    ("deviation", r"abweich\w*|écart|desviaci\w*|отклонени\w*|偏差"),
    ("set point", r"sollwert|soll\b|soll(?=temp)|consigne?a?\b|уставк\w*|设定\w*|設定"),
    ("reference", r"referen[zc]i?a?\b|référence|опорн\w*|参考"),
    ("housing", r"geh(ä|ae)use|bo[iî]tier|carca[sz]a|корпус\w*|壳体|外壳|筐体"),
    ("chamber", r"kammer|\bofen\b|étuve|enceinte|c[áa]mara|камер\w*|термостат\w*|环境箱|温箱|恒温\w?"),
    ("ambient", r"umgebungs?|ambiante?\b|ambiente\b|окружа\w*|环境"),
    ("frequency", r"frequenz|fre[qkc]uen[zc]i?a?\b|fr[ée]quence|частот\w*|频率|頻率|周波数"),
    ("temperature", r"temp[ée]ratur\w*|температур\w*|\bтемп\b|温度|溫度"),
    ("bias", r"nullpunkt|d[ée]rive\b|deriva\b|\bдрейф\w*|\bуход\w*|零偏|零位|バイアス"),
    ("gyro rate", r"gyro output|陀螺输出|выход\w* гироскоп\w*"),
    ("rate", r"drehrate|vitesse|velocidad|скорост\w*|角速度|角速率"),
    ("drive amplitude", r"амплитуд\w*|振幅|幅值"),
    ("quadrature", r"quadratur\b|квадратур\w*|正交"),
    ("period", r"p[ée]r[ií]od[eo]\b|период\w*|周期"),
    ("pattern angle", r"(wave|precession) angle|\bwinkel|\bazimut\b|\bángulo|\bугол\b|角度|方位角"),
    ("inverted", r"invertiert\w*|invers[ée]e?\b|invertid[oa]|umgekehrt|инверт\w*|反向"),
)  # fmt: skip
APART = r"[_.]|(?<=[a-z])(?=[A-Z][a-z])|(?<=\bT)(?=case|hous|chamb|body|box|oven|air|amb|set)"


@functools.lru_cache
def plain(hint: str) -> str:
    """Return a name in small English letters without what stands in brackets, its words apart."""
    name = re.sub(BRACKETED, " ", hint.translate(PRINTED))
    name = re.sub(APART, " ", name).lower()
    for word, others in ENGLISH:
        name = re.sub(others, f" {word} ", name)
    return " ".join(name.split())
