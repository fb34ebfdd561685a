// What changes along an axis: points that are dragged, moved by keys or written as numbers, a curve for each quantity.

import type { Schema } from "../service/solvers";
import { shape } from "./chart";
import { digits, el, withUnits } from "./dom";

export type Point = Record<string, number>;

const [WIDTH, HEIGHT] = [300, 104];
const EDGE = { left: 46, right: 12, top: 10, bottom: 22 };
const BOX = { across: WIDTH - EDGE.left - EDGE.right, up: HEIGHT - EDGE.top - EDGE.bottom };
/** Share of the range that one press of a key moves a point. */
const STEP = 0.01;
/** How far the axis reaches at least, over its longest way. */
const SHORT = 0.1;

interface Quantity {
  name: string;
  units: string;
  low: number;
  high: number;
}

const quantity = (name: string, schema: Schema): Quantity => ({
  name,
  units: schema.units ?? "",
  low: schema.minimum ?? 0,
  high: schema.maximum ?? 1,
});

const worded = (name: string): string => name.charAt(0).toUpperCase() + name.slice(1).replace(/_/g, " ");
const clamp = (value: number, low: number, high: number): number => Math.min(high, Math.max(low, value));
const rounded = (value: number): number => Number(value.toPrecision(3));

/** A new point between or behind others: what the curves say there. */
export function between(points: Point[], along: string, x: number, start: Point): Point {
  const after = points.findIndex((one) => one[along] > x);
  if (!points.length) return { ...start, [along]: x };
  if (after === 0) return { ...points[0], [along]: x };
  const a = points[after < 0 ? points.length - 1 : after - 1];
  if (after < 0) return { ...a, [along]: x };
  const b = points[after];
  const share = (x - a[along]) / (b[along] - a[along]);
  return { ...Object.fromEntries(Object.keys(a).map((name) => [name, rounded(a[name] + share * (b[name] - a[name]))])), [along]: x };
}

/** Curves over one axis that share their points. `moved` is told when a point was let go. */
export class Course {
  readonly root = el("div", { class: "course" });
  private points: Point[] = [];
  private readonly axis: Quantity;
  private readonly curves: Quantity[];

  constructor(
    item: Schema,
    private readonly along: string,
    private readonly start: () => Point,
    private readonly moved: (points: Point[]) => void,
  ) {
    const properties = item.properties ?? {};
    this.axis = quantity(along, properties[along]);
    this.curves = Object.entries(properties)
      .filter(([name]) => name !== along)
      .map(([name, schema]) => quantity(name, schema));
    this.draw();
  }

  show(points: Point[]): void {
    this.points = points.map((one) => ({ ...one }));
    this.draw();
  }

  private get reach(): number {
    const { low, high } = this.axis;
    const last = this.points.length ? this.points[this.points.length - 1][this.along] : low;
    return Math.min(high, Math.max(low + SHORT * (high - low), low + 1.25 * (last - low)));
  }

  private draw(): void {
    this.root.replaceChildren(...this.curves.map((curve) => this.figure(curve)));
  }

