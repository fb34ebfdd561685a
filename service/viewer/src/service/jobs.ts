// Jobs: asked for, followed, taken back, and what they computed.

import { allowed, get, Problem, read, relative } from "./http";
import { same, type Solver, type Values } from "./solvers";

export interface Job {
  id: string;
  solver: string;
  version: string;
  state: "wanted" | "running" | "done" | "failed" | "cancelled";
  progress: { fraction: number; message: string };
  seconds: number | null;
  expected: { seconds: number; bytes: number } | null;
  updated: string;
  params: Values;
  /** Parameters that only the job itself says, as meshes. */
  omitted: string[];
  need: { stages: number[]; quality: string; fields: string[]; resolution: number | null };
  problem: { detail: string; advice: string } | null;
  links: { self: string; events: string; result?: string };
}

export interface Wanted {
  solver: string;
  preset?: string;
  params: Values;
  need: { stages: number[]; quality: string; fields: string[] };
}

export interface Numbers {
  params: Values;
  known: string[];
  fields: Record<string, { dims: string[]; shape: number[]; units: string; long_name: string; values: unknown[] }>;
}

/** Ask for a run; the same question is the same job. What was given up is tried once more. */
export async function ask(wanted: Wanted): Promise<Job> {
  const headers = { "Content-Type": "application/json" };
  const body = JSON.stringify({ ...wanted, again: true });
  return (await get("v1/jobs", allowed({ method: "POST", headers, body }))).json();
}

export const job = (id: string): Promise<Job> => read(`v1/jobs/${encodeURIComponent(id)}`);

/** What is stored of a solver, newest first. */
export async function stored(solver: string): Promise<Job[]> {
  const all = (await read<{ jobs: Job[] }>("v1/jobs?state=done&limit=200")).jobs;
  return all.filter((one) => one.solver === solver);
}

/** Whether a job ran a preset as it stands: all that the preset says, and the solver's defaults beside it. */
export const isOf = (found: Job, solver: Solver, preset: string): boolean => !found.omitted.length && changes(found, solver, preset) === 0;

/** The preset that a job's parameters leave in the fewest places, of several the first. */
export function nearest(found: Job, solver: Solver): string {
  const by = new Map(Object.keys(solver.presets).map((name) => [name, changes(found, solver, name)]));
  return [...by.keys()].reduce((best, name) => ((by.get(name) ?? 0) < (by.get(best) ?? 0) ? name : best));
}

/** In how many parameters a job is not as a preset; the seed does not count. */
function changes(found: Job, solver: Solver, preset: string): number {
  const said = solver.presets[preset] ?? {};
  return Object.entries(found.params).filter(([name, value]) => {
    if (name === "seed") return false;
    const meant = name in said ? said[name] : solver.params.properties[name]?.default;
    return meant !== undefined && !includes(value, meant);
  }).length;
}

/** Whether a value has all that is meant; what a preset leaves out of an object is its default. */
function includes(value: unknown, meant: unknown): boolean {
  if (Array.isArray(value) && Array.isArray(meant)) {
    return value.length === meant.length && value.every((one, i) => includes(one, meant[i]));
  }
  if (value && meant && typeof value === "object" && typeof meant === "object" && !Array.isArray(meant)) {
    return Object.entries(meant).every(([name, one]) => includes((value as Values)[name], one));
  }
  return same(value, meant);
}

/** Follow a job until it ends, however often the line breaks. */
export function follow(begun: Job, told: (job: Job) => void, signal?: AbortSignal): Promise<Job> {
  return new Promise((resolve, reject) => {
    const events = new EventSource(relative(begun.links.events));
    signal?.addEventListener("abort", () => events.close());
    const hear = (event: MessageEvent<string>): void => {
      const now: Job = JSON.parse(event.data);
      told(now);
      if (now.state === "wanted" || now.state === "running") return;
      events.close();
      resolve(now);
    };
    events.addEventListener("state", hear);
    events.addEventListener("progress", hear);
    events.addEventListener("error", () => {
      // a broken line mends itself; a closed one does not
      if (events.readyState === EventSource.CLOSED) reject(new Problem("The run cannot be followed.", "Ask again in a while.", ""));
    });
  });
}

export async function cancel(found: Job): Promise<void> {
  await get(relative(found.links.self), allowed({ method: "DELETE" }));
}

/** The address of what a job computed, relative to the page. */
export function result(found: Job, query: Record<string, string | number>): string {
  const words = new URLSearchParams(Object.entries(query).map(([name, value]) => [name, String(value)]));
  return `${relative(found.links.self)}/result?${words}`;
}

/** Numbers by field; without names, those of one number per stage. */
export const numbers = (found: Job, names?: string[]): Promise<Numbers> =>
  read(`${relative(found.links.self)}/fields${names ? `?names=${names.join(",")}` : ""}`);
