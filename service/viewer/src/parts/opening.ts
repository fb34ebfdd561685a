// What of a result is asked for besides its surface: a cut through it, and what grows on it.

import type { Look } from "../view/looks";
import { el, select } from "./dom";

/** The half that goes, by its name: the normal to it. */
const HALVES: Record<string, [string, number[]]> = {
  front: ["front half away", [0, 0, 1]],
  right: ["right half away", [1, 0, 0]],
  top: ["upper half away", [0, 1, 0]],
};
/** How far from the middle a cut may be, over r1, and how fine it moves. */
const [FAR, STEP] = [0.6, 0.05];
/** As many threads as a page draws without a jerk. */
const THREADS = 6000;

export class Opening {
  readonly root = el("div");
  private readonly depth = el("input", { type: "range", id: "cut-depth", min: String(-FAR), max: String(FAR), step: String(STEP), value: "0" });
  private readonly deep = el("div", { class: "slider" }, el("label", { for: "cut-depth" }, "Where, off the middle [r1]"), el("div", { class: "track" }, this.depth));
  private readonly hairy = el("input", { type: "checkbox", id: "threads" });
  private half = "";

  constructor(look: Look, changed: () => void) {
    if (look.opens) {
      const halves = Object.entries(HALVES).map(([name, [text]]): [string, string] => [name, text]);
      const chosen = (half: string): void => {
        this.half = half;
        this.deep.hidden = !half;
        changed();
      };
      this.root.append(select("Cut open", "cut", [["", "whole"], ...halves], "", chosen), this.deep);
    }
    if (look.grows) this.root.append(el("div", { class: "entry check" }, this.hairy, el("label", { for: "threads" }, "Threads of mould")));
    this.deep.hidden = true;
    this.said();
    this.depth.addEventListener("input", () => this.said());
    this.depth.addEventListener("change", changed);
    this.hairy.addEventListener("change", changed);
  }

  private said(): void {
    this.depth.setAttribute("aria-valuetext", `${this.depth.value} r1`);
    this.depth.style.setProperty("--share", String((Number(this.depth.value) + FAR) / (2 * FAR)));
  }

  /** What the service is asked beside the stage; nothing where the whole surface is. */
  get query(): Record<string, string> {
    const found: Record<string, string> = this.hairy.checked ? { threads: String(THREADS) } : {};
    const normal = HALVES[this.half]?.[1];
    if (normal) found.cut = [...normal.map((x) => x * Number(this.depth.value)), ...normal].map((x) => Number(x.toFixed(3))).join(",");
    return found;
  }
}
