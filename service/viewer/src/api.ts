// The service in types: what it offers, what it answers, and how it says no. Knows nothing of three.js or the page.

import type { Look } from "./looks";

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
  presets: string[];
  portrait: Point;
  links: { thumbnail: string };
  complaint?: string;
}

export interface Solver {
  name: string;
  title: string;
  presets: Record<string, Record<string, number | number[]>>;
  looks: Look;
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
    /** The last part of its type, and the status; of the service's own problems alone. */
    readonly kind: string,
    readonly status = 0,
  ) {
    super(`${detail} ${advice}`.trim());
  }
}

async function get(path: string, options: RequestInit = {}): Promise<Response> {
  let response: Response;
  try {
    response = await fetch(path, options);
  } catch {
    throw new Problem("The service does not answer.", "Start it with `wizen serve`; this page tries again by itself.", "");
  }
  if (response.ok) return response;
  const body = await response.json().catch(() => ({}));
  const kind = String(body.type ?? "").replace("urn:wizen:problem:", "");
  throw new Problem(body.detail ?? `The service answered ${response.status}.`, body.advice ?? "", kind, response.status);
}

export async function tables(): Promise<Table[]> {
  return (await (await get("v1/tables")).json()).tables;
}

export async function families(): Promise<Family[]> {
  const all: Family[] = (await (await get("v1/maps")).json()).maps;
  return all.filter((family) => !family.complaint);
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

export async function shape(asked: Asked): Promise<Answer> {
  const begin = performance.now();
  return read(await get(address(asked, "points")), begin);
}

async function read(response: Response, begin: number): Promise<Answer> {
  const buffer = await response.arrayBuffer();
  const head = new DataView(buffer);
  if (buffer.byteLength < HEAD || head.getUint32(0, true) !== MAGIC || head.getUint32(4, true) !== 1) {
    throw new Problem("The service sent points that this page cannot read.", "Reload the page.", "");
  }
  const n = head.getUint32(8, true);
  const length = head.getUint32(12, true);
  const about: About = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, HEAD, length)));
  const points = new Float32Array(buffer, HEAD + length, 3 * (2 * n * n + 2));
  return { about, points, n, milliseconds: performance.now() - begin, bytes: buffer.byteLength };
}

/** A job of the service, as far as this page looks at it. */
export interface Job {
  state: "wanted" | "running" | "done" | "failed" | "cancelled";
  progress: { fraction: number; message: string };
  problem: { detail: string; advice: string } | null;
  links: { self: string; events: string; result?: string };
}

/** Paths in answers begin at the service's root; the page may lie below one of a proxy. */
const relative = (path: string): string => path.replace(/^\//, "");
const allowed = (token: string): RequestInit => ({ headers: { Authorization: `Bearer ${token}` }, cache: "no-store" });

/** Ask for a shape that errs by nothing: the shape if it is there, else the job that computes it. */
export async function runExactly(asked: Asked, token: string): Promise<Answer | Job> {
  const begin = performance.now();
  const response = await get(`${address(asked, "points")}&exact=run&max_error=0`, allowed(token));
  const isJob = response.headers.get("content-type")?.startsWith("application/json");
  return isJob ? response.json() : read(response, begin);
}

/** Follow a job until it ends, however often the line breaks. */
export function follow(job: Job, told: (job: Job) => void): Promise<Job> {
  return new Promise((resolve, reject) => {
    const events = new EventSource(relative(job.links.events));
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

export async function stop(job: Job, token: string): Promise<void> {
  await get(relative(job.links.self), { ...allowed(token), method: "DELETE" });
}
