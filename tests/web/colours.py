"""Colours as eyes have them: contrast by WCAG 2.1, and what those without one kind of cone see of them."""

from __future__ import annotations

import math
from typing import TypeAlias

Colour: TypeAlias = "tuple[float, float, float]"
"""Red, green and blue in linear light, 0 to 1."""

Matrix: TypeAlias = "tuple[Colour, Colour, Colour]"

SEEN: dict[str, Matrix] = {
    "all cones": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "protanopia": (
        (0.152286, 1.052583, -0.204868), (0.114503, 0.786281, 0.099216), (-0.003882, -0.048116, 1.051998),
    ),
    "deuteranopia": (
        (0.367322, 0.860646, -0.227968), (0.280085, 0.672501, 0.047413), (-0.011820, 0.042940, 0.968881),
    ),
}  # fmt: skip
"""How linear light changes for each kind of eyes (Machado, Oliveira, Fernandes 2009, severity 1)."""

TO_XYZ: Matrix = ((0.4124, 0.3576, 0.1805), (0.2126, 0.7152, 0.0722), (0.0193, 0.1192, 0.9505))
WHITE = (0.9505, 1.0, 1.089)
"""sRGB's own (IEC 61966-2-1), and its white."""


def parse(text: str) -> Colour:
    """Return a colour that is written #rrggbb."""
    parts = (int(text[place : place + 2], 16) / 255 for place in (1, 3, 5))
    red, green, blue = (each / 12.92 if each <= 0.04045 else ((each + 0.055) / 1.055) ** 2.4 for each in parts)
    return red, green, blue


def _times(matrix: Matrix, colour: Colour) -> Colour:
    one, two, three = (sum(a * b for a, b in zip(row, colour)) for row in matrix)
    return one, two, three


def contrast(one: str, two: str) -> float:
    """Return the contrast of two colours, 1 to 21 (WCAG 2.1, contrast ratio)."""
    dark, light = sorted(_times(TO_XYZ, parse(each))[1] for each in (one, two))
    return (light + 0.05) / (dark + 0.05)


def _lab(colour: Colour) -> Colour:
    steps = (max(each, 0.0) / white for each, white in zip(_times(TO_XYZ, colour), WHITE))
    x, y, z = (each ** (1 / 3) if each > 0.008856 else 7.787 * each + 16 / 116 for each in steps)
    return 116 * y - 16, 500 * (x - y), 200 * (y - z)


def distance(one: str, two: str, eyes: str) -> float:
    """Return how far apart two colours are for some eyes, in CIE 1976 units; 2 is hardly to be told apart."""
    return math.dist(*(_lab(_times(SEEN[eyes], parse(each))) for each in (one, two)))
