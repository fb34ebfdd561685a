// Sliders for a table's axes and its stage: symbol, units and ranges are the catalogue's.

import { button, digits, el, withUnits } from "./dom";
import type { Look } from "../view/looks";
import { at, clamp, shareOf, type Scale } from "./state";

const STEPS = 400;

export class Slider {
  readonly root: HTMLElement;
  private readonly range: HTMLInputElement;
  private readonly number: HTMLInputElement;

  constructor(
    readonly scale: Scale,
    look: Look,
    changed: (value: number) => void,
    refused: (said: string) => void,
  ) {
    const word = look.labels[scale.name] ?? { symbol: scale.name, name: scale.name };
    const id = `axis-${scale.name}`;
    const about = `${scale.description}${scale.units === "1" ? "" : ` [${scale.units}]`}`;
    this.range = el("input", { type: "range", id, min: "0", max: String(STEPS), step: "1", title: about });
    this.number = el("input", {
      type: "number",
      min: String(scale.lowest),
      max: String(scale.highest),
      step: "any",
      "aria-label": `${word.name}, exactly`,
    });
    const marks = el("div", { class: "marks", "aria-hidden": "true" });
    for (const mark of scale.marks) {
      const tick = el("i");
      tick.style.setProperty("--at", String(shareOf(scale, mark)));
      marks.append(tick);
    }
    const units = scale.units === "1" ? undefined : el("span", { class: "units" }, scale.units);
    this.root = el(
      "div",
      { class: "slider" },
      el("label", { for: id, title: about }, `${word.name} `, el("var", {}, word.symbol)),
      el("span", { class: "value" }, this.number, units),
      el("div", { class: "track" }, this.range, marks),
      el("div", { class: "ends", "aria-hidden": "true" }, el("span", {}, digits(scale.lowest)), el("span", {}, digits(scale.highest))),
    );
    this.range.addEventListener("input", () => {
      const value = at(scale, Number(this.range.value) / STEPS);
      this.set(value);
      changed(value);
    });
    this.number.addEventListener("change", () => {
      const given = this.number.valueAsNumber;
      const value = Number.isFinite(given) ? clamp(scale, given) : at(scale, Number(this.range.value) / STEPS);
      this.set(value);
      changed(value);
      const range = `${digits(scale.lowest)} to ${withUnits(scale.highest, scale.units)}`;
      if (Number.isFinite(given) && value !== given) refused(`${word.name}: ${digits(given)} is out of range, this table holds ${range}.`);
    });
  }

  set(value: number): void {
    const share = shareOf(this.scale, value);
    this.range.value = String(Math.round(share * STEPS));
    this.range.style.setProperty("--share", String(share));
    this.range.setAttribute("aria-valuetext", withUnits(value, this.scale.units));
    this.number.value = digits(value);
  }
}

/** A row of buttons of which one may be pressed. */
export class Choice {
  readonly root: HTMLElement;
  private readonly buttons = new Map<string, HTMLButtonElement>();

  constructor(label: string, names: string[], chosen: (name: string) => void, dress?: (name: string, button: HTMLButtonElement) => void) {
    const row = el("div", { class: "row", role: "group", "aria-label": label });
    for (const name of names) {
      const made = button(name, () => chosen(name), { "aria-pressed": "false" });
      dress?.(name, made);
      this.buttons.set(name, made);
      row.append(made);
    }
    this.root = el("div", { class: "choice" }, el("h2", {}, label), row);
  }

  mark(name: string | undefined): void {
    for (const [own, made] of this.buttons) made.setAttribute("aria-pressed", String(own === name));
  }
}
