// How far to trust a shape: what its answer says of itself, in words. What nobody knows is not shown.

import type { Verdict } from "../house";
import type { About } from "../service/shapes";
import { counted, digits, el, terms } from "./dom";

export function verdict(about: About): Verdict {
  if (!about.inside) {
    return { level: "poor", text: "outside the runs", why: "No runs surround this point: the shape is a guess." };
  }
  if (about.exact && about.stage.value === 0) {
    return { level: "good", text: "the fresh shape, exact", why: "It follows from the parameters alone." };
  }
  if (about.tier === "relaxed") {
    return { level: "good", text: "relaxed until forces balance", why: "The solver settled what the table gave: an equilibrium, near the looked-up one." };
  }
  if (about.exact) {
    return about.converged
      ? { level: "good", text: "a stored run", why: "Computed, not interpolated." }
      : { level: "fair", text: "a stored run, still settling", why: "Computed, but a stage had not come to rest." };
  }
  if (about.expected_error) {
    const error = about.expected_error.rgh;
    const level = error < 0.05 ? "good" : error < 0.2 ? "fair" : "poor";
    const why = "Of the roughness, measured by leaving runs out of the table: how deep the wrinkles are, not where.";
    return { level, text: `expected error ${percent(error)}`, why };
  }
  const level = (about.nearest ?? 0) > 0.5 ? "poor" : "fair";
  const text = level === "poor" ? "interpolated, far from any run" : "interpolated, near a run";
  return { level, text, why: "Between stored runs; 0 is on a run, 1 a whole range away from it." };
}

const short = (value: number): string => digits(Number(value.toPrecision(2)));
const percent = (share: number): string => `${short(100 * share)} %`;

/** Share of the wrinkles' height from which on a mesh holds them. */
const ALL_HELD = 0.995;

/** Errors by measure, in words and their own units; docs/service.md says what they are. */
const MEASURES: Record<string, [string, (value: number) => string]> = {
  rgh: ["Roughness, off by", percent],
  dB: ["Wave powers, off by", (value) => `${short(value)} dB`],
  W1: ["Slopes, off by", (value) => `${short(value)}°`],
  corr: ["Pattern, off by", percent],
};

/** How an answer came about, in words. */
export const tierOf = (about: About): string =>
  ({ table: `looked up, ${about.method}`, relaxed: "relaxed by the solver", run: "run by the solver" })[about.tier] ?? about.tier;

export function showTrust(root: HTMLElement, about: About, speed: string): void {
  const rows: [string, string | Node][] = about.nearest == null ? [] : [["Nearest run", digits(about.nearest)]];
  rows.push(["Between runs", about.inside ? "yes" : "no"]);
  for (const [name, [word, say]] of Object.entries(MEASURES)) {
    const value = about.expected_error?.[name];
    if (value !== undefined) rows.push([word, say(value)]);
  }
  if (about.held != null && about.held < ALL_HELD) rows.push(["Wrinkles that this mesh holds", `at least ${percent(about.held)}`]);
  rows.push(["Looked up by", about.method]);
  rows.push(["Settled", about.converged ? "yes" : "not every stage it is made of"]);
  rows.push(["Made of", bars(about.weights)]);
  rows.push(["Answered in", speed]);
  root.replaceChildren(terms(rows));
}

/** One bar per stored run, as long as its weight. */
function bars(weights: Record<string, number>): HTMLElement {
  const own = Object.entries(weights).filter(([, weight]) => weight > 1e-4);
  const text = counted(own.length);
  const row = el("span", { class: "weights" });
  for (const [key, weight] of own) {
    const bar = el("i", { title: `${percent(weight)} of run ${key.slice(0, 8)}` });
    bar.style.setProperty("--weight", String(weight));
    row.append(bar);
  }
  return el("span", { class: "made" }, row, text);
}

export function showFacts(root: HTMLElement, about: About): void {
  const rows = Object.values(about.descriptors).map(({ value, units, long_name }): [string, string] => [
    long_name,
    units === "1" ? digits(value) : `${digits(value)} ${units}`,
  ]);
  // what is measured on the mesh that is shown comes first
  if (about.crossings != null) rows.unshift(["pairs of this mesh's triangles that cross", digits(about.crossings)]);
  if (about.volume != null) rows.unshift(["volume inside this mesh, in units of r1^3", digits(about.volume)]);
  root.replaceChildren(terms(rows));
}
