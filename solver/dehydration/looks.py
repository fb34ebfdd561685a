"""Skins of dried fruits, short words for their parameters, and places of a buckling map worth a visit."""

from __future__ import annotations

from ..contract import Label, Looks, Place, Shade

__all__ = ["LOOKS"]

_SHADES = {
    "jujube": Shade(("#8e3220", "#6b2115"), ("#6f2416", "#2a0b08"), (0.3, 0.46), 0.35, "#ffb08a", 0.08),
    "plum": Shade(("#56304f", "#3a2233"), ("#3d1a3c", "#120810"), (0.42, 0.5), 0.2, "#8f9ad0", 0.45),
    "raisin": Shade(("#93803a", "#452418"), ("#77682c", "#1d0e0a"), (0.36, 0.42), 0.45, "#d8c8b8", 0.08),
    "wolfberry": Shade(("#c4461c", "#96270f"), ("#c03310", "#4d0a08"), (0.26, 0.42), 0.5, "#ffd0a0", 0.06),
    "potato": Shade(("#b08d57", "#8a6a3f"), ("#8c6c3e", "#4f3a20"), (0.75, 0.85)),
    "banana": Shade(("#d9b02a", "#3b2614"), ("#b98a1c", "#1c110a"), (0.45, 0.6), 0.1),
    "passionfruit": Shade(("#4a1f3c", "#3a1a2c"), ("#321228", "#160a12"), (0.34, 0.5), 0.3),
    "date": Shade(("#a8641f", "#4a2512"), ("#8a4a14", "#1f0e07"), (0.32, 0.4), 0.45, "#e0b080", 0.08),
    "pea": Shade(("#6f9a2c", "#9aa352"), ("#4f7a1c", "#5f6a2a"), (0.45, 0.7)),
    "clay": Shade(("#b8aea2", "#b8aea2"), ("#8d8278", "#6f655d"), (0.62, 0.7)),
}

LOOKS = Looks(
    labels={
        "s": Label("s", "Shrinkage"),
        "te": Label("tₑ", "Skin thickness"),
        "gamma": Label("γ", "Skin stiffness"),
        "rs1": Label("rₛ₁", "Stone, along the axis"),
        "rs2": Label("rₛ₂", "Stone, across"),
        **{f"r{i}": Label("r" + "₂₃₄₅₆₇₈"[i - 2], f"Radius {i}") for i in range(2, 9)},
    },
    advance="Dry",
    shades=_SHADES,
    places={
        "Fresh": Place({"te": 0.5, "gamma": 0.5}, 0.0),
        "Dimpled": Place({"te": 1.0, "gamma": 0.0}, 0.12),
        "Pebbled": Place({"te": 0.0, "gamma": 0.0}, 0.2),
        "Furrowed": Place({"te": 1.0, "gamma": 1.0}, 0.25),
        "Dried up": Place({"te": 0.0, "gamma": 0.68}, 0.3),
    },
)
