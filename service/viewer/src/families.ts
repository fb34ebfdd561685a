// What can be asked for, family by family, each with its picture: the way from one table to another.

import type { Family } from "./api";
import { el } from "./dom";

/** Words for a family's name: "jujube1" is "jujube 1". */
const worded = (name: string): string => name.replace(/([a-z])(\d)/g, "$1 $2").replace(/[-_]/g, " ");

export function familyChoice(all: Family[], current: string, chosen: (family: Family) => void): HTMLElement {
  const row = el("div", { class: "families", role: "group", "aria-label": "Family" });
  for (const family of all) {
    const picture = el("img", { src: family.links.thumbnail.replace(/^\//, ""), alt: "", width: "72", height: "72", loading: "lazy" });
    const made = el("button", { type: "button", "aria-pressed": String(family.name === current), "data-family": family.name });
    made.title = `${family.samples} runs over ${Object.keys(family.axes).join(" and ")}, ${family.quality ?? "unknown"} quality`;
    made.append(picture, el("span", {}, worded(family.name)));
    made.addEventListener("click", () => chosen(family));
    row.append(made);
  }
  return el("div", { class: "choice" }, el("h2", {}, "Family"), row);
}

/** The family that a preset in the address bar means. */
export const familyOf = (all: Family[], preset: string | undefined): Family | undefined =>
  preset === undefined ? undefined : all.find((family) => family.presets.includes(preset));
