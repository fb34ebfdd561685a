// What a result tells over its stages: its numbers, the lengths of its vectors, and forces out of impulses.

import { numbers, type Job, type Numbers } from "../service/jobs";
import type { Solver } from "../service/solvers";
import type { Curve } from "./chart";

/** How the run went, which is no property of the shape. */
const ABOUT = ["stage", "converged", "residual", "iterations", "seconds", "vertex_count", "face_count"];
const MOST = 64; // numbers per stage that still make curves
const LOADS = ["N", "N s", "N m", "N m s"]; // what is worth a curve even where a stage has several

type Field = Numbers["fields"][string];

const lengths = (values: unknown): number[] =>
  typeof values === "number"
    ? [values]
    : (values as unknown[]).every((one) => typeof one === "number")
      ? [Math.hypot(...(values as number[]))]
      : (values as unknown[]).flatMap(lengths);

/** The curves of a field: one of numbers, one for each vector. */
function own(field: Field, name: string, x: number[]): Curve[] {
  const byStage = field.values.map((one) => (field.dims.length === 1 ? [Number(one)] : lengths(one)));
  return (byStage[0] ?? []).map((_, i) => ({
    name: field.long_name || name,
    units: field.units,
    x,
    y: byStage.map((row) => row[i]),
  }));
}

/** Mean forces up to each stage, since the one before it, where a curve is of impulses since the start [N s] over seconds. */
function forces(curve: Curve, stageUnits: string): Curve[] {
  if (curve.units !== "N s" || stageUnits !== "s") return [];
  const [x, y] = [[0, ...curve.x.filter((at) => at > 0)], [0, ...curve.y.filter((_, i) => curve.x[i] > 0)]];
  const mean = x.slice(1).map((at, i) => Math.abs(y[i + 1] - y[i]) / (at - x[i]));
  return [{ name: `Load: mean force since the stage before, from the ${curve.name}`, units: "N", x: x.slice(1), y: mean }];
}

/** All curves of a result; what does not change is left out. */
export async function curves(job: Job, told: Numbers, solver: Solver): Promise<Curve[]> {
  const stage = told.fields.stage;
  const x = stage.values as number[];
  const vectors = told.known.filter((name) => !(name in told.fields) && LOADS.includes(solver.fields[name]?.units));
  const more = vectors.length ? (await numbers(job, vectors)).fields : {};
  const all = Object.entries({ ...told.fields, ...more }).filter(
    ([name, field]) => !ABOUT.includes(name) && field.dims[0] === "stage" && field.shape.slice(1).reduce((a, b) => a * b, 1) <= MOST,
  );
  const found = all.flatMap(([name, field]) => own(field, name, x)).filter((curve) => curve.y.every(Number.isFinite));
  const changing = found.filter((curve) => Math.max(...curve.y) - Math.min(...curve.y) > 1e-12 * Math.max(...curve.y.map(Math.abs)));
  return [...changing.flatMap((curve) => forces(curve, stage.units)), ...changing];
}
