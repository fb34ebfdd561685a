// A curve over the stages, drawn as a picture with a sentence for those who do not see it.

import { digits, el, withUnits } from "./dom";

const NS = "http://www.w3.org/2000/svg";
const [WIDTH, HEIGHT] = [300, 120];
const EDGE = { left: 46, right: 8, top: 10, bottom: 26 };

export interface Curve {
  name: string;
  units: string;
  x: number[];
  y: number[];
}

/** A part of a drawing. */
export function shape(tag: string, attributes: Record<string, string | number>, text = ""): SVGElement {
  const made = document.createElementNS(NS, tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, String(value));
  made.textContent = text;
  return made;
}

/** A curve with its axes; `mark` moves a line to a place on the stage axis. */
export class Chart {
  readonly root: HTMLElement;
  private readonly line = shape("line", { class: "now", y1: EDGE.top, y2: HEIGHT - EDGE.bottom });
  private readonly across: (x: number) => number;

  constructor(curve: Curve, across: string) {
    const [low, high] = [Math.min(...curve.x), Math.max(...curve.x)];
    const [least, most] = [Math.min(0, ...curve.y), Math.max(...curve.y, 0)];
    this.across = (x) => EDGE.left + ((x - low) / (high - low || 1)) * (WIDTH - EDGE.left - EDGE.right);
    const up = (y: number): number => HEIGHT - EDGE.bottom - ((y - least) / (most - least || 1)) * (HEIGHT - EDGE.top - EDGE.bottom);
    const end = withUnits(high, across);
    const units = curve.units === "1" ? "" : ` [${curve.units}]`;
    const said = `${curve.name}${units}: ${digits(curve.y[0])} at ${digits(low)}, ${digits(curve.y[curve.y.length - 1])} at ${end}, at most ${digits(most)}`;
    const picture = shape("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": said });
    picture.append(
      shape("line", { class: "axis", x1: EDGE.left, x2: WIDTH - EDGE.right, y1: up(0), y2: up(0) }),
      shape("line", { class: "axis", x1: EDGE.left, x2: EDGE.left, y1: EDGE.top, y2: HEIGHT - EDGE.bottom }),
      shape("text", { x: EDGE.left - 5, y: up(most) + 4, "text-anchor": "end" }, digits(most)),
      shape("text", { x: EDGE.left - 5, y: up(least) + 4, "text-anchor": "end" }, digits(least)),
      shape("text", { x: EDGE.left, y: HEIGHT - 8 }, digits(low)),
      shape("text", { x: WIDTH - EDGE.right, y: HEIGHT - 8, "text-anchor": "end" }, end),
      shape("polyline", { class: "curve", points: curve.x.map((x, i) => `${this.across(x)},${up(curve.y[i])}`).join(" ") }),
      ...curve.x.map((x, i) => shape("circle", { class: "dot", cx: this.across(x), cy: up(curve.y[i]), r: 2.4 })),
      this.line,
    );
    this.root = el("figure", { class: "chart" }, picture as unknown as Node, el("figcaption", {}, `${curve.name}${units}`));
    this.mark(low);
  }

  mark(stage: number): void {
    this.line.setAttribute("x1", String(this.across(stage)));
    this.line.setAttribute("x2", String(this.across(stage)));
  }
}
