// Scenes: many shapes as one file.

import { get } from "./http";

/** What things stand on, in the scene's unit. */
export interface Ground {
  points: number[][];
  faces: number[][];
}

export interface Item {
  preset: string;
  stage: number;
  count: number;
  seed: number;
  vary: number;
  /** Length of r1, or as large as such fruits are. */
  size: number | "real";
  place: string;
}

export interface Scene {
  unit: number;
  camera: { position: number[]; target: number[]; fov: number; width: number; height: number };
  places: { name: string; rule: string; radius?: number; mesh?: Ground; seed: number }[];
  items: Item[];
  cull: boolean;
  budget: { triangles?: number };
}

/** What the service says of a scene beside its file. */
export interface Report {
  instances: number;
  shown: number;
  kinds: number;
  meshes: number;
  triangles: number;
  bytes: number;
  [more: string]: unknown;
}

export async function scene(wanted: Scene, format: string, compress: boolean, signal?: AbortSignal): Promise<{ data: ArrayBuffer; report: Report }> {
  const response = await get(`v1/scenes?format=${format}&compress=${compress}`, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(wanted),
    signal,
  });
  return { data: await response.arrayBuffer(), report: JSON.parse(response.headers.get("Wizen-Scene") ?? "{}") };
}

const toml = (value: unknown): string =>
  typeof value === "object" && value !== null && !Array.isArray(value)
    ? `{${Object.entries(value).map(([name, one]) => `${name} = ${toml(one)}`).join(", ")}}`
    : JSON.stringify(value);

/** The scene as the file that `wizen scene` takes. */
export function asToml({ unit, camera, places, items, cull, budget }: Scene): string {
  const table = (head: string, values: object): string[] => [
    "",
    head,
    ...Object.entries(values).map(([name, value]) => `${name} = ${toml(value)}`),
  ];
  const lines = [`unit = ${unit}`, `cull = ${cull}`, ...table("[camera]", camera), ...table("[budget]", budget)];
  for (const place of places) lines.push(...table("[[places]]", place));
  for (const item of items) lines.push(...table("[[items]]", item));
  return `${lines.join("\n")}\n`;
}
