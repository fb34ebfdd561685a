// What can be asked for, family by family, each with its picture: the way from one table to another.

import { relative } from "../service/http";
import type { Family } from "../service/shapes";
import { counted, el, worded } from "./dom";

/** Words for a family: the table that is there by default is named by its preset. */
export const titled = (family: Family): string =>
  worded((family.name === "default" ? (family.presets[0] ?? family.name) : family.name).replace(/-\d+$/, ""));

/** The axes of a family with their ends, "te 0.03 to 0.04", after what it holds fixed that others of its title do not. */
export function ranges(family: Family, all: Family[]): string[] {
  const others = all.filter((one) => one !== family && titled(one) === titled(family));
  const own = [...new Set(others.flatMap((one) => Object.keys({ ...one.axes, ...one.fixed })))].filter(
    (name) => name in family.fixed && others.some((one) => name in one.axes || one.fixed[name] !== family.fixed[name]),
  );
  return [
    ...own.map((name) => `${name} ${String(family.fixed[name])}`),
    ...Object.entries(family.axes)
      .filter(([, axis]) => axis.values.length > 1)
      .map(([name, { values }]) => `${name} ${Math.min(...values)}\u2013${Math.max(...values)}`),
  ];
}

export function familyChoice(all: Family[], current: string, chosen: (family: Family) => void): HTMLElement {
  const row = el("div", { class: "families", role: "group", "aria-label": "Family" });
  for (const family of all) {
    const picture = el("img", { src: relative(family.links.thumbnail), alt: "", width: "72", height: "72", loading: "lazy" });
    const made = el("button", { type: "button", "aria-pressed": String(family.name === current), "data-family": family.name });
    const over = ranges(family, all);
    const held = over.length ? `${counted(family.samples)} over ${over.join(" and ")}` : counted(family.samples);
    made.title = `${family.name}: ${held}, ${family.quality ?? "unknown"} quality`;
    made.append(picture, el("span", {}, titled(family)), el("small", {}, over.join(", ") || counted(family.samples)));
    made.addEventListener("click", () => chosen(family));
    row.append(made);
  }
  return el("div", { class: "choice" }, el("h2", {}, "Family"), row);
}

/** The family that a preset in the address bar means. */
export const familyOf = (all: Family[], preset: string | undefined): Family | undefined =>
  preset === undefined ? undefined : all.find((family) => family.presets.includes(preset));
