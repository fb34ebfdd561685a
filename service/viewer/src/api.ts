// The service in types: what it offers, what it answers, and how it says no. Knows nothing of three.js or the page.

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

export interface Solver {
  name: string;
  title: string;
  presets: Record<string, Record<string, number | number[]>>;
  params: { properties: Record<string, { axes?: string[]; default?: unknown }> };
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
  nearest: number;
  digest: string;
  stage: { symbol: string; value: number };
  weights: Record<string, number>;
  descriptors: Record<string, Described>;
  lattice: { colatitude: number; azimuth: number };
  inside: boolean;
  expected_error: Record<string, number> | null;
  method: string;
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

/** An error of the service in its own words (RFC 9457). */
export class Problem extends Error {
  constructor(
    readonly detail: string,
    readonly advice: string,
  ) {
    super(`${detail} ${advice}`.trim());
  }
}

async function get(path: string, signal?: AbortSignal): Promise<Response> {
  let response: Response;
  try {
    response = await fetch(path, { signal });
  } catch (error) {
    if (signal?.aborted) throw error;
    throw new Problem("The service does not answer.", "Start it with `wizen serve`; this page tries again by itself.");
  }
  if (response.ok) return response;
  const body = await response.json().catch(() => ({}));
  throw new Problem(body.detail ?? `The service answered ${response.status}.`, body.advice ?? "");
}

export async function tables(): Promise<Table[]> {
  return (await (await get("v1/tables")).json()).tables;
}

export async function solver(name: string): Promise<Solver> {
  return (await get(`v1/solvers/${encodeURIComponent(name)}`)).json();
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

const MAGIC = 0x50_5a_49_57; // "WIZP", read as a little-endian number
const HEAD = 16;

export async function shape(asked: Asked, signal?: AbortSignal): Promise<Answer> {
  const begin = performance.now();
  const response = await get(address(asked, "points"), signal);
  const buffer = await response.arrayBuffer();
  const head = new DataView(buffer);
  if (buffer.byteLength < HEAD || head.getUint32(0, true) !== MAGIC || head.getUint32(4, true) !== 1) {
    throw new Problem("The service sent points that this page cannot read.", "Reload the page.");
  }
  const n = head.getUint32(8, true);
  const length = head.getUint32(12, true);
  const about: About = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, HEAD, length)));
  const points = new Float32Array(buffer, HEAD + length, 3 * (2 * n * n + 2));
  return { about, points, n, milliseconds: performance.now() - begin, bytes: buffer.byteLength };
}
