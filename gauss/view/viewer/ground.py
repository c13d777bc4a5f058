"""Light and dark ground: colours of the sky and of the floor, in front of which white and black bodies stay visible."""

from typing import NamedTuple

import numpy as np


class Ground(NamedTuple):
    """Colours behind and under a mechanism."""

    top: tuple[int, int, int]  # top, bottom: red, green, blue of the sky from 0 to 255, at its top and its bottom
    bottom: tuple[int, int, int]
    cell: tuple[int, int, int]  # cell, section: lines of the floor
    section: tuple[int, int, int]
    shadow: float  # opacity of shadows on the floor
    dark: bool  # whether controls are light on dark


LIGHT = Ground((168, 184, 204), (222, 227, 233), (198, 205, 214), (164, 174, 188), 0.3, False)  # white bodies are brighter
DARK = Ground((16, 20, 27), (44, 50, 60), (66, 73, 84), (94, 103, 117), 0.5, True)


def ground(dark: bool) -> Ground:
    """Light or dark ground."""
    return DARK if dark else LIGHT


def sky(colours: Ground) -> np.ndarray:
    """Background from top to bottom, shape (256, 8, 3)."""
    share = np.linspace(0.0, 1.0, 256)[:, None, None]
    shades = (1 - share) * np.array(colours.top) + share * np.array(colours.bottom)
    return np.broadcast_to(shades, (256, 8, 3)).astype(np.uint8)
