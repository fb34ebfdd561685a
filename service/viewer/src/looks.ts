// What a solver's page adds to what the catalogue says: short words, skins, and places worth a visit.
// A solver without an entry is shown with the catalogue's own words and a neutral skin.

export interface Skin {
  /** Ridges when fresh and when dry, furrows when fresh and when dry: sRGB. */
  ridge: [string, string];
  furrow: [string, string];
  roughness: [number, number];
  /** Waxy gloss, and the bloom that makes plums look dusty. */
  coat: number;
  bloom: string;
  bloomAmount: number;
}

/** A place in a table: shares of each range (logarithmic where the slider is), 0 to 1; the stage as itself. */
export interface Place {
  name: string;
  shares: Record<string, number>;
  stage: number;
}

export interface Look {
  words: Record<string, { symbol: string; name: string }>;
  skins: Record<string, Skin>;
  places: Place[];
}

const clay: Skin = {
  ridge: ["#b8aea2", "#b8aea2"],
  furrow: ["#8d8278", "#6f655d"],
  roughness: [0.62, 0.7],
  coat: 0,
  bloom: "#ffffff",
  bloomAmount: 0,
};

const plain: Look = { words: {}, skins: { clay }, places: [] };

const looks: Record<string, Look> = {
  dehydration: {
    words: {
      s: { symbol: "s", name: "Shrinkage" },
      te: { symbol: "tₑ", name: "Skin thickness" },
      gamma: { symbol: "γ", name: "Skin stiffness" },
      rs1: { symbol: "rₛ₁", name: "Stone, along the axis" },
      rs2: { symbol: "rₛ₂", name: "Stone, across" },
      ...Object.fromEntries("₂₃₄₅₆₇₈".split("").map((d, i) => [`r${i + 2}`, { symbol: `r${d}`, name: `Radius ${i + 2}` }])),
    },
    skins: {
      jujube: {
        ridge: ["#8e3220", "#6b2115"],
        furrow: ["#6f2416", "#2a0b08"],
        roughness: [0.3, 0.46],
        coat: 0.35,
        bloom: "#ffb08a",
        bloomAmount: 0.08,
      },
      plum: {
        ridge: ["#56304f", "#3a2233"],
        furrow: ["#3d1a3c", "#120810"],
        roughness: [0.42, 0.5],
        coat: 0.2,
        bloom: "#8f9ad0",
        bloomAmount: 0.45,
      },
      raisin: {
        ridge: ["#93803a", "#50301f"],
        furrow: ["#77682c", "#1b0d09"],
        roughness: [0.36, 0.55],
        coat: 0.2,
        bloom: "#d8c8b8",
        bloomAmount: 0.22,
      },
      wolfberry: {
        ridge: ["#c4461c", "#96270f"],
        furrow: ["#c03310", "#4d0a08"],
        roughness: [0.26, 0.42],
        coat: 0.5,
        bloom: "#ffd0a0",
        bloomAmount: 0.06,
      },
      clay,
    },
    places: [
      { name: "Fresh", shares: { te: 0.5, gamma: 0.5 }, stage: 0 },
      { name: "Dimpled", shares: { te: 1, gamma: 0 }, stage: 0.12 },
      { name: "Pebbled", shares: { te: 0, gamma: 0 }, stage: 0.2 },
      { name: "Furrowed", shares: { te: 1, gamma: 1 }, stage: 0.25 },
      { name: "Dried up", shares: { te: 0, gamma: 0.68 }, stage: 0.3 },
    ],
  },
};

export const lookOf = (solver: string): Look => looks[solver] ?? plain;
