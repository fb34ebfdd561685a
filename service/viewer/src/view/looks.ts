// What a solver's page adds to its numbers, as the catalogue says it: short words, skins, and places worth a visit.
// A solver that says nothing is shown with the names of its axes and a neutral skin.

export interface Skin {
  /** Ridges when fresh and at the last stage, furrows likewise: sRGB. */
  ridge: [string, string];
  furrow: [string, string];
  roughness: [number, number];
  /** Waxy gloss, and the bloom that makes a surface look dusty. */
  coat: number;
  bloom: string;
  bloom_amount: number;
}

/** A place in a table: shares of each range (logarithmic where the slider is), 0 to 1; the stage as itself. */
export interface Place {
  shares: Record<string, number>;
  stage: number;
}

export interface Look {
  /** Fields that make its colours. */
  layers: string[];
  /** Whether something is known of the inside, and whether threads grow on it. */
  opens: boolean;
  grows: boolean;
  labels: Record<string, { symbol: string; name: string }>;
  /** The word for going along the stage axis. */
  advance: string;
  shades: Record<string, Skin>;
  places: Record<string, Place>;
}

const neutral: Skin = {
  ridge: ["#b8aea2", "#b8aea2"],
  furrow: ["#8d8278", "#6f655d"],
  roughness: [0.62, 0.7],
  coat: 0,
  bloom: "#ffffff",
  bloom_amount: 0,
};

/** A look with at least one skin. */
export const dressed = (look: Look): Look => (Object.keys(look.shades).length ? look : { ...look, shades: { plain: neutral } });
