// What all rooms share: the table in the studio, the caption below the shape, the panel, complaints, the address bar.

import { button, byId, el } from "./parts/dom";
import { Problem } from "./service/http";
import { prefer } from "./view/means";
import { Studio, type Subject } from "./view/studio";

export type Words = Record<string, string>;
/** A room opens in the house and returns what closes it. */
export type Room = (house: House, words: Words) => Promise<() => void>;

/** How far to trust what is shown, in a few words. */
export interface Verdict {
  level: "good" | "fair" | "poor";
  text: string;
  why: string;
}

export class House {
  readonly canvas = byId<HTMLCanvasElement>("view");
  readonly panel = byId("panel");
  readonly wall = byId("wall");
  private readonly what = el("p", { class: "what" });
  private readonly badge = el("p", { class: "badge" });
  private readonly tier = el("p", { class: "tier" });
  private readonly beside = byId("beside");
  private readonly tools = byId("tools");
  private readonly problem = byId("problem");
  private readonly compare: HTMLButtonElement;
  private made: Studio | undefined;
  private said = "";
  private compared = false;

  constructor() {
    this.compare = button("Compare", () => this.pin(!this.compared), { "aria-pressed": "false", title: "Keep this shape on the left, and go on changing on the right" });
    byId("caption").replaceChildren(this.what, this.badge, this.tier);
    this.tools.append(this.compare, button("Reset view", () => this.studio.home()));
  }

  /** The studio, built when a room first draws. */
  get studio(): Studio {
    if (!this.made) {
      this.made = new Studio(this.canvas);
      if (this.made.byProcessor) this.offerLook(this.made);
    }
    return this.made;
  }

  /** Where no graphics card draws, beauty or speed is for the user to choose. */
  private offerLook(studio: Studio): void {
    const title = "No graphics card draws here. Soft light, shadows and pores take seconds for each picture; without them it follows your hand";
    const choice = button("Full look", () => {
      studio.look = studio.look === "full" ? "plain" : "full";
      prefer(studio.look);
      pressed();
    }, { title });
    const pressed = (): void => choice.setAttribute("aria-pressed", String(studio.look === "full"));
    pressed();
    this.tools.prepend(choice);
  }

  stand(subject: Subject | undefined): void {
    this.studio.stand(subject);
    this.compare.disabled = !subject && !this.compared;
  }

  /** Say what is shown, how it came about and how far to trust it. */
  say(title: string, tier: string, verdict: Verdict | undefined): void {
    this.said = [title, tier].filter(Boolean).join(" · ");
    this.what.textContent = title;
    this.tier.textContent = tier;
    this.badge.className = `badge ${verdict?.level ?? ""}`;
    this.badge.textContent = verdict?.text ?? "";
    this.badge.title = verdict?.why ?? "";
    this.badge.hidden = !verdict;
  }

  complain(error: unknown): void {
    if (error instanceof DOMException && error.name === "AbortError") return;
    const own = error instanceof Problem;
    const detail = own ? error.detail : "This page met an error that it did not foresee.";
    this.problem.replaceChildren(el("strong", {}, detail), " ", own ? error.advice : String(error));
    this.problem.hidden = false;
  }

  content(): void {
    this.problem.hidden = true;
  }

  /** Empty, for the next room. */
  clear(): void {
    this.content();
    this.panel.replaceChildren();
    this.panel.scrollTop = 0;
    this.wall.replaceChildren();
    this.wall.hidden = true;
    document.body.classList.remove("walled");
    this.say("", "", undefined);
    this.canvas.removeAttribute("data-shown");
    if (this.made) {
      this.made.picked = this.made.stroke = undefined;
      this.canvas.classList.remove("aiming");
      this.stand(undefined);
    }
  }

  /** Cover the studio with something else, such as a gallery. */
  cover(...children: Node[]): void {
    this.wall.replaceChildren(...children);
    this.wall.hidden = false;
    document.body.classList.add("walled");
  }

  private pin(on: boolean): void {
    this.compared = on;
    this.studio.pin(on);
    this.compare.setAttribute("aria-pressed", String(on));
    this.compare.textContent = on ? "Stop comparing" : "Compare";
    this.beside.hidden = !on;
    this.beside.textContent = on ? this.said : "";
  }
}

export function fromHash(): Words {
  return Object.fromEntries(new URLSearchParams(location.hash.slice(1)));
}

/** How long the address bar waits for a hand that still moves [ms]: browsers ask for the icon anew with every change. */
const CALM = 250;
let [coming, last]: [Words | undefined, number] = [undefined, 0];
let timer = 0;

/** Let the address bar say where the page stands, without a step in its history: at once, or when the hand rests. */
export function keep(words: Words): void {
  coming = words;
  clearTimeout(timer);
  const since = performance.now() - last;
  if (since > CALM) kept();
  else timer = window.setTimeout(kept, CALM - since);
}

/** Write what waits to be written. */
export function kept(): void {
  if (coming) history.replaceState(null, "", `#${new URLSearchParams(coming)}`);
  [coming, last] = [undefined, performance.now()];
}

// another room was gone to: what the last one would have said is past
addEventListener("hashchange", () => {
  clearTimeout(timer);
  coming = undefined;
});
