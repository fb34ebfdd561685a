// Solvers as the catalogue describes them: parameters with units and bounds, presets, stages, fields.

import type { Look } from "../view/looks";
import { read } from "./http";

/** As much of JSON schema as parameters make use of. */
export interface Schema {
  type?: string;
  title?: string;
  description?: string;
  units?: string;
  default?: unknown;
  minimum?: number;
  maximum?: number;
  exclusiveMinimum?: number;
  exclusiveMaximum?: number;
  enum?: string[];
  const?: string;
  items?: Schema;
  prefixItems?: Schema[];
  minItems?: number;
  maxItems?: number;
  properties?: Record<string, Schema>;
  required?: string[];
  anyOf?: Schema[];
  oneOf?: Schema[];
  discriminator?: { propertyName: string; mapping: Record<string, string> };
  axes?: string[];
  /** Of a list: the number along which its entries follow each other. */
  along?: string;
  $ref?: string;
}

export interface Parameters extends Schema {
  properties: Record<string, Schema>;
  $defs?: Record<string, Schema>;
}

export type Values = Record<string, unknown>;

export interface Solver {
  name: string;
  version: string;
  title: string;
  params: Parameters;
  axes: Record<string, { description: string; units: string; lowest?: number; highest?: number; default?: number }>;
  stages: { symbol: string; long_name: string; units: string; lowest: number; highest: number; default: number[] };
  fields: Record<string, { units: string; long_name: string }>;
  default_fields: string[];
  presets: Record<string, Values>;
  preset_stages: Record<string, number[]>;
  /** Pictures that come with wizen, by preset. */
  portraits: Record<string, { href: string; version: string; quality: string; stage: number }>;
  /** Length of r1 by preset [m]. */
  sizes: Record<string, number>;
  looks: Look;
  qualities: Record<string, { relative_error: number | null; resolution: number | null }>;
  /** Where and how it is worked on live, if it can be. */
  session?: { address: string; actions: Record<string, Parameters>; fields: string[] } | null;
}

export interface Entry {
  name: string;
  title: string;
  /** The word for what happens along its stages. */
  advance: string;
}

export const solvers = async (): Promise<Entry[]> => (await read<{ solvers: Entry[] }>("v1/solvers")).solvers;

const known = new Map<string, Promise<Solver>>();

/** A solver's page, asked for once. */
export function solver(name: string): Promise<Solver> {
  let found = known.get(name);
  if (!found) {
    found = read<Solver>(`v1/solvers/${encodeURIComponent(name)}`);
    found.catch(() => known.delete(name));
    known.set(name, found);
  }
  return found;
}

/** Whether two values are the same as JSON. */
export function same(a: unknown, b: unknown): boolean {
  if (a === b) return true;
  if (Array.isArray(a) && Array.isArray(b)) return a.length === b.length && a.every((value, i) => same(value, b[i]));
  if (a && b && typeof a === "object" && typeof b === "object") {
    const names = new Set([...Object.keys(a), ...Object.keys(b)]);
    return [...names].every((name) => same((a as Values)[name], (b as Values)[name]));
  }
  return false;
}