  private figure(curve: Quantity): HTMLElement {
    const end = this.reach;
    const { low } = this.axis;
    const across = (x: number): number => EDGE.left + ((x - low) / (end - low)) * BOX.across;
    const up = (y: number): number => HEIGHT - EDGE.bottom - ((y - curve.low) / (curve.high - curve.low)) * BOX.up;
    const said = this.points.map((one) => `${withUnits(one[curve.name], curve.units)} at ${withUnits(one[this.along], this.axis.units)}`).join(", ");
    const picture = shape("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "group", "aria-label": `${worded(curve.name)}: ${said || "the same all the time"}` }) as SVGSVGElement;
    const field = shape("rect", { class: "field-of", x: EDGE.left, y: EDGE.top, width: BOX.across, height: BOX.up });
    const flat = this.points.length ? this.points : [this.start()];
    const line = [{ ...flat[0], [this.along]: low }, ...(this.points.length ? this.points : []), { ...flat[flat.length - 1], [this.along]: end }];
    const path = shape("polyline", { class: "curve", points: line.map((one) => `${across(one[this.along])},${up(one[curve.name])}`).join(" ") });
    picture.append(
      field,
      shape("text", { x: EDGE.left - 5, y: up(curve.high) + 4, "text-anchor": "end" }, digits(curve.high)),
      shape("text", { x: EDGE.left - 5, y: up(curve.low) + 4, "text-anchor": "end" }, digits(curve.low)),
      shape("text", { x: EDGE.left, y: HEIGHT - 6 }, digits(low)),
      shape("text", { x: WIDTH - EDGE.right, y: HEIGHT - 6, "text-anchor": "end" }, withUnits(rounded(end), this.axis.units)),
      path,
    );
    const place = (event: PointerEvent): { x: number; y: number } => {
      const box = picture.getBoundingClientRect();
      const [px, py] = [((event.clientX - box.left) * WIDTH) / box.width, ((event.clientY - box.top) * HEIGHT) / box.height];
      const x = clamp(low + ((px - EDGE.left) / BOX.across) * (end - low), low, this.axis.high);
      const y = clamp(curve.low + ((HEIGHT - EDGE.bottom - py) / BOX.up) * (curve.high - curve.low), curve.low, curve.high);
      return { x: rounded(x), y: rounded(y) };
    };
    field.addEventListener("click", (event) => {
      const { x, y } = place(event as PointerEvent);
      this.add({ ...between(this.points, this.along, x, this.start()), [curve.name]: y });
    });
    for (const [i] of this.points.entries()) picture.append(this.handle(curve, i, across, up, place));
    const units = curve.units && curve.units !== "1" ? ` [${curve.units}]` : "";
    return el("figure", { class: "chart" }, picture as unknown as Node, el("figcaption", {}, `${worded(curve.name)}${units}`));
  }

  /** A point that can be taken by hand or by keys. */
  private handle(curve: Quantity, i: number, across: (x: number) => number, up: (y: number) => number, place: (event: PointerEvent) => { x: number; y: number }): SVGElement {
    const one = this.points[i];
    const dot = shape("circle", {
      class: "handle",
      cx: across(one[this.along]),
      cy: up(one[curve.name]),
      r: 5,
      tabindex: 0,
      role: "slider",
      "aria-label": `${worded(curve.name)}, point ${i + 1}`,
      "aria-valuemin": curve.low,
      "aria-valuemax": curve.high,
      "aria-valuenow": one[curve.name],
      "aria-valuetext": `${withUnits(one[curve.name], curve.units)} at ${withUnits(one[this.along], this.axis.units)}`,
    });
    dot.addEventListener("pointerdown", (event) => {
      event.preventDefault();
      const move = (at: Event): void => {
        const { x, y } = place(at as PointerEvent);
        this.put(i, curve.name, x, y);
        dot.setAttribute("cx", String(across(this.points[i][this.along])));
        dot.setAttribute("cy", String(up(this.points[i][curve.name])));
      };
      const end = (): void => {
        window.removeEventListener("pointermove", move);
        this.settled(curve.name, i);
      };
      window.addEventListener("pointermove", move);
      window.addEventListener("pointerup", end, { once: true });
    });
    dot.addEventListener("keydown", (event) => {
      const { key } = event as KeyboardEvent;
      const [dx, dy] = ({ ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] } as Record<string, number[]>)[key] ?? [0, 0];
      if (key === "Delete" || key === "Backspace") this.points.splice(i, 1);
      else if (dx || dy) {
        const [wide, tall] = [this.reach - this.axis.low, curve.high - curve.low];
        this.put(i, curve.name, rounded(this.points[i][this.along] + dx * STEP * wide), rounded(this.points[i][curve.name] + dy * STEP * tall));
      } else return;
      event.preventDefault();
      this.settled(curve.name, Math.min(i, this.points.length - 1));
    });
    return dot;
  }

  /** Points keep their order: none passes its neighbours. */
  private put(i: number, name: string, x: number, y: number): void {
    const [before, after] = [this.points[i - 1]?.[this.along], this.points[i + 1]?.[this.along]];
    const gap = 1e-3 * (this.axis.high - this.axis.low);
    const { low, high } = this.curves.find((one) => one.name === name) as Quantity;
    const at = clamp(x, before === undefined ? this.axis.low : before + gap, after === undefined ? this.axis.high : after - gap);
    this.points[i] = { ...this.points[i], [this.along]: Number(at.toPrecision(6)), [name]: clamp(y, low, high) };
  }

  private add(point: Point): void {
    if (this.points.some((one) => one[this.along] === point[this.along])) return;
    this.points = [...this.points, point].sort((a, b) => a[this.along] - b[this.along]);
    this.settled();
  }

  private settled(name?: string, i = -1): void {
    this.draw();
    this.moved(this.points.map((one) => ({ ...one })));
    if (name && i >= 0) (this.root.querySelectorAll("svg")[this.curves.findIndex((one) => one.name === name)].querySelectorAll(".handle")[i] as SVGElement).focus();
  }
}
