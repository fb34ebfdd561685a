// Where the page stands: a table, a point on its axes with the stage, a skin. The address bar carries it along.

import type { Point, Table } from "../service/shapes";
import type { Solver, Values } from "../service/solvers";

export interface Scale {
  name: string;
  lowest: number;
  highest: number;
  units: string;
  description: string;
  /** Ratios matter, not differences: the slider runs over the logarithm. */
  logarithmic: boolean;
  /** Where stored results lie, if the table says so. */
  marks: number[];
}

export function scales(table: Table): Scale[] {
  const axes = Object.entries(table.axes).map(([name, axis]) => ({
    ...axis,
    name,
    logarithmic: axis.lowest > 0 && axis.highest / axis.lowest > 3,
    marks: [],
  }));
  const { symbol, long_name, stored, ...stage } = table.stage;
  return [{ ...stage, name: symbol, description: long_name, logarithmic: false, marks: stored }, ...axes];
}

export function at(scale: Scale, share: number): number {
  const { lowest: a, highest: b } = scale;
  if (share <= 0) return a;
  if (share >= 1) return b;
  return scale.logarithmic ? a * (b / a) ** share : a + (b - a) * share;
}

export function shareOf(scale: Scale, value: number): number {
  const { lowest: a, highest: b } = scale;
  if (a === b) return 0;
  const share = scale.logarithmic ? Math.log(value / a) / Math.log(b / a) : (value - a) / (b - a);
  return Math.min(1, Math.max(0, share));
}

export const clamp = (scale: Scale, value: number): number => Math.min(scale.highest, Math.max(scale.lowest, value));

/** Solver presets that this table can show: all that it holds fixed agrees and all else is on its axes. */
export function presetsIn(table: Table, solver: Solver): Record<string, Point> {
  const found: Record<string, Point> = {};
  for (const [name, preset] of Object.entries(solver.presets)) {
    const point: Point = {};
    let fits = true;
    for (const [axis, value] of Object.entries(flat(preset, solver))) {
      const range = table.axes[axis];
      if (range) {
        point[axis] = value;
        fits &&= value >= range.lowest && value <= range.highest;
      } else if (axis in table.fixed) {
        fits &&= Math.abs(Number(table.fixed[axis]) - value) < 1e-9;
      }
    }
    if (fits) found[name] = point;
  }
  return found;
}

/** A preset in the words of the query axes; a list may have more entries than axes, the first ones being fixed. */
function flat(preset: Values, solver: Solver): Point {
  const out: Point = {};
  for (const [field, value] of Object.entries(preset)) {
    const axes = solver.params.properties[field]?.axes ?? [];
    const values = (Array.isArray(value) ? value : [value]) as number[];
    axes.forEach((axis, i) => (out[axis] = values[values.length - axes.length + i]));
  }
  return out;
}
