// Shapes and what they are looked up in: what the service offers and answers. Knows nothing of three.js or the page.

import { allowed, get, Problem, read } from "./http";
import type { Job } from "./jobs";

export interface Axis {
  lowest: number;
  highest: number;
  units: string;
  description: string;
}

export interface Table {
  name: string;
  solver: string;
  digest: string;
  samples: number;
  resolution: number;
  /** The finest that the service computes of it. */
  max_resolution: number;
  methods: { default: string; known: string[]; judged: string | null };
  axes: Record<string, Axis>;
  fixed: Record<string, unknown>;
  stage: { symbol: string; long_name: string; units: string; lowest: number; highest: number; stored: number[] };
  complaint?: string;
}

/** What a table covers, and where its picture is taken. */
export interface Family {
  name: string;
  solver: string;
  samples: number;
  quality: string | null;
  axes: Record<string, { values: number[] }>;
  fixed: Record<string, unknown>;
  presets: string[];
  portrait: Point;
  links: { thumbnail: string };
  complaint?: string;
}

export interface Described {
  value: number;
  units: string;
  long_name: string;
}

/** What an answer says about itself; an error that nobody knows is null. */
export interface About {
  exact: boolean;
  converged: boolean;
  nearest: number | null;
  digest: string;
  stage: { symbol: string; value: number };
  weights: Record<string, number>;
  descriptors: Record<string, Described>;
  lattice: { colatitude: number; azimuth: number };
  inside: boolean;
  /** Measured on the mesh itself; null where it was not computed. */
  crossings: number | null;
  volume: number | null;
  /** Share of the wrinkles' height that a lattice as fine as this holds at least. */
  held: number | null;
  expected_error: Record<string, number> | null;
  method: string;
  /** How it came about: looked up in a table, relaxed from there, or a run. */
  tier: string;
}

export interface Answer {
  about: About;
  /** Lattice rows, then the two poles: 3 (2 n^2 + 2) numbers in units of r1. */
  points: Float32Array;
  n: number;
  milliseconds: number;
  bytes: number;
}

export type Point = Record<string, number>;

export const tables = async (): Promise<Table[]> => (await read<{ tables: Table[] }>("v1/tables")).tables;

export async function families(): Promise<Family[]> {
  const all = (await read<{ maps: Family[] }>("v1/maps")).maps;
  return all.filter((family) => !family.complaint);
}

/** What is asked: a point on a table's axes with the stage, how finely, and by which method of look-up. */
export interface Asked {
  table: Table;
  point: Point;
  resolution: number;
  method: string;
}

/** The address of a shape relative to the page; numbers are rounded as far as nobody can see it. */
export function address({ table, point, resolution, method }: Asked, format: string): string {
  const query = new URLSearchParams();
  for (const [name, value] of Object.entries(point)) query.set(name, String(Number(value.toPrecision(5))));
  query.set("resolution", String(resolution));
  query.set("format", format);
  query.set("table", table.name);
  if (method !== table.methods.default) query.set("method", method);
  return `v1/shapes/${encodeURIComponent(table.solver)}?${query}`;
}

/** A preset's shape at a stage, as fine as asked, by a table's default method. */
export async function named(table: Table, preset: string, stage: number, resolution: number): Promise<Answer> {
  const begin = performance.now();
  const query = new URLSearchParams({ preset, [table.stage.symbol]: String(stage), resolution: String(resolution), format: "points" });
  return points(await get(`v1/shapes/${encodeURIComponent(table.solver)}?${query}`), begin);
}

const MAGIC = 0x50_5a_49_57; // "WIZP", read as a little-endian number
const HEAD = 16;

export async function shape(asked: Asked): Promise<Answer> {
  const begin = performance.now();
  return points(await get(address(asked, "points")), begin);
}

async function points(response: Response, begin: number): Promise<Answer> {
  const buffer = await response.arrayBuffer();
  const head = new DataView(buffer);
  if (buffer.byteLength < HEAD || head.getUint32(0, true) !== MAGIC || head.getUint32(4, true) !== 1) {
    throw new Problem("The service sent points that this page cannot read.", "Reload the page.", "");
  }
  const n = head.getUint32(8, true);
  const length = head.getUint32(12, true);
  const about: About = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, HEAD, length)));
  const found = new Float32Array(buffer, HEAD + length, 3 * (2 * n * n + 2));
  return { about, points: found, n, milliseconds: performance.now() - begin, bytes: buffer.byteLength };
}

/** How a shape may be computed instead of looked up: relaxed from what the table gives, or run from the start. */
export type Tier = "relax" | "run";

/** Ask for a shape that is computed: the shape if it is there, else the job that computes it. */
export async function compute(asked: Asked, tier: Tier): Promise<Answer | Job> {
  const begin = performance.now();
  const how = tier === "run" ? "exact=run&max_error=0" : "exact=relax";
  const response = await get(`${address(asked, "points")}&${how}`, allowed());
  const isJob = response.headers.get("content-type")?.startsWith("application/json");
  return isJob ? response.json() : points(response, begin);
}
